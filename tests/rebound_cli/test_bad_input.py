"""Bad input, in words, files or --set: one clear sentence with place and remedy, an exit code, nothing left running."""

import json
import os
import socket
import subprocess
import sys
from unittest.mock import Mock

import pytest

from companion.mission.model import Mission
from companion.reflex.config import GuardsConfig
from rebound_cli import exit_codes
from rebound_cli.__main__ import run
from rebound_cli.inputs.documents import DocumentError, apply_overrides, load_document, parse_document, validated
from rebound_cli.inputs.inputs import mission_from, world_from
from rebound_cli.main import main
from sim_vehicle.airframe import load_built_in
from sim_vehicle.hil.parameters import px4_parameters
from tests.rebound_cli.command import ROOT, SQUARE, WALL, assert_one_clear_sentence, run_here, start


def test_a_port_in_use(tmp_path):
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as other:
        other.bind(("127.0.0.1", 0))
        port = other.getsockname()[1]
        result = run_here("fly", SQUARE, "--connect", f"udpin://127.0.0.1:{port}", "--out", tmp_path / "run")
        assert_one_clear_sentence(result, port, "already in use")
        assert not (tmp_path / "run").exists()
        result = run_here("sim", "--port", port)
        assert_one_clear_sentence(result, port, "in use")


@pytest.mark.parametrize("format_name", ["env", "params", "airframe"])
def test_an_airframe_is_printed_whole_in_every_format(format_name):
    result = run_here("airframe", "px4", "--airframe", "rigid", "--format", format_name)
    assert all(parameter.name in result.stdout for parameter in px4_parameters(load_built_in("rigid")))


def test_parameters_for_ardupilot_are_lines_of_their_own_form():
    printed = run_here("airframe", "ardupilot", "--airframe", "rigid")
    assert printed.returncode == 0 and "FRAME_TYPE 1\n" in printed.stdout


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


CONNECTED, GUARDS = ("fly", SQUARE, "--connect"), "companion.estimate.guards.centre_m"


@pytest.mark.parametrize(
    ("command", "words"),
    [
        (("fly", WALL, "--lockstep", "--airframe", "foldible"), ("foldible", "did you mean foldable?")),
        (("fly", WALL, "--lockstep", "--airframe", "racer.yaml"), ("racer.yaml: no such file; did you mean racer?",)),
        (("fly", WALL, "--lockstep", "--companion", SQUARE), (f"{SQUARE}: has no companion: part",)),
        (("preflight", "--connect", "udpin://:1", "--companion", SQUARE), (f"{SQUARE}: has no companion: part",)),
        (("fly", WALL, "--lockstep", "--airframe", SQUARE), (f"{SQUARE}:1: add based_on with one of foldable, hexa",)),
        (
            ("fly", WALL, "--lockstep", "--set", "sim.faults=[{kind: gusts}]"),
            ("unknown kind 'gusts'", "did you mean 'gust'?"),
        ),
        (("fly", "missions/wal.yaml", "--lockstep"), ("no such file", "did you mean missions/wall.yaml?")),
        (("check", "wal.yaml"), ("wal.yaml: no such file; did you mean wall?",)),
        (("airframe", "px4", "--airframe", "none"), ("foldable", "rigid")),
        (("airframe", "ardupilot", "--format", "env"), ("--format and --position belong to px4",)),
        (("airframe", "ardupilot", "--airframe", "hexa"), ("hexa has rotors of its own: ArduPilot flies a quad-x",)),
        (
            ("guard", "--connect", "udpin://:1", "--set", f"{GUARDS}=160"),
            ("less than or equal to 2, not 160",),
        ),
        (("logs", "list", "--runs", "nowhere"), ("nowhere is no folder",)),
        (("report", WALL), (f"{WALL} is no flight's folder; `rebound replay` reads logs",)),
        (("check", 300 * "a"), ("File name too long",)),
        (("tune", "none.ulg", "--out", "nowhere/settings.yaml"), ("nowhere is no folder that can be written to",)),
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
        (("fly", SQUARE, "--lockstep", "--peer", "10.0.0.1"), ("--peer belongs to --connect",)),
        (("fly", SQUARE, "--lockstep", "--instance", "3"), ("--instance belongs to --sim px4",)),
        (("sim", "--sensor-rate", "500"), ("--sensor-rate belongs to --autopilot px4",)),
        (("sim", "--autopilot", "px4", "--signing-key", "key"), ("--signing-key belongs to the built-in autopilot",)),
        (("replay", "none.ulg", "--least-watched", "0.9"), ("--least-watched belongs to --expect none",)),
        (("init", "new.yaml", "--from", "square", "--example", "guard"), ("leave one of them out",)),
        (("check", WALL, "--set", "sim.wind_ned_m_s=[1e10, 0, 0]"), ("no such number has a size above 1,000,000,000",)),
        (("status", "--socket", "/nowhere"), ("Nothing answers at /nowhere",)),
        *((("service", what, "--connect", "udpin://:1"), ("belong to",)) for what in ("status", "check", "uninstall")),
        *(((*words, "yesterday", "--runs", "missions"), ("yesterday",)) for words in (("logs", "show"), ("report",))),
        (("replay", "missions"), ("no flight.tlog in this folder",)),
        (("replay", "none.ulg"), ("No such file",)),
        (("replay", WALL, "--set", "companion.fused.side_treshold_m_s2=1"), ("did you mean 'side_threshold_m_s2'?",)),
        (("watch", "missions"), ("no flight is there; give a run's folder",)),
        (("check", WALL, "--set", "obstacles.file=none.json"), ("none.json: no such file",)),
        (("check", WALL, "--set", "obstacles={file: no.json, known: 5}"), ("obstacles.known: must be a list, not 5",)),
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
        (("replay", "run", "--rate", "50"), "rebound replay: --rate is gone: a log is searched as it was recorded.\n"),
        (("replay", "run", "--expect", "some"), "'some' is not a number of collisions"),
    ],
)
def test_wrong_words_exit_with_2_and_name_the_wrong_one(command, words):
    result = run_here(*command)
    assert result.returncode == 2 and words in result.stderr and "Traceback" not in result.stderr


def test_text_that_no_output_can_hold_is_one_sentence():
    process = start("check", WALL, "--no-picture", "--set", r'description="a\ud800"')
    _, said = process.communicate(timeout=60)
    assert process.returncode == 1
    assert said == r"rebound: '\ud800' is no character that can be written: leave it out." + "\n"


def test_ctrl_c_before_anything_is_loaded_is_one_sentence_too(monkeypatch, capsys):
    monkeypatch.setattr("rebound_cli.main.main", Mock(side_effect=KeyboardInterrupt))
    assert run() == exit_codes.INTERRUPTED
    assert capsys.readouterr().err == "rebound: ended at once.\n"


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
        (("--between", "udpout://0.0.0.0:14540"), "names any host"),
    ],
)
def test_what_is_wrong_with_a_guard_is_no_reason_to_start_it_again(tmp_path, options, words):
    result = run_here("guard", "--connect", "udpin://127.0.0.1:0", "--out", tmp_path / "run", *options)
    assert_one_clear_sentence(result, words)
    assert result.returncode == exit_codes.CONFIGURATION and not (tmp_path / "run").exists()


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


MISSION = """\
name: demo
items:
  - takeoff: {height_m: 1.5}
  - go_to:
      position_ned_m: [1, 0, -1.5]
      speed_m_s: 1.0
  - land: {}
sim:
  walls:
    - {point_ned_m: [4, 0, 0], normal_ned: [-1, 0, 0]}
"""


def document(old="", new="", sets=()):
    assert old in MISSION
    parsed = parse_document(MISSION.replace(old, new) if old else MISSION, "demo.yaml")
    apply_overrides(parsed, sets)
    return parsed


def complaint(action, *arguments):
    with pytest.raises(DocumentError) as caught:
        action(*arguments)
    return str(caught.value)


def test_aliases_that_multiply_are_refused_before_they_take_the_memory():
    levels = "\n".join(f"a{n}: &a{n} [{', '.join([f'*a{n - 1}'] * 9)}]" for n in range(1, 10))
    text = complaint(parse_document, f"a0: &a0 [1, 2, 3]\n{levels}\n", "bomb.yaml")
    assert text.startswith("bomb.yaml:") and "aliases" in text
    assert "in themselves" in complaint(parse_document, "name: &all\n  again: *all\n", "itself.yaml")
    assert parse_document("a: &a [1, 2]\nb: *a\n", "good.yaml").data["b"] == [1, 2]


@pytest.mark.parametrize(
    ("old", "new", "said"),
    [
        ("speed_m_s: 1.0", "speed_m_s: -1", "6: items.1.go_to.speed_m_s: must be greater than 0, not -1."),
        (
            "speed_m_s: 1.0",
            "speed_m_s: 1,5",
            "6: items.1.go_to.speed_m_s: must be a valid number, not '1,5'; write 1.5.",
        ),
        ("{height_m: 1.5}", "{height_m: 1,5}", "3: items.0.takeoff.5: '5' is no key; a number is written with a point"),
        ("      position_ned_m: [1, 0, -1.5]\n", "", "4: items.1.go_to.position_ned_m: is missing; add it."),
        ("[1, 0, -1.5]", "[99, 0, -1.5]", "4: items: the position of item 2 (go_to) lies 99.00 m out"),
    ],
)
def test_what_is_wrong_names_file_line_and_path(old, new, said):
    assert complaint(mission_from, document(old, new)).startswith(f"demo.yaml:{said}")


def test_a_number_may_be_written_as_editors_take_it():
    told = [parse_document(f"a: {text}\n", "demo.yaml").data["a"] for text in ("1e-3", "-1.5e3", ".5E2", "0x1e5", "e5")]
    assert told == [0.001, -1500.0, 50.0, 0x1E5, "e5"]
    assert mission_from(document(sets=["items.1.go_to.speed_m_s=5e-1"])).items[1].action.speed_m_s == 0.5


def test_an_unknown_key_suggests_the_close_one_and_lists_all():
    text = complaint(mission_from, document("speed_m_s", "sped_m_s"))
    assert "demo.yaml:6: items.1.go_to.sped_m_s: unknown key 'sped_m_s'; did you mean 'speed_m_s'?" in text
    assert "position_ned_m, speed_m_s, acceleration_m_s2, yaw_deg" in text
    repeated = ["items.1={repeat: {times: 2, items: [{hodl: {duration_s: 1}}]}}"]
    text = complaint(mission_from, document(sets=repeated))
    assert "unknown key 'hodl'; did you mean 'hold'?" in text
    assert "needs at least" not in text, "the list is as long as it must be"


def test_a_key_of_an_earlier_version_is_taken_with_a_warning():
    earlier = "companion: {fused: {kick_rad_s: 0.4, rate_step_rad_s: 3.0}}\nsim:"
    with pytest.warns(UserWarning, match="kick_rad_s has no effect any more"):
        mission = mission_from(document("sim:", earlier))
    assert mission.companion.fused.rate_step_rad_s == 3.0


def test_the_sim_part_is_checked_like_the_rest():
    text = complaint(world_from, document("normal_ned", "nomal_ned"))
    assert "demo.yaml:10: sim.walls.0.nomal_ned: unknown key" in text and "did you mean 'normal_ned'?" in text
    text = complaint(world_from, document("[4, 0, 0]", "[0.1, 0, 0]"))
    assert text.startswith("demo.yaml:9: ") and "start position" in text and "\n" not in text
    fault = "  faults:\n    - {kind: wire, at_s: 1, loss: 1.0, messages: [ATTITUDE, ATITUDE]}\n"
    text = complaint(world_from, parse_document(MISSION + fault, "demo.yaml"))
    assert text == "demo.yaml:12: no MAVLink message is called 'ATITUDE'."


@pytest.mark.parametrize(
    ("text", "said"),
    [
        ("name: [", "demo.yaml:1: not valid YAML"),
        ("name: a\n\tb: c", "demo.yaml:2: not valid YAML"),
        ("name: a\nname: b", "demo.yaml:2: 'name' is given twice"),
        ("- name", "demo.yaml:1: a mapping was expected"),
        ("", "the file is empty"),
        ("a: !!python/object:os.system {}", "demo.yaml:1: not valid YAML"),
        ("a: \x00", "not valid YAML"),
        ("name: demo\nitems: 2001-99-99\n", "month must be in 1..12"),
        (f"name: demo\nsim: {{seed: 1{'0' * 5000}}}\n", "cannot be read"),
        ("items: " + 2000 * "[" + 2000 * "]", "nested too deeply"),
        ("a: 1\n" * 200_001, "longer than 1 MB"),
    ],
    ids=range(11),
)
def test_bad_yaml_is_one_sentence_with_the_files_name(text, said):
    message = complaint(parse_document, text, "demo.yaml")
    assert message.startswith("demo.yaml:") and said in message and "\n" not in message


def test_a_folder_or_a_binary_file_cannot_be_a_mission(tmp_path):
    (tmp_path / "picture.yaml").write_bytes(b"\xff\xfe\x00\x80")
    assert "cannot be read" in complaint(load_document, tmp_path)
    assert "not UTF-8" in complaint(load_document, tmp_path / "picture.yaml")


@pytest.mark.parametrize(
    ("given", "said"),
    [
        ("items.1.go_to.sped_m_s=2", "did you mean 'speed_m_s'?"),
        ("item.1=2", "did you mean 'items'?"),
        ("items.9.go_to.speed_m_s=2", "'items' is a list of 3, counted from 0; it has no '9'"),
        ("items.first=2", "it has no 'first'"),
        ("name.x=2", "'name' is a single value"),
        ("items.1.go_to.speed_m_s", "give PATH=VALUE"),
        ("companion.detector=psychic", "there is no detector 'psychic'"),
        ("items.1.go_to.speed_m_s=fast", "must be a valid number, not 'fast'"),
        ("items.1.go_to.speed_m_s=2001-99-99", "is not valid YAML"),
        ("items.1={path: {points_ned_m: []}}", "points_ned_m: needs at least 1 of them, and has 0."),
    ],
)
def test_a_wrong_set_names_itself_and_the_remedy(given, said):
    text = complaint(lambda: mission_from(document(sets=[given])))
    assert text.startswith(f"--set {given}: ") and said in text


def test_a_simulated_flight_takes_the_guards_of_its_airframe_where_the_mission_names_none():
    def guards(airframe, *sets, is_simulated=True):
        given = document(sets=[f"sim.airframe={airframe}", *sets])
        return mission_from(given, world_from(given) if is_simulated else None).companion.estimate.guards

    assert guards("foldable") == guards("rigid") == GuardsConfig(), "to the last digit, or no flight comes again"
    # The mission's own are all that it flies with, and a real vehicle is none of `sim:`
    assert guards("foldable", "companion.estimate.guards={centre_m: 0.2}") == GuardsConfig(centre_m=0.2)
    assert guards("foldable", is_simulated=False) == GuardsConfig()
    assert guards("foldable", "companion.estimate={position_noise_m: 0.05}") == GuardsConfig()


@pytest.mark.parametrize("wrong", ["companion=3", "companion.estimate=3", "companion.estimate=null"])
def test_a_companion_part_that_is_none_is_refused_beside_a_simulated_vehicle_too(wrong):
    given = document(sets=[wrong])
    assert complaint(mission_from, given, world_from(given)) == complaint(mission_from, given)


def test_what_is_wrong_in_an_airframes_file_names_that_file(tmp_path):
    own = tmp_path / "heavy.yaml"
    own.write_text("based_on: foldable\nname: heavy\nmas_kg: 1.2\n")
    text = complaint(world_from, document(sets=[f"sim.airframe={own}"]))
    assert text.startswith(f"{own}:3: mas_kg: unknown key") and "did you mean 'mass_kg'?" in text
    own.write_text("based_on: foldable\nname: heavy\ninertia_kg_m2: [3.4, 3.4, 5.3]\n")
    text = complaint(world_from, document(sets=[f"sim.airframe={own}"]))
    assert text.startswith(f"{own}:3: inertia_kg_m2: all mass at the rim") and text.endswith("are these g m^2?")


def test_of_thousands_of_faults_the_first_ones_are_shown():
    lines = "".join(f"  - wait: {{mistake{n}: 1}}\n" for n in range(200))
    found = parse_document(f"name: demo\nitems:\n{lines}", "demo.yaml")
    said = complaint(validated, Mission, found, found.data).splitlines()
    assert len(said) == 6 and said[0].startswith("demo.yaml:3: items.0.wait: ") and "more" in said[-1]


def test_a_folder_of_its_name_hides_no_mission_and_a_closed_output_ends_no_command(tmp_path):
    (tmp_path / "wall").mkdir()
    command = f"{sys.executable} -m rebound_cli check wall >&-"
    done = subprocess.run(command, shell=True, cwd=tmp_path, env=os.environ | {"PYTHONPATH": str(ROOT)}, stderr=-1)
    assert (done.returncode, done.stderr) == (0, b"")
