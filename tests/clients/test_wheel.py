"""The wheel in environments of its own, `drone` and `sim` of the folder WHEEL, as somebody has it who has no checkout.

`make wheel` makes the environments and runs this. The drone's user has no home and may write nowhere but below /tmp.
"""

import os
import shlex
import signal
import subprocess
from pathlib import Path

import pytest
from simulator import ROOT, simulator, wait_until

from tests.docs.test_examples import blocks, command_lines, consoles, differs

WHEEL = Path(os.environ["WHEEL"])
# Root may write everywhere; without its capabilities it is a user like any other.
POWERLESS = ["setpriv", "--bounding-set=-all", "--inh-caps=-all"] if os.geteuid() == 0 else []
# A drone needs none of them.
NOT_IMPORTED = ("numba", "filterpy", "scipy", "matplotlib", "pandas", "tabulate", "mavsdk", "rich", "pytest")
REBOUND = f"""
import sys
from rebound_cli.main import main
try:
    code = main()
finally:
    assert not set(sys.modules) & set({NOT_IMPORTED!r}), sorted(set(sys.modules) & set({NOT_IMPORTED!r}))
sys.exit(code)
"""
QUICK = ("--set", "companion.link.heartbeat_wait_s=0.2")


@pytest.fixture(scope="module", autouse=True)
def read_only():
    """Nothing can be written into the environments, as root's on a drone that a user runs."""
    folders = [folder for name in ("drone", "sim") for folder in (WHEEL / name).rglob("*") if folder.is_dir()]
    for folder in folders:
        folder.chmod(0o555)
    yield
    for folder in folders:
        folder.chmod(0o755)


@pytest.fixture
def nowhere(tmp_path):
    folder = tmp_path / "read-only"
    folder.mkdir(mode=0o555)
    return folder


def start(environment, folder, *arguments, **more):
    command = [*POWERLESS, WHEEL / environment / "bin/python", *arguments]
    where = {"cwd": folder, "env": {"PATH": os.environ["PATH"], "LANG": "C.UTF-8", **more}}
    return subprocess.Popen(
        command, **where, text=True, stdin=subprocess.DEVNULL, stdout=subprocess.PIPE, stderr=subprocess.PIPE
    )


def finished(process, timeout_s):
    stdout, stderr = process.communicate(timeout=timeout_s)
    return process.returncode, stdout, stderr


def drone(folder, *arguments):
    return start("drone", folder, "-c", REBOUND, *map(str, arguments))


@pytest.mark.parametrize(
    ("arguments", "exit_code", "words"),
    [
        (("--help",), 0, "COMMAND"),
        (("--version",), 0, "rebound "),
        (("check", "wall", "square", "--no-picture"), 0, "Unattended"),
        (("guard", "--connect", "udpin://127.0.0.1:0"), 1, "The run folder runs cannot be made: nothing can be"),
        (("fly", "square", "--connect", "udpin://127.0.0.1:0"), 1, "The run folder runs cannot be made: nothing can"),
        (("fly", "wall"), 1, "The run folder runs cannot be made: nothing can be written"),
        (("guard", "--connect", "udpin://127.0.0.1:0", "--out", "OUT", *QUICK), 1, "No HEARTBEAT from an autopilot"),
        (("fly", "wall", "--lockstep", "--out", "OUT"), 1, "this needs numba, of the extra [sim]: "),
        (("sim",), 1, "this needs numba, of the extra [sim]: "),
        (("init", "--list"), 0, "--example guarded_offboard"),
        (("key", "new", "vehicle.key"), 1, "vehicle.key: cannot be written: Permission denied."),
        (("replay", "flight.ulg"), 1, "-m pip install 'pyulog>=1.2' 'mcap>=1.3'"),
    ],
)
def test_a_command_works_or_says_in_one_sentence_why_not(arguments, exit_code, words, nowhere, tmp_path):
    process = drone(nowhere, *(tmp_path / "run" if word == "OUT" else word for word in arguments))
    code, stdout, stderr = finished(process, timeout_s=60)
    assert code == exit_code, stderr
    assert words in (stderr if exit_code else stdout) and "Traceback" not in stderr
    assert stderr.count("rebound: ") == exit_code


def test_a_mission_is_flown_guarded_and_looked_over_on_a_connection(nowhere, tmp_path):
    hop = "items=[{takeoff: {height_m: 1.5}}, {land: {}}]"
    with simulator() as vehicle:
        address = f"udpin://127.0.0.1:{vehicle.companion_port}"
        code, stdout, stderr = finished(drone(nowhere, "preflight", "--connect", address), 60)
        assert "COM_OF_LOSS_T" in stdout, stderr
        guard = drone(nowhere, "guard", "--connect", address, "--out", tmp_path / "guard")
        events = tmp_path / "guard" / "events.jsonl"
        wait_until(lambda: events.exists() and "standing by" in events.read_text(), 60, "the guard stands by")
        guard.send_signal(signal.SIGINT)
        code, stdout, stderr = finished(guard, 30)
        assert code == 0, stderr
        flight = drone(nowhere, "fly", "square", "--connect", address, "--yes", "--set", hop, "--out", tmp_path / "fly")
        code, stdout, stderr = finished(flight, 90)
        assert code == 0, stdout + stderr


@pytest.fixture(scope="module")
def home(tmp_path_factory):
    """Kernels are compiled once, and kept there."""
    return str(tmp_path_factory.mktemp("home"))


def typed(page):
    """What a page has somebody type after `rebound`, and what it then shows; `service install` without a change."""
    shown = {shlex.join(shlex.split(command)): text for command, text in consoles(ROOT / page)}
    lines = (words for words in command_lines(ROOT / page) if words and Path(words[0]).name == "rebound")
    told = [(words[1:], shown.get(shlex.join(words))) for words in lines]
    return [([*words, "--dry-run"] if words[:2] == ["service", "install"] else words, text) for words, text in told]


PAGES = ["README.md", *sorted(str(path.relative_to(ROOT)) for path in (ROOT / "docs/tutorials").glob("*.md"))]


@pytest.mark.parametrize("page", [page for page in PAGES if typed(page)])
def test_what_a_page_has_somebody_type_works_without_a_checkout(page, tmp_path, home):
    settings = [text for language, text in blocks(ROOT / page) if language == "yaml"]
    (tmp_path / "guard.yaml").write_text("".join(settings[:1]))
    for words, shown in typed(page):
        process = start("sim", tmp_path, WHEEL / "sim/bin/rebound", *words, HOME=home, COLUMNS="120")
        if words[0] == "sim":
            assert process.stdout.readline().startswith("Simulated vehicle"), words
            process.send_signal(signal.SIGINT)
        code, stdout, stderr = finished(process, 600)
        if words[0] == "service":
            # What would be written, and that it is not there.
            says = "# /etc/systemd/system/rebound.service" if words[1] == "install" else "rebound.service is not there"
            assert code == (words[1] == "check") and says in stdout and not stderr, stdout + stderr
        elif any("/dev/tty" in word for word in words):
            # Where there is no drone that is the one thing that is said
            assert code != 0 and "does not exist" in stderr and stderr.count("\n") == 1, stderr
        elif words == ["status"]:
            assert code == 1 and "Nothing answers" in stderr
        else:
            assert code == 0, f"{words}\n{stdout}{stderr}"
            assert differs(shown or "", stdout) is None, f"{words}\n{differs(shown, stdout)}"
