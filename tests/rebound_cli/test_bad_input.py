"""Bad input: one clear sentence, a non-zero exit, no traceback, nothing left running."""

import json
import socket
import threading

import pytest
from pymavlink.dialects.v20 import development as dialect

from rebound_cli.main import main
from tests.rebound_cli.command import SQUARE, WALL, assert_one_clear_sentence, processes_naming, run, run_here

MULTICOPTER, PLANE = dialect.MAV_TYPE_QUADROTOR, dialect.MAV_TYPE_FIXED_WING
PX4, ARDUPILOT = dialect.MAV_AUTOPILOT_PX4, dialect.MAV_AUTOPILOT_ARDUPILOTMEGA


def test_a_missing_mission_file():
    result = run("fly", "missions/wal.yaml", "--lockstep")
    assert_one_clear_sentence(result, "missions/wal.yaml: no such file", "did you mean missions/wall.yaml?")


def test_bad_yaml(tmp_path):
    mission = tmp_path / "bad.yaml"
    mission.write_text("name: bad\nitems: [\n")
    assert_one_clear_sentence(run_here("fly", mission, "--sim"), f"{mission}:", "not valid YAML")


def test_an_unknown_key(tmp_path):
    mission = tmp_path / "typo.yaml"
    mission.write_text(WALL.read_text().replace("on_collision", "on_colision"))
    result = run_here("fly", mission, "--sim")
    line = mission.read_text().splitlines().index("on_colision: {then: hold, hold_s: 3}") + 1
    assert_one_clear_sentence(result, f"{mission}:{line}: ", "did you mean 'on_collision'?")


@pytest.mark.parametrize("how", ["--sim", "--lockstep"])
def test_a_wall_through_the_start_position(tmp_path, how):
    result = run_here("fly", WALL, how, "--set", "sim.walls.0.point_ned_m=[0.1, 0, 0]", "--out", tmp_path / "run")
    assert_one_clear_sentence(result, "start position", "--set sim.walls.0.point_ned_m")
    assert not (tmp_path / "run").exists()


def test_an_unknown_airframe():
    assert_one_clear_sentence(
        run_here("fly", WALL, "--lockstep", "--airframe", "foldible"), "foldible", "foldable, rigid"
    )


def test_a_port_in_use(tmp_path):
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as other:
        other.bind(("127.0.0.1", 0))
        port = other.getsockname()[1]
        result = run_here("fly", SQUARE, "--connect", f"udpin://127.0.0.1:{port}", "--out", tmp_path / "run")
        assert_one_clear_sentence(result, port, "already in use")
        assert not (tmp_path / "run").exists()
        result = run_here("sim", "--port", port)
        assert_one_clear_sentence(result, port, "in use")


def test_a_missing_serial_port():
    result = run_here("fly", SQUARE, "--connect", "serial:///dev/ttyNONE:921600")
    assert_one_clear_sentence(result, "/dev/ttyNONE does not exist")


def test_a_wrong_address():
    assert_one_clear_sentence(
        run_here("fly", SQUARE, "--connect", "0.0.0.0:14540"), "did you mean udpin://0.0.0.0:14540?"
    )
    assert_one_clear_sentence(run_here("fly", SQUARE, "--connect", "the drone"), "udpin://HOST:PORT")


@pytest.mark.parametrize("url", ["udpout://0.0.0.0:14580", "udpout://127.0.0.1:70000", "udpout://no.invalid:14580"])
@pytest.mark.parametrize("command", [("fly", SQUARE), ("guard",), ("preflight",)], ids=lambda words: words[0])
def test_an_address_that_nobody_can_answer_from(tmp_path, command, url):
    out = ("--out", tmp_path / "run") if command[0] != "preflight" else ()
    assert_one_clear_sentence(run_here(*command, "--connect", url, *out), url.split("//")[1].split(":")[0])
    assert not (tmp_path / "run").exists()


@pytest.mark.parametrize(
    ("options", "words"),
    [
        (("--truth", "nowhere/truth.npz"), ("--truth nowhere/truth.npz", "there is no folder nowhere")),
        (("--truth", "missions"), ("--truth missions", "give another file")),
        (("--remote", "nobody.invalid:14540"), ("Host 'nobody.invalid' is unknown",)),
        (("--set", "walls=3"), ("--set walls=3", "begins with sim.")),
        (("--set", "sim.walls=3"), ("sim.walls: must be a list, not 3",)),
    ],
)
def test_what_the_simulated_vehicle_alone_cannot_do(options, words):
    assert_one_clear_sentence(run_here("sim", *options), *words)


def test_options_of_the_simulated_vehicle_with_a_real_one():
    assert_one_clear_sentence(run_here("fly", SQUARE, "--connect", "udpin://:14540", "--seed", "2"), "--seed")


def test_nothing_waits_to_arm_a_vehicle_that_nobody_has_looked_at_and_none_for_a_simulated_one(tmp_path):
    connected = ("fly", SQUARE, "--connect", "udpin://127.0.0.1:0", "--out", tmp_path / "run", "--yes")
    for wish in (("--wait",), ("--set", "companion.link.wait=true")):
        assert_one_clear_sentence(run_here(*connected, *wish), "--wait with --yes")
    assert_one_clear_sentence(run_here("fly", SQUARE, "--lockstep", "--wait"), "--wait belongs to --connect")
    assert not (tmp_path / "run").exists()


def test_a_folder_that_holds_a_flight(tmp_path):
    (tmp_path / "flight.tlog").write_bytes(b"")
    assert_one_clear_sentence(run_here("fly", WALL, "--lockstep", "--out", tmp_path), "already holds a flight")
    assert (tmp_path / "flight.tlog").read_bytes() == b""


@pytest.mark.parametrize("arguments", [("fly",), (), ("sim", "--port", "x"), ("fly", "a", "--sim", "--lockstep")])
def test_wrong_arguments_exit_with_2(arguments):
    result = run_here(*arguments)
    assert result.returncode == 2 and "Traceback" not in result.stderr


def fly_without_reply(folder, *extra):
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as free:
        free.bind(("127.0.0.1", 0))
        port = free.getsockname()[1]
    options = ("--set", "companion.link.heartbeat_wait_s=1.0", "--out", folder, "--yes", "--json", *extra)
    return port, lambda: run_here("fly", SQUARE, "--connect", f"udpin://127.0.0.1:{port}", *options)


def assert_failed(result, folder, *words):
    """A flight that never began: the reason on stderr and in the summary, and the run folder complete."""
    assert result.returncode == 1 and "Traceback" not in result.stderr
    summary = json.loads(result.stdout)
    assert summary["outcome"] == "failed"
    assert summary == json.loads((folder / "summary.json").read_text())
    for word in words:
        assert word in summary["reason"] and word in result.stderr
    assert (folder / "flight.tlog").exists()
    assert processes_naming(folder) == []


def test_no_heartbeat(tmp_path):
    _, fly = fly_without_reply(tmp_path / "run")
    assert_failed(fly(), tmp_path / "run", "HEARTBEAT", "1 s")


@pytest.mark.parametrize(
    ("autopilot", "vehicle_type", "word"), [(ARDUPILOT, MULTICOPTER, "PX4"), (PX4, PLANE, "multicopter")]
)
def test_a_vehicle_that_is_no_px4_multicopter(tmp_path, autopilot, vehicle_type, word):
    port, fly = fly_without_reply(tmp_path / "run")
    mavlink = dialect.MAVLink(None, 1, 1)
    packet = bytes(dialect.MAVLink_heartbeat_message(vehicle_type, autopilot, 0x51, 0, 3, 3).pack(mavlink))
    is_over = threading.Event()

    def announce():
        with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as vehicle:
            while not is_over.wait(0.2):
                vehicle.sendto(packet, ("127.0.0.1", port))

    announcer = threading.Thread(target=announce)
    announcer.start()
    try:
        assert_failed(fly(), tmp_path / "run", word)
    finally:
        is_over.set()
        announcer.join()


@pytest.mark.parametrize("command", ["paper", "results", "detectors", "campaign", "recoveries"])
def test_a_study_that_moved_names_its_new_place(command, capsys):
    assert main([command, "--out", "docs"]) == 1
    complaint = capsys.readouterr().err
    assert "is now 'python -m bench " in complaint and complaint.count("\n") == 1
