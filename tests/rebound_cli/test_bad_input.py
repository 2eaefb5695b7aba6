"""Bad input: one clear sentence, a non-zero exit, no traceback, nothing left running."""

import json
import socket

import pytest

from rebound_cli import exit_codes
from rebound_cli.main import main
from sim_vehicle.airframe import load_built_in
from sim_vehicle.hil.parameters import px4_parameters
from tests.rebound_cli.command import SQUARE, WALL, assert_one_clear_sentence, run_here


def test_a_port_in_use(tmp_path):
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as other:
        other.bind(("127.0.0.1", 0))
        port = other.getsockname()[1]
        result = run_here("fly", SQUARE, "--connect", f"udpin://127.0.0.1:{port}", "--out", tmp_path / "run")
        assert_one_clear_sentence(result, port, "already in use")
        assert not (tmp_path / "run").exists()
        result = run_here("sim", "--port", port)
        assert_one_clear_sentence(result, port, "in use")


@pytest.mark.parametrize("url", ["udpout://0.0.0.0:14580", "udpout://127.0.0.1:70000", "udpout://no.invalid:14580"])
@pytest.mark.parametrize("command", [("fly", SQUARE), ("guard",), ("preflight",)], ids=lambda words: words[0])
def test_an_address_that_nobody_can_answer_from(tmp_path, command, url):
    out = ("--out", tmp_path / "run") if command[0] != "preflight" else ()
    assert_one_clear_sentence(run_here(*command, "--connect", url, *out), url.split("//")[1].split(":")[0])
    assert not (tmp_path / "run").exists()


@pytest.mark.parametrize("format_name", ["env", "params", "airframe"])
def test_an_airframe_is_printed_whole_in_every_format(format_name):
    result = run_here("airframe", "px4", "--airframe", "rigid", "--format", format_name)
    assert all(parameter.name in result.stdout for parameter in px4_parameters(load_built_in("rigid")))


@pytest.mark.parametrize(
    "words", [("check", WALL, "--set", "sim.airframe={}"), ("airframe", "px4", "--airframe", "{}")]
)
def test_nothing_is_said_of_an_airframe_of_one_s_own_that_leaps_off_the_ground(tmp_path, words):
    # Given feet far stiffer than an interval of the physics
    own = tmp_path / "stiff.yaml"
    own.write_text("based_on: rigid\nname: stiff\nsurface: {foot: {contact_time_s: 0.00001, restitution: 0.1}}\n")
    result = run_here(*(str(word).format(own) for word in words))
    assert_one_clear_sentence(result, "stiff moves by", "disarmed")
    assert result.stdout == ""


CONNECTED = ("fly", SQUARE, "--connect")


@pytest.mark.parametrize(
    ("command", "words"),
    [
        (("fly", WALL, "--lockstep", "--airframe", "foldible"), ("foldible", "did you mean foldable?")),
        (("fly", WALL, "--lockstep", "--airframe", "racer.yaml"), ("racer.yaml: no such file; did you mean racer?",)),
        (("fly", "missions/wal.yaml", "--lockstep"), ("no such file", "did you mean missions/wall.yaml?")),
        (("check", "wal.yaml"), ("wal.yaml: no such file; did you mean wall?",)),
        (("airframe", "px4", "--airframe", "none"), ("foldable", "rigid")),
        (("fly", "--sim", "no-such-mission.yaml"), ("no-such-mission.yaml",)),
        ((*CONNECTED, "serial:///dev/ttyNONE:921600"), ("/dev/ttyNONE does not exist",)),
        ((*CONNECTED, "0.0.0.0:14540"), ("did you mean udpin://0.0.0.0:14540?",)),
        ((*CONNECTED, "the drone"), ("udpin://HOST:PORT",)),
        (("preflight", "--connect", "nowhere"), ("'nowhere' is not a connection address",)),
        (("sim", "--truth", "nowhere/truth.npz"), ("--truth nowhere/truth.npz", "there is no folder nowhere")),
        (("sim", "--truth", "missions"), ("--truth missions", "give another file")),
        (("sim", "--remote", "nobody.invalid:14540"), ("Host 'nobody.invalid' is unknown",)),
        (("sim", "--set", "walls=3"), ("--set walls=3", "begins with sim.")),
        (("sim", "--set", "sim.walls=3"), ("sim.walls: must be a list, not 3",)),
        ((*CONNECTED, "udpin://:14540", "--seed", "2"), ("--seed",)),
        (("fly", SQUARE, "--lockstep", "--wait"), ("--wait belongs to --connect",)),
        (("fly", SQUARE, "--lockstep", "--watch"), ("--watch belongs to flights in real time",)),
        (("fly", SQUARE, "--lockstep", "--signing-key", "key"), ("--signing-key belongs to --connect",)),
        (("status", "--socket", "/nowhere"), ("Nothing answers at /nowhere",)),
        (("watch", "missions"), ("no flight is there; give a run's folder",)),
        (("check", WALL, "--set", "obstacles.file=none.json"), ("none.json: no such file",)),
    ],
    ids=lambda given: " ".join(map(str, given[:1])),
)
def test_what_cannot_be_done_is_one_sentence_that_names_it(command, words):
    assert_one_clear_sentence(run_here(*command), *words)


@pytest.mark.parametrize(
    ("command", "words"),
    [
        (("fly",), "MISSION"),
        ((), "COMMAND"),
        (("fly", "a", "--sim", "--lockstep"), "--lockstep"),
        (("fli", "wall"), "; did you mean fly?"),
        (("fly", "wall", "--lockstp"), "--lockstp; did you mean --lockstep?"),
        (("sim", "--port", "x"), "'x' is not a port"),
        (("sim", "--speed", "-2"), "'-2' is not a speed: give a number from 0 to 1000"),
        (("sim", "--speed", "fast"), "'fast' is not a speed"),
        (("sim", "--sensor-rate", "333"), "--sensor-rate"),
        (("sim", "--autopilot", "apm"), "--autopilot"),
        (("replay", "run", "--rate", "50"), "rebound replay: --rate is gone: a log is searched as it was recorded.\n"),
        (("replay", "run", "--expect", "some"), "'some' is not a number of collisions"),
        (("logs", "export", "--format", "ulg"), "ulg is gone: give mcap, which Foxglove and PlotJuggler read"),
    ],
)
def test_wrong_words_exit_with_2_and_name_the_wrong_one(command, words):
    result = run_here(*command)
    assert result.returncode == 2 and words in result.stderr and "Traceback" not in result.stderr


def test_nothing_waits_to_arm_a_vehicle_that_nobody_has_looked_at_and_none_for_a_simulated_one(tmp_path):
    connected = ("fly", SQUARE, "--connect", "udpin://127.0.0.1:0", "--out", tmp_path / "run", "--yes")
    for wish in (("--wait",), ("--set", "companion.link.wait=true")):
        assert_one_clear_sentence(run_here(*connected, *wish), "--wait with --yes")
    assert not (tmp_path / "run").exists()


def test_a_flight_that_never_begins_leaves_a_whole_folder_with_the_reason(tmp_path):
    options = ("--set", "companion.link.heartbeat_wait_s=1.0", "--out", tmp_path, "--yes", "--json")
    result = run_here("fly", SQUARE, "--connect", "udpin://127.0.0.1:0", *options)
    assert result.returncode == 1 and "Traceback" not in result.stderr
    summary = json.loads(result.stdout)
    assert summary["outcome"] == "failed" and summary == json.loads((tmp_path / "summary.json").read_text())
    for word in ("HEARTBEAT", "1 s"):
        assert word in summary["reason"] and word in result.stderr
    assert (tmp_path / "flight.tlog").exists()


@pytest.mark.parametrize(
    ("options", "words"),
    [
        (("--connect", "nowhere"), "'nowhere' is not a connection address"),
        (("--modes", "POSCTL,WARP"), "'WARP' is no mode of PX4"),
        (("--set", "max_hits=0"), "max_hits"),
        (("--config", "no.yaml"), "no.yaml"),
        (("--between", "serial:///dev/ttyS0:9600"), "clients come by udpin://"),
    ],
)
def test_what_is_wrong_with_a_guard_is_no_reason_to_start_it_again(options, words):
    result = run_here("guard", "--connect", "udpin://127.0.0.1:0", *options)
    assert_one_clear_sentence(result, words)
    assert result.returncode == exit_codes.CONFIGURATION


@pytest.mark.parametrize(
    ("command", "words"),
    [
        *((study, "is now 'python -m bench ") for study in ("paper", "results", "detectors", "campaign", "recoveries")),
        ("plan", "fly it under 'rebound guard'"),
    ],
)
def test_a_command_that_moved_or_is_gone_names_what_to_use(command, words, capsys):
    assert main([command, "--out", "docs"]) == 1
    complaint = capsys.readouterr().err
    assert words in complaint and complaint.count("\n") == 1
