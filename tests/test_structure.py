"""The rooms' rules: who imports whom, where the world outside is touched, where numbers live, what a drone installs."""

import argparse
import ast
import collections
import functools
import graphlib
import importlib
import itertools
import re
import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest

import bench.main
import rebound_cli.main

PACKAGES = ("companion", "sim_vehicle", "rebound_cli", "bench")
ROOT = Path(__file__).parent.parent


@functools.cache
def imported_names(path: Path) -> frozenset[str]:
    """Full names of all that a file imports; of `from a import b` both `a` and `a.b`, which may be a module."""
    names: set[str] = set()
    for node in _statements(ast.parse(path.read_text())):
        if isinstance(node, ast.Import):
            names.update(alias.name for alias in node.names)
        elif isinstance(node, ast.ImportFrom):
            if node.level:
                raise ValueError(f"{path} imports relatively")
            package = node.module or ""
            names.update((package, *(f"{package}.{alias.name}" for alias in node.names)))
    return frozenset(names)


def _statements(node: ast.AST) -> Iterator[ast.AST]:
    """All below it, however deep; an expression holds none."""
    for child in ast.iter_child_nodes(node):
        if not isinstance(child, ast.expr):
            yield child
            yield from _statements(child)


@functools.cache
def imports_of_all() -> dict[str, set[str]]:
    """Every module of the project, and those of them that it imports."""
    files = [path for name in PACKAGES for path in (ROOT / name).rglob("*.py")]
    names = [".".join(path.relative_to(ROOT).with_suffix("").parts).removesuffix(".__init__") for path in files]
    paths = dict(zip(names, files, strict=True))
    return {module: {name for name in imported_names(path) if name in paths} for module, path in paths.items()}


# Modules through which code touches the world outside: sockets, ports, clocks, processes, the environment, files.
OUTSIDE = {
    *("socket", "select", "serial", "asyncio", "threading", "subprocess", "signal"),
    *("time", "datetime", "os", "sys", "shutil", "tempfile", "pathlib", "io"),
}
# Built-in airframes and the tables of parameters are read where they lie; compiled kernels in the user's cache.
MAY_READ_FILES = {
    "sim_vehicle/airframe.py",
    "sim_vehicle/parameters/sitl.py",
    "sim_vehicle/parameters/store.py",
    "sim_vehicle/physics/jit.py",
}


def sources(package: str) -> list[Path]:
    return sorted((ROOT / package).rglob("*.py"))


def name(path: Path) -> str:
    return path.relative_to(ROOT).as_posix()


def breaches(packages: tuple[str, ...], forbidden: set[str]) -> list[str]:
    return [
        f"{name(path)} imports {module}"
        for package in packages
        for path in sources(package)
        for module in imported_names(path)
        if module.split(".")[0] in forbidden
    ]


def test_there_is_something_to_check() -> None:
    assert all(len(sources(package)) > 10 for package in PACKAGES)


def test_companion_and_vehicle_never_import_each_other_nor_the_command_line() -> None:
    assert breaches(("companion",), {"sim_vehicle", "rebound_cli"}) == []
    assert breaches(("sim_vehicle",), {"companion", "rebound_cli"}) == []


def test_how_the_reflex_decides_and_believes_stays_behind_its_door() -> None:
    # Values go through the door, and settings; to compare with other detectors the laboratory looks behind it.
    behind = ("classify", "confirmation", "crash", "free_flight", "fused", "jumps", "sustained_force")
    hidden = {f"companion.reflex.detection.{name}" for name in behind}
    hidden |= {"companion.reflex.belief.filter_bank", "companion.reflex.belief.motion_estimator"}
    found = [
        f"{module} imports {name}"
        for module, names in imports_of_all().items()
        for name in names & hidden
        if module.startswith("companion.") and not module.startswith("companion.reflex.")
    ]
    assert found == []


def test_nothing_that_is_installed_needs_the_laboratory() -> None:
    assert breaches(("companion", "sim_vehicle", "rebound_cli"), {"bench"}) == []


def test_pymavlink_is_imported_only_where_bytes_become_messages() -> None:
    allowed = ("companion/mavlink/", "sim_vehicle/mavlink/", "rebound_cli/logs/dataflash.py")
    allowed += ("bench/fly/commanded.py", "bench/fly/counted.py", "bench/fly/packets.py", "bench/studies/speed.py")
    assert [breach for breach in breaches(PACKAGES, {"pymavlink"}) if not breach.startswith(allowed)] == []


@pytest.mark.parametrize("package", ["companion", "sim_vehicle"])
def test_only_the_shell_touches_the_world_outside(package: str) -> None:
    found = [
        breach
        for breach in breaches((package,), OUTSIDE)
        if not breach.startswith(f"{package}/shell/") and breach.split(" ")[0] not in MAY_READ_FILES
    ]
    assert found == []


def test_no_module_or_folder_needs_itself_by_way_of_others() -> None:
    # Not even late or for its types alone: two files that need each other are one concept, or hide a third. The way of
    # the data is the way of the files. A file beside the folders counts as one of them.
    arrows: dict[str, set[str]] = {}
    for module, names in imports_of_all().items():
        for name in names:
            # The two that stand in one folder: of a.b.c and a.d they are a.b and a.d.
            ways = (itertools.accumulate(each.split("."), "{}.{}".format) for each in (module, name))
            apart = [pair for pair in zip(*ways, strict=False) if pair[0] != pair[1]]
            if apart:
                arrows.setdefault(apart[0][0], set()).add(apart[0][1])
    for each in (imports_of_all(), arrows):
        graphlib.TopologicalSorter(each).prepare()


def test_no_folder_of_code_has_more_than_twelve_files() -> None:
    # A folder is held in the head. Its data count.
    folders = {path.parent for package in (*PACKAGES, "tests") for path in sources(package)}
    files = [path for folder in folders for path in folder.iterdir() if path.is_file() and path.name != "__init__.py"]
    counts = collections.Counter(name(path.parent) for path in files)
    assert {folder: count for folder, count in counts.items() if count > 12} == {}


def test_what_a_text_in_the_code_refers_to_is_there() -> None:
    # "(see room.module)" and "(see module.name)" outlive the module when it is merged into another.
    modules = {part for package in PACKAGES for path in sources(package) for part in path.with_suffix("").parts}
    missing = [
        f"{name(path)}: {reference}"
        for package in PACKAGES
        for path in sources(package)
        for reference in re.findall(r"\(see ([a-z_]+\.[a-z_]+)\b", path.read_text())
        if reference.split(".")[0] not in modules
    ]
    assert missing == []


# Prefixes of PX4's parameters; numbers as px4_custom_mode.h packs them.
OF_PX4 = (
    re.compile(r"\b(?:BAT\d?|CA|CBRK|COM|CP|EKF2|FD|GF|IMU|MC|MIS|MPC|NAV|RTL|SENS|SER|SYS)_[A-Z][A-Z0-9_]+\b"),
    re.compile(r"\bMAV_(?:[0-9nx]_[A-Z]+|PROTO_VER)\b"),
    re.compile(r"\b\d+ << (?:16|24)\b"),
)
OF_ARDUPILOT = (re.compile(r"\b(?:ARMING|ATC|BATT|GUID|INS|MOT|PSC|SERIAL[0-9n]|WP)_[A-Z][A-Z0-9_]+\b"),)
# MAVLink's message; reasons of the numbers of motion are still where the numbers are.
NO_PARAMETER = {"SYS_STATUS"}
ROOMS_OF_NUMBERS = ("companion/autopilot/px4/", "companion/reflex/", "companion/motion/")


@pytest.mark.parametrize(
    ("patterns", "rooms"), [(OF_PX4, ROOMS_OF_NUMBERS), (OF_ARDUPILOT, ("companion/autopilot/ardupilot/",))]
)
def test_one_folder_names_what_is_one_autopilots(patterns: tuple[re.Pattern[str], ...], rooms: tuple[str, ...]) -> None:
    found = [
        f"{name(path)}: {word}"
        for path in sources("companion")
        for pattern in patterns
        for word in pattern.findall(path.read_text())
        if word not in NO_PARAMETER and not name(path).startswith(rooms)
    ]
    assert found == []


def test_an_autopilots_folder_is_known_to_the_table_of_autopilots_alone() -> None:
    assert [
        module
        for module, names in imports_of_all().items()
        if module.startswith("companion.")
        and not module.startswith("companion.autopilot.")
        and any(name.startswith(("companion.autopilot.px4", "companion.autopilot.ardupilot")) for name in names)
    ] == []


def commands_of(parser: argparse.ArgumentParser) -> Iterator[argparse.ArgumentParser]:
    for action in parser._actions:
        if isinstance(action, argparse._SubParsersAction):
            for command in action.choices.values():
                yield command
                yield from commands_of(command)


@pytest.mark.parametrize("main", [bench.main, rebound_cli.main])
def test_every_command_runs_a_function_that_there_is(main: Any) -> None:
    # Commands name their function in text, to import it late: no type checker sees a wrong one.
    runs = [run for command in commands_of(main.build_parser()) if (run := command.get_default("run"))]
    assert len(runs) > 5
    for module, function in (run.args for run in runs):
        assert callable(getattr(importlib.import_module(module), function)), function


COMPANION = ROOT / "companion"
CONFIGS = [COMPANION / "reflex" / "config.py", COMPANION / "motion" / "config.py"]
# Nothing, one, two, a half; microseconds and seconds, metres and centimetres; what only rounding makes.
FREE = {0, 1, 2, 0.5, 1e6, 1e-6, 0.5e-6, 1e3, 100, 1e-9}
# Those that a derivation gives.
DERIVED = {
    "reflex/detection/jumps.py": {3},  # axes; Student's t by degrees of freedom
    "reflex/belief/filter_bank.py": {3},  # axes
    "reflex/detection/free_flight.py": {3, 4},  # axes, and a column more
    "reflex/detection/impact.py": {4},  # a beginning that is known by two windows: half of half a window
    "reflex/detection/monitor.py": {3},  # shown decimals
    "reflex/detection/health.py": {3, 3600},  # shown decimals; seconds an hour
    "flight/after_hit.py": {3},  # shown decimals
}
# A damaged motor decides no hit and no recovery.
OTHERS = {"motors.py"}
FLIGHT = ("after_hit", "handlers/recovering")
HEART = [path for room in ("motion", "reflex") for path in sorted((COMPANION / room).rglob("*.py"))]
HEART += [COMPANION / "flight" / f"{name}.py" for name in FLIGHT]
WITH_NUMBERS = [path for path in HEART if path not in CONFIGS and path.name not in OTHERS]


def numbers(path: Path) -> set[float]:
    constants = (node.value for node in ast.walk(ast.parse(path.read_text())) if isinstance(node, ast.Constant))
    return {value for value in constants if type(value) in (int, float)}


@pytest.mark.parametrize("path", WITH_NUMBERS, ids=lambda path: path.stem)
def test_a_number_outside_the_two_files_is_a_unit_or_is_derived(path: Path) -> None:
    derived = DERIVED.get(path.relative_to(COMPANION).as_posix(), set())
    assert numbers(path) - FREE == derived


@pytest.mark.parametrize("path", CONFIGS, ids=lambda path: path.parent.name)
def test_every_number_has_its_reason(path: Path) -> None:
    module, lines = ast.parse(path.read_text()), path.read_text().splitlines()
    # A comment above it, or above the number that it shares one with.
    missing = [
        ast.unparse(node) for node in module.body if isinstance(node, ast.Assign) and not lines[node.lineno - 2].strip()
    ]
    for settings in (node for node in module.body if isinstance(node, ast.ClassDef)):
        for field, text in zip(settings.body, [*settings.body[1:], None], strict=True):
            if isinstance(field, ast.AnnAssign) and isinstance(field.value, ast.Constant):
                is_text = isinstance(text, ast.Expr) and isinstance(text.value, ast.Constant)
                missing += [] if is_text else [f"{settings.name}.{ast.unparse(field.target)}"]
    assert missing == []


# Everything that only an extra brings.
LEFT_OUT = (
    *("numba", "filterpy", "scipy", "matplotlib", "pandas", "tabulate"),
    *("mavsdk", "pyulog", "mcap", "pygeomag", "pytest", "rich"),
)
WITHOUT = f"import sys\nsys.modules.update(dict.fromkeys({LEFT_OUT!r}))\n"
# What Python tells its auditors of a process that is started.
STARTS = ("subprocess.Popen", "os.fork", "os.posix_spawn")
QUICK = ("--set", "companion.link.heartbeat_wait_s=0.2")


def alone(code: str) -> subprocess.CompletedProcess[str]:
    return subprocess.run([sys.executable, "-c", WITHOUT + code], cwd=ROOT, capture_output=True, text=True, timeout=120)


def test_missions_are_checked_and_drawn(tmp_path):
    code = f"from rebound_cli.main import main\nsys.exit(main(['check', 'wall', 'square', '--out', {str(tmp_path)!r}]))"
    done = alone(code)
    assert done.returncode == 0, done.stderr
    assert done.stdout.count("drawn in") == 2


def test_what_an_extra_brings_is_named_package_by_package_for_the_python_that_runs():
    done = alone("from rebound_cli.main import main\nsys.exit(main(['sim']))")
    assert done.returncode == 1
    assert f"[sim]: {sys.executable} -m pip install 'numba>=" in done.stderr and "'matplotlib>=" in done.stderr


def test_a_mission_is_flown_and_a_wall_recovered_from():
    code = """
from tests.companion.fake_vehicle import FakeVehicle, flight
f = flight(FakeVehicle(wall_north_m=3.0), items=[
    {"takeoff": {"height_m": 1.5}}, {"go_to": {"position_ned_m": [5, 0, -1.5], "speed_m_s": 2.0}}, {"land": {}}])
f.run_to("holding")
f.run_to_end()
assert len(f.report.collisions) == 1 and f.report.outcome == "completed"
"""
    done = alone(code)
    assert done.returncode == 0, done.stderr


def test_help_imports_nothing_that_is_slow():
    code = "import sys\nfrom rebound_cli.main import build_parser\nbuild_parser()\nprint(*sys.modules)"
    imported = alone(code).stdout.split()
    assert not {"numpy", "pydantic", "pymavlink", "shapely", "sim_vehicle", "yaml"} & set(imported)


@pytest.mark.parametrize("command", [("guard",), ("fly", "wall", "--yes")])
def test_a_drones_start_reads_no_source_starts_no_process_and_loads_no_simulated_vehicle(tmp_path, command):
    code = f"""
import gc, linecache, sys
from rebound_cli.main import main
sys.addaudithook(lambda event, _: event in {STARTS!r} and print("started:", event))
main([*{command!r}, "--connect", "udpin://127.0.0.1:0", "--out", {str(tmp_path / "run")!r}, *{QUICK!r}])
simulated = {{name for name in sys.modules if name.startswith("sim_vehicle.")}} - {{"sim_vehicle.errors"}}
print(*linecache.cache, *simulated, gc.isenabled(), gc.get_freeze_count())
"""
    said = alone(code).stdout
    assert "no HEARTBEAT" in said
    # Then the collector is as it was, and no line tells of a file of source or of a process
    assert said.splitlines()[-1] == "True 0" and "started:" not in said
