"""What a drone installs is enough for what a drone does: tried in a process that has no more."""

import subprocess
import sys
from pathlib import Path

ROOT = Path(__file__).parent.parent
# Everything that only an extra brings.
LEFT_OUT = (
    *("numba", "filterpy", "scipy", "matplotlib", "pandas", "tabulate"),
    *("mavsdk", "pyulog", "mcap", "pygeomag", "pytest", "rich"),
)
WITHOUT = f"import sys\nsys.modules.update(dict.fromkeys({LEFT_OUT!r}))\n"
# What Python tells its auditors of a process that is started.
STARTS = ("subprocess.Popen", "os.fork", "os.posix_spawn")
QUICK = ("--set", "companion.link.heartbeat_wait_s=0.2")


def alone(code: str, folder: Path) -> subprocess.CompletedProcess[str]:
    return subprocess.run([sys.executable, "-c", WITHOUT + code], cwd=ROOT, capture_output=True, text=True, timeout=120)


def test_missions_are_checked_and_drawn(tmp_path):
    code = f"from rebound_cli.main import main\nsys.exit(main(['check', 'wall', 'square', '--out', {str(tmp_path)!r}]))"
    done = alone(code, tmp_path)
    assert done.returncode == 0, done.stderr
    assert done.stdout.count("drawn in") == 2


def test_what_an_extra_brings_is_named_package_by_package_for_the_python_that_runs(tmp_path):
    done = alone("from rebound_cli.main import main\nsys.exit(main(['sim']))", tmp_path)
    assert done.returncode == 1
    assert f"[sim]: {sys.executable} -m pip install 'numba>=" in done.stderr and "'matplotlib>=" in done.stderr


def test_a_mission_is_flown_and_a_wall_recovered_from(tmp_path):
    code = """
from tests.companion.fake_vehicle import FakeVehicle, flight
f = flight(FakeVehicle(wall_north_m=3.0), items=[
    {"takeoff": {"height_m": 1.5}}, {"go_to": {"position_ned_m": [5, 0, -1.5], "speed_m_s": 2.0}}, {"land": {}}])
f.run_to("holding")
f.run_to_end()
assert len(f.report.collisions) == 1 and f.report.outcome == "completed"
"""
    done = alone(code, tmp_path)
    assert done.returncode == 0, done.stderr


def test_help_imports_nothing_that_is_slow():
    code = "import sys\nfrom rebound_cli.main import build_parser\nbuild_parser()\nprint(*sys.modules)"
    imported = alone(code, ROOT).stdout.split()
    assert not {"numpy", "pydantic", "pymavlink", "shapely", "sim_vehicle", "yaml"} & set(imported)


def test_a_guards_start_reads_no_source_and_starts_no_process(tmp_path):
    code = f"""
import gc, linecache
from rebound_cli.main import main
sys.addaudithook(lambda event, _: event in {STARTS!r} and print("started:", event))
main(["guard", "--connect", "udpin://127.0.0.1:0", "--out", {str(tmp_path / "guarded")!r}, *{QUICK!r}])
print(*linecache.cache, gc.isenabled(), gc.get_freeze_count())
"""
    said = alone(code, tmp_path).stdout
    assert "no HEARTBEAT" in said
    # Then the collector is as it was, and no line tells of a file of source or of a process
    assert said.splitlines()[-1] == "True 0" and "started:" not in said
