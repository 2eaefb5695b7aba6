"""What comes before a flight: `rebound init`, `key`, the shell's own completion, and `preflight` through the wire."""

import hashlib
import itertools
import stat
import subprocess
import sys
from collections.abc import Callable
from pathlib import Path

import pytest

from companion.autopilot.setup import SerialLine, Verdict
from companion.mission.config import CompanionConfig
from companion.preflight import Preflight, findings
from rebound_cli.inputs.documents import load_document
from rebound_cli.inputs.inputs import load_mission_document, mission_from
from rebound_cli.main import main
from rebound_cli.preflight.command import serial_line
from sim_vehicle.airframe import load_built_in
from sim_vehicle.scene import Scene
from sim_vehicle.vehicle import SimulatedVehicle
from tests.rebound_cli.command import HOP, ROOT, SQUARE, WALL, assert_one_clear_sentence, run_here


def test_the_copy_is_a_mission_of_its_own_name(tmp_path, capsys):
    file = tmp_path / "missions" / "my-first.yaml"
    assert main(["init", str(file)]) == 0
    # Then it says all that the original says, but for its name
    copied, original = load_document(file).data, load_document(WALL).data
    assert copied == original | {"name": "my-first"}
    assert f"rebound fly {file}" in capsys.readouterr().out
    # And leads to no schema that is not there
    assert "schema.json" not in file.read_text()


@pytest.mark.parametrize("stem", ["true", "7 flights", 'a "b": c', "ü"])
def test_whatever_the_file_is_called(stem, tmp_path):
    file = tmp_path / f"{stem}.yaml"
    assert main(["init", str(file), "--from", "square"]) == 0
    assert isinstance(load_document(file).data["name"], str)
    assert mission_from(load_mission_document(file, (), None, None)).items


def test_the_names_to_begin_from_are_listed_and_the_nearest_is_offered(capsys):
    assert main(["init", "--list"]) == 0
    assert {"wall", "square", "guarded_offboard"} <= set(capsys.readouterr().out.split())
    assert main(["init"]) == 1 and "Which file?" in capsys.readouterr().err
    assert main(["sim", "--mission", "wal"]) == 1 and "did you mean wall?" in capsys.readouterr().err


def test_nothing_is_written_over_and_a_model_that_is_not_is_named(tmp_path, capsys):
    file = tmp_path / "mine.yaml"
    assert main(["init", str(file), "--from", "walls"]) == 1
    assert "No mission 'walls' ships with the program; did you mean wall?" in capsys.readouterr().err
    assert not file.exists()
    file.write_text("mine")
    assert main(["init", str(file)]) == 1
    assert main(["init", str(tmp_path / "new" / ".." / file.name)]) == 1
    assert file.read_text() == "mine" and str(file) in capsys.readouterr().err


def test_an_example_is_written_under_its_own_name_or_another(tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    assert main(["init", "--example", "guarded_offboard"]) == 0
    assert main(["init", "mine/settings.yaml", "--example", "guard"]) == 0
    for name, original in (("guarded_offboard.py", "guarded_offboard.py"), ("mine/settings.yaml", "guard.yaml")):
        assert (tmp_path / name).read_bytes() == (ROOT / "examples" / original).read_bytes()
    assert main(["init", "--example", "guarded"]) == 1
    assert "No example 'guarded' ships with the program; did you mean guard" in capsys.readouterr().err


def test_a_new_key_is_its_owners_alone_random_never_shown_and_written_for_px4(tmp_path: Path):
    first, second = tmp_path / "first", tmp_path / "second"
    shown = [run_here("key", "new", file) for file in (first, second)]
    keys = [file.read_text().strip() for file in (first, second)]
    assert keys[0] != keys[1] and all(len(bytes.fromhex(key)) == 32 for key in keys)
    assert {stat.S_IMODE(file.stat().st_mode) for file in (first, second)} == {0o600}
    assert shown[0].returncode == 0 and "MAV_SIGN_CFG = 1" in shown[0].stdout
    assert keys[0] not in shown[0].stdout + shown[0].stderr
    # And it replaces none
    assert_one_clear_sentence(run_here("key", "new", first), first, "exists already")
    assert first.read_text().strip() == keys[0]
    # PX4 gets 32 bytes of key and 8 of time stamp
    card = tmp_path / "mavlink-signing-key.bin"
    assert run_here("key", "px4", first, "--card", card).returncode == 0
    assert card.read_bytes() == bytes.fromhex(keys[0]) + bytes(8)
    assert stat.S_IMODE(card.stat().st_mode) == 0o600


def test_a_passphrase_makes_the_key_that_ground_stations_make_of_it(tmp_path: Path):
    command = [sys.executable, "-m", "rebound_cli", "key", "new", str(tmp_path / "key"), "--passphrase"]
    shown = subprocess.run(command, cwd=ROOT, input="correct horse\n", text=True, capture_output=True, timeout=60)
    assert shown.returncode == 0 and "correct horse" not in shown.stdout
    assert (tmp_path / "key").read_text().strip() == hashlib.sha256(b"correct horse").hexdigest()


COMMANDS = {"fly": ("fly", SQUARE, *HOP), "guard": ("guard",), "preflight": ("preflight",)}


@pytest.mark.parametrize("command", COMMANDS)
def test_a_key_that_others_may_read_is_refused_before_anything_is_opened_or_written(tmp_path: Path, command):
    key = tmp_path / "key"
    key.write_text("ab" * 32)
    key.chmod(0o644)
    result = run_here(*COMMANDS[command], "--connect", "udpin://127.0.0.1:0", "--signing-key", key)
    assert_one_clear_sentence(result, "mode 644", f"chmod 600 {key}")
    assert "abab" not in result.stderr and list(tmp_path.iterdir()) == [key]


ASK = """
source /dev/stdin
COMP_WORDS=("$@") COMP_CWORD=$(($# - 1)) COMP_LINE="$*"
$(complete -p rebound | sed 's/.* -F \\([^ ]*\\) .*/\\1/')
printf '%s\\n' "${COMPREPLY[@]}"
"""


@pytest.mark.parametrize(
    ("typed", "offered"),
    [
        (["fl"], {"fly"}),
        (["fly", "--lo"], {"--lockstep"}),
        (["guard", "--then", ""], {"previous", "hold"}),
        (["fly", "missions/wal"], {"missions/wall.yaml"}),
        (["check", "wal"], {"wall"}),
        (["sim", "--mission", "wal"], {"wall"}),
        (["fly", "--airframe", "rac"], {"racer"}),
        (["init", "--example", "guarded"], {"guarded_offboard"}),
        (["guard", "--config", "CHANGELO"], {"CHANGELOG.md"}),
    ],
)
def test_bash_completes_commands_options_choices_and_files(typed, offered, capsys):
    assert main(["completion", "bash"]) == 0
    script = capsys.readouterr().out
    asked = ["bash", "-c", ASK, "bash", "rebound", *typed]
    answer = subprocess.run(asked, input=script, cwd=ROOT, capture_output=True, text=True, check=True)
    assert set(answer.stdout.split()) == offered, answer.stderr


def surveyed(damaged: Callable[[bytes], bytes] = bytes) -> tuple[Preflight, SimulatedVehicle]:
    vehicle = SimulatedVehicle(load_built_in("foldable"), Scene(), seed=1, keeps_path=False)
    preflight = Preflight(CompanionConfig(), vehicle.time_boot_us)
    while not preflight.finished:
        exchange(preflight, vehicle, damaged=damaged)
    return preflight, vehicle


def exchange(
    preflight: Preflight,
    vehicle: SimulatedVehicle,
    sending: tuple[bytes, ...] = (),
    damaged: Callable[[bytes], bytes] = bytes,
) -> None:
    frames = vehicle.step(b"".join(sending))
    answer = preflight.step(b"".join(map(damaged, frames)), vehicle.time_boot_us)
    if answer:
        exchange(preflight, vehicle, answer, damaged)


def test_the_simulated_vehicle_is_found_ready_but_for_what_a_fresh_px4_leaves_open():
    preflight, vehicle = surveyed()
    found = {finding.item: finding for finding in findings(preflight)}
    assert preflight.vehicle.identity is not None
    assert not [item for item, finding in found.items() if finding.verdict is Verdict.BAD]
    assert [item for item, finding in found.items() if finding.fix] == [
        "COM_OBL_RC_ACT",
        "COM_RCL_EXCEPT",
        "MPC_ACC_HOR",
    ]
    assert found["packets"].verdict is found["arrival"].verdict is Verdict.GOOD
    # and 247 of the 250 samples a second arrive: PX4's link loses 1.2 %
    assert found["HIGHRES_IMU"].found.startswith("247 Hz")
    # A remedy that is taken is taken by the vehicle
    exchange(preflight, vehicle, preflight.set_parameter("COM_RCL_EXCEPT", 4, vehicle.time_boot_us))
    for _ in range(25):
        exchange(preflight, vehicle)
    assert preflight.parameters["COM_RCL_EXCEPT"] == 4
    assert {finding.item: finding for finding in findings(preflight)}["COM_RCL_EXCEPT"].verdict is Verdict.GOOD


def test_packets_that_are_lost_or_damaged_on_the_way_are_counted():
    # Given a line that loses each tenth packet and breaks one byte in each hundredth
    numbers = itertools.count()

    def worn(packet: bytes) -> bytes:
        number = next(numbers)
        if number % 10 == 5:
            return b""
        return packet[:-3] + bytes((packet[-3] ^ 0xFF,)) + packet[-2:] if number % 100 == 0 else packet

    preflight, _ = surveyed(worn)
    delivery = preflight.delivery
    assert delivery.lost == pytest.approx(0.11 * (delivery.received + delivery.lost), rel=0.03)
    assert delivery.unreadable_bytes > 10 * delivery.lost / 11
    finding = {finding.item: finding for finding in findings(preflight)}["packets"]
    assert finding.verdict is Verdict.DOUBTFUL
    assert "(11." in finding.found or "(10." in finding.found


def test_what_the_line_goes_through_is_read_where_linux_tells_it(tmp_path):
    (tmp_path / "sys/bus/usb-serial/devices/ttyUSB0").mkdir(parents=True)
    (tmp_path / "sys/bus/usb-serial/devices/ttyUSB0/latency_timer").write_text("16\n")
    assert serial_line("serial:///dev/ttyUSB0:57600", tmp_path) == SerialLine(57_600, 16)
    assert serial_line("serial:///dev/ttyAMA0:921600", tmp_path) == SerialLine(921_600, None)
    assert serial_line("serial:///dev/ttyACM0:57600", tmp_path) == SerialLine(None, None)
    assert serial_line("udpin://0.0.0.0:14540", tmp_path) is None
