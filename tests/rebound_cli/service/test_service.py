"""`rebound service` in a folder that stands for a system's root, and a flight under a systemd that listens."""

import io
import itertools
import os
import shutil
from argparse import Namespace
from pathlib import Path

import pytest

from companion.errors import ReboundError
from companion.report import Status
from companion.shell.service_manager import ServiceManager
from rebound_cli import exit_codes
from rebound_cli.live.console import Console
from rebound_cli.main import main
from rebound_cli.service import check, command
from rebound_cli.service.files import SYSUSERS, UDEV, UNIT, UNIT_NAME, ServiceSettings, udev_text, unit_text
from rebound_cli.service.system import System, answer, hidden_program
from tests.rebound_cli.live.flying import fly

ROOT = Path(__file__).parents[3]
GUARD = ROOT / "examples" / "guard.yaml"
FTDI = "/dev/serial/by-id/usb-FTDI_FT232R_USB_UART_A10-if00-port0"
PIXHAWK = "/dev/serial/by-id/usb-3D_Robotics_PX4_FMU_v5.x_0-if00"
UART = "/dev/ttyAMA0"
UDP = "udpin://0.0.0.0:14540"
PYTHON = "/opt/rebound/bin/python"
NEEDS_SYSTEMD = pytest.mark.skipif(shutil.which("systemd-analyze") is None, reason="there is no systemd-analyze here")


@pytest.fixture
def system(tmp_path, monkeypatch):
    """One with systemd, in a folder, of a careful administrator; the tests' interpreter may be hidden from services."""
    monkeypatch.setattr(command, "hidden_program", lambda: None)
    monkeypatch.setattr(check, "hidden_program", lambda: None)
    monkeypatch.setattr(shutil, "which", lambda program: f"/usr/bin/{program}")
    called = []

    def call(_, *words):
        called.append(words)
        return 0

    monkeypatch.setattr(System, "call", call)
    (tmp_path / "etc").mkdir()
    before = os.umask(0o077)
    yield Namespace(system=System(tmp_path), root=tmp_path, called=called)
    os.umask(before)


def service(system, what, **options):
    given = {"guard": None, "mission": None, "connect": None, "dry_run": False, **options}
    return command.run_service(Namespace(what=what, **given), system.system)


def files(root):
    return {path.relative_to(root).as_posix() for path in root.rglob("*") if path.is_file()}


def unit(connect=f"serial://{UART}:921600", systemd=252, **more):
    return unit_text(ServiceSettings(connect=connect, **more), PYTHON, systemd, "dialout")


def values(text, key):
    return [line.partition("=")[2] for line in text.splitlines() if line.startswith(f"{key}=")]


def test_a_dry_run_needs_nothing_and_prints_each_file_below_its_path_the_unit_last(capsys):
    assert main(["service", "install", "--guard", str(GUARD), "--connect", f"serial://{FTDI}:921600", "--dry-run"]) == 0
    parts = capsys.readouterr().out.split("\n# /")
    paths = [part.partition("\n")[0].removeprefix("# /") for part in parts]
    assert paths == ["etc/rebound/service.yaml", "etc/rebound/guard.yaml", SYSUSERS, UDEV, UNIT]
    assert parts[1].partition("\n")[2].rstrip() == GUARD.read_text().rstrip()
    assert values(parts[-1], "Type") == ["notify"]


def test_a_guard_is_installed_enabled_and_taken_away_again(system, capsys):
    assert service(system, "install", guard=GUARD, connect=f"serial://{UART}:921600") == 0
    etc = {"etc/rebound/service.yaml", "etc/rebound/guard.yaml"}
    assert files(system.root) == etc | {SYSUSERS, UDEV, UNIT}
    # All of it can be read by the service's user
    assert {(system.root / file).stat().st_mode & 0o777 for file in files(system.root)} == {0o644}
    assert (system.root / "etc/rebound").stat().st_mode & 0o777 == 0o755
    assert system.called == [("systemd-sysusers", "rebound.conf"), ("systemctl", "enable", "rebound.service")]
    # And what is taken away leaves what a person wrote
    assert service(system, "uninstall", dry_run=True) == 0
    assert f"/{UNIT}" in capsys.readouterr().out and UNIT in files(system.root)
    assert service(system, "uninstall") == 0
    assert files(system.root) == etc
    assert system.called[-1] == ("systemctl", "disable", "rebound.service")
    with pytest.raises(ReboundError, match="No service of Rebound is installed"):
        service(system, "uninstall")


def test_an_upgrade_keeps_every_value_that_a_person_wrote(system, capsys):
    # Given an installation in which a person has changed both files
    service(system, "install", guard=GUARD, connect=f"serial://{UART}:921600")
    guard, settings = system.root / "etc/rebound/guard.yaml", system.root / "etc/rebound/service.yaml"
    guard.write_text("max_hits: 7  # mine\n")
    settings.write_text(f"# mine\nrun: guard\nconnect: serial://{PIXHAWK}:57600\n")
    kept = guard.read_text(), settings.read_text()
    # When it is installed again, with and without the words of the first time
    capsys.readouterr()
    service(system, "install", guard=GUARD, connect=f"serial://{UART}:921600")
    assert (guard.read_text(), settings.read_text()) == kept
    said = capsys.readouterr().out
    for name in ("service.yaml", "guard.yaml"):
        assert f"kept /etc/rebound/{name}, which says otherwise: change it there" in said
    service(system, "install")
    assert (guard.read_text(), settings.read_text()) == kept
    assert "otherwise" not in capsys.readouterr().out
    # Then the unit follows what the person wrote
    assert (
        PIXHAWK in (system.root / UNIT).read_text()
        and PIXHAWK.removeprefix("/dev/") in (system.root / UDEV).read_text()
    )


def test_a_guard_without_a_file_has_all_defaults(system):
    service(system, "install")
    assert "then: hold" in (system.root / "etc/rebound/guard.yaml").read_text()
    assert "--wait" in values((system.root / UNIT).read_text(), "ExecStart")[0].split()
    assert values((system.root / UNIT).read_text(), "WantedBy") == ["multi-user.target"]
    # A link that is a network now leaves no rule for a port and no device
    (system.root / "etc/rebound/service.yaml").write_text(f"connect: {UDP}\n")
    service(system, "install")
    text = (system.root / UNIT).read_text()
    assert UDEV not in files(system.root)
    assert values(text, "PrivateDevices") == ["yes"] and values(text, "DeviceAllow") == []


def test_a_mission_is_never_flown_at_boot_or_by_a_restart(system, capsys):
    service(system, "install", mission=ROOT / "missions" / "square.yaml", connect=UDP)
    text = (system.root / UNIT).read_text()
    assert values(text, "Restart") == ["no"] and "[Install]" not in text
    assert values(text, "ExecStart")[0].endswith(f"fly /etc/rebound/mission.yaml --yes --connect {UDP}")
    assert system.called[-1][-2:] == ("disable", "rebound.service")
    assert "never by itself" in capsys.readouterr().out


@pytest.mark.parametrize(
    ("options", "words"),
    [
        ({"connect": "nowhere"}, "--connect nowhere: connect: 'nowhere' is not a connection address"),
        ({"connect": "serial:///dev/tty A:9600"}, "is not the name of a device"),
        ({"connect": "serial:///dev/../etc/passwd:9600"}, "is not the name of a device"),
        ({"connect": 'serial:///dev/x"; RUN+="y:9600'}, "is not the name of a device"),
        ({"guard": Path("none.yaml")}, "none.yaml: cannot be read: No such file"),
        ({"guard": ROOT / "missions" / "square.yaml"}, "unknown key 'name'"),
        ({"mission": GUARD}, "is missing"),
    ],
)
def test_what_is_wrong_is_said_before_anything_is_written(system, options, words):
    with pytest.raises(Exception, match=words):
        service(system, "install", **options)
    assert files(system.root) == set() and system.called == []


def test_what_is_wrong_in_a_persons_files_is_named_with_its_place(system, tmp_path):
    mission = tmp_path / "mine.yaml"
    mission.write_text((ROOT / "missions" / "square.yaml").read_text() + "\nobstacles:\n  file: hall.json\n")
    with pytest.raises(Exception, match=r"obstacles\.file: the mission is copied to /etc/rebound"):
        service(system, "install", mission=mission)
    mission.write_text((ROOT / "missions" / "square.yaml").read_text() + "\ncompanion:\n  link:\n    wait: true\n")
    with pytest.raises(Exception, match="a service would arm a vehicle whenever it appears"):
        service(system, "install", mission=mission)
    service(system, "install")
    (system.root / "etc/rebound/service.yaml").write_text("run: guard\nconect: udpin://:1\n")
    with pytest.raises(Exception, match=r"service.yaml:2: conect: unknown key 'conect'; did you mean 'connect'"):
        service(system, "install")
    assert service(system, "check") == 1


def test_a_system_that_is_unfit_is_one_sentence(system, monkeypatch):
    monkeypatch.setattr("rebound_cli.service.system.sys.prefix", "/home/pi/rebound")
    assert hidden_program() == "/home/pi/rebound"
    monkeypatch.setattr(command, "hidden_program", hidden_program)
    with pytest.raises(ReboundError, match="/home/pi/rebound is hidden from the service: install Rebound in /opt"):
        service(system, "install")
    monkeypatch.setattr(shutil, "which", lambda program: None)
    with pytest.raises(ReboundError, match="has no systemd"):
        service(system, "install")
    assert files(system.root) == set()


def test_exit_codes_that_no_restart_mends_end_the_service():
    assert values(unit(), "RestartPreventExitStatus") == ["2 78"]
    # A cable that is not there yet is no fault of the configuration.
    assert main(["guard", "--connect", "serial:///dev/ttyNONE:57600"]) == exit_codes.ERROR


def test_the_back_off_is_there_where_systemd_knows_it():
    assert values(unit(systemd=254), "RestartSteps") == ["5"] and values(unit(systemd=254), "RestartMaxDelaySec")
    for older in (252, None):
        assert not values(unit(systemd=older), "RestartSteps")


@pytest.mark.parametrize(
    ("device", "rule"),
    [
        (UART, UART),
        ("/dev/ttyUSB3", "char-188"),
        ("/dev/ttyACM0", "char-166"),
        (FTDI, "char-188"),
        (PIXHAWK, "char-166"),
    ],
)
def test_one_device_is_open_to_it_under_whatever_name_it_comes_back(device, rule):
    text = unit(connect=f"serial://{device}:921600")
    assert values(text, "DeviceAllow") == [f"{rule} rw"] and values(text, "DevicePolicy") == ["closed"]
    assert values(text, "PrivateNetwork") == ["yes"]
    # One that is open by its present number has to be there first.
    assert values(text, "ExecStartPre") == ([f"/usr/bin/test -c {device}"] if rule == device else [])
    match = 'KERNEL=="' if device.startswith("/dev/tty") else 'SYMLINK=="'
    rules = udev_text(device).splitlines()[1:]
    assert all(f'{match}{device.removeprefix("/dev/")}"' in rule for rule in rules) and len(rules) == 2
    assert 'DRIVERS=="ftdi_sio", ATTR{device/latency_timer}="1"' in rules[1]


def test_a_guard_in_between_has_its_device_and_the_network_that_its_clients_come_by(system, tmp_path):
    config = tmp_path / "between.yaml"
    config.write_text("between: ['udpin://0.0.0.0:14540']\n")
    assert service(system, "install", guard=config, connect=f"serial://{UART}:921600") == 0
    text = (system.root / UNIT).read_text()
    assert values(text, "DeviceAllow") == [f"{UART} rw"] and values(text, "PrivateNetwork") == []
    assert values(text, "RestrictAddressFamilies") == ["AF_UNIX AF_INET AF_INET6"]


def test_words_that_mean_something_to_systemd_are_taken_literally():
    command_line = values(unit(signing_key='/var/lib/rebound/my $key 100%".key'), "ExecStart")[0]
    assert command_line.endswith('--signing-key "/var/lib/rebound/my $$key 100%%\\".key"')


@NEEDS_SYSTEMD
@pytest.mark.parametrize("connect", [f"serial://{UART}:921600", f"serial://{FTDI}:57600", UDP])
@pytest.mark.parametrize("run", ["guard", "mission"])
def test_systemd_finds_nothing_to_complain_of_and_little_exposed(connect, run, tmp_path):
    # With an interpreter that is there, for systemd looks.
    systemd = System().release()
    file = tmp_path / UNIT_NAME
    file.write_text(unit_text(ServiceSettings(run=run, connect=connect), shutil.which("python3"), systemd, "dialout"))
    complaints = answer("systemd-analyze", "verify", str(file))
    said = answer("systemd-analyze", "security", "--offline=true", "--no-pager", str(file))
    exposed = float(said.rpartition("→ ")[2].rpartition(": ")[2].split()[0])
    # It calls up to 2 of its 10 safe or nearly so.
    assert complaints == "" and exposed <= 2.0


def test_an_installation_that_is_not_there_or_not_as_it_was_made_is_found(system, capsys):
    assert service(system, "check") == 1
    assert "is not there" in capsys.readouterr().out
    service(system, "install", guard=GUARD)
    capsys.readouterr()
    assert service(system, "check") == 0
    assert " no " not in capsys.readouterr().out
    for more in (b"MemoryMax=infinity\n", b"\xff"):
        with (system.root / UNIT).open("ab") as file:
            file.write(more)
        assert service(system, "check") == 1
        assert f"not as this version writes them: /{UNIT}" in capsys.readouterr().out


def test_a_flight_tells_systemd_that_it_is_ready_alive_how_it_goes_and_when_it_ends(tmp_path, monkeypatch):
    # Given a system that gives it the priority that it asks for, but not whoever tests
    asked, told = [], []
    monkeypatch.setenv("NOTIFY_SOCKET", str(tmp_path / "notify"))
    monkeypatch.setattr(os, "sched_setscheduler", lambda _, policy, how: asked.append(policy))
    monkeypatch.setattr(
        ServiceManager,
        "stepped",
        lambda _, is_heard, is_ending, status, now_us: told.append((now_us, is_heard, is_ending, status())),
    )
    companion, *_ = fly(tmp_path)
    report = companion.report()
    assert report.outcome == "completed" and set(asked) == {os.SCHED_FIFO}
    # Then the vehicle is heard long before it is armed, and to the end; the end is told last
    assert next(at_us for at_us, is_heard, *_ in told if is_heard) < report.armed_at_us
    endings = [is_ending for *_, is_ending, _ in told]
    assert endings == sorted(endings) and endings.count(True) == 1
    # Each step is a sign of life
    assert max(b - a for (a, *_), (b, *_) in itertools.pairwise(told)) < 500_000
    # And the state and the rate of the link
    states = [status for *_, status in told if status.startswith("state takeoff, mode OFFBOARD, ")]
    assert states and all(status.endswith(" kB/s") for status in states)


def test_the_present_state_is_no_line_of_a_journal(monkeypatch):
    def told():
        stream = io.StringIO()
        console = Console(stream)
        console.live(lambda: Status("watching", "", False, None, None, "off", None), 1.0)
        console.event(1.0, "detection", "hit")
        return stream.getvalue()

    assert "watching" in told() and "hit" in told()
    monkeypatch.setenv("NOTIFY_SOCKET", "/run/systemd/notify")
    assert "watching" not in told() and "hit" in told()
