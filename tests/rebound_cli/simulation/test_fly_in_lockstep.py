"""Flights on virtual time as a person starts them: whole, cut short and resumed, with what an earlier one has found."""

import json

import pytest
import yaml

from rebound_cli.inputs.inputs import load_mission_document, mission_from, resume_of
from rebound_cli.main import main
from rebound_cli.results.flight_log import read_flight_log
from rebound_cli.results.run_folder import EVENTS_NAME
from rebound_cli.simulation import lockstep
from rebound_cli.simulation.lockstep import virtual_time_limit_s
from tests.rebound_cli.command import HOP, QUICK, SQUARE, WALL, assert_comes_again, events_of, run_here

pytestmark = pytest.mark.flight

FILES = {"mission.yaml", "airframe.yaml", "resolved.yaml", "versions.json", "flight.tlog", "events.jsonl"}
FILES |= {"inputs.jsonl", "obstacles.json", "truth.npz", "summary.json", "report.html"}


def test_one_command_flies_into_the_wall_recovers_and_lands(wall_flight):
    folder, result = wall_flight
    assert result.returncode == 0, result.stderr
    assert {path.name for path in folder.iterdir()} == FILES
    summary = json.loads(result.stdout)
    assert summary == json.loads((folder / "summary.json").read_text())
    assert (summary["outcome"], summary["mission"], summary["airframe"]) == ("completed", "wall", "foldable")
    assert (summary["false_detections"], summary["missed_contacts"], summary["recontacts"]) == (0, 0, 0)
    (hit,) = summary["collisions"]
    assert hit["impact_speed_m_s"] == pytest.approx(2.0, abs=0.15)
    assert hit["truth"]["normal_ned"] == [-1.0, 0.0, 0.0]
    # A hit that clips leaves few samples of the normal: 25 degrees at most in 95 of 100 (bench/notes/results.md).
    assert hit["normal_ned"][0] < -0.85
    assert 0.0 < hit["truth"]["detection_latency_ms"] < 9.0
    assert hit["settled_after_s"] is not None
    kinds = [event["kind"] for event in events_of(folder)]
    order = [kinds.index(one) for one in ("connected", "takeoff", "item", "detection", "recovered", "landing", "done")]
    assert order == sorted(order)
    # And the recovery setpoint was sent for some seconds, clear of the hit and no further than the rebound carries
    log, target = read_flight_log(folder / "flight.tlog"), hit["recovery_setpoint_ned_m"]
    assert (abs(log.setpoint_ned_m - target).max(axis=1) < 0.02).sum() > 50
    assert 0.35 < log.position_ned_m[:, 0].max() - target[0] < 0.7


def test_a_run_folder_can_be_flown_again_to_the_byte(wall_flight, tmp_path):
    folder, _ = wall_flight
    # When the resolved mission of a flight is flown
    again = run_here("fly", folder / "resolved.yaml", "--lockstep", "--json", "--out", tmp_path / "again")
    # Then every byte is the same
    assert again.returncode == 0
    assert (tmp_path / "again" / "flight.tlog").read_bytes() == (folder / "flight.tlog").read_bytes()


def test_a_mission_is_flown_over_a_line_that_loses_every_seventh_packet(tmp_path):
    lossy = ("--set", "sim.faults=[{kind: wire, at_s: 0, loss: 0.15}]")
    flown = run_here("fly", SQUARE, "--lockstep", *HOP, *lossy, "--json", "--out", tmp_path / "run")
    assert flown.returncode == 0, flown.stdout
    assert json.loads(flown.stdout)["stream_rates_hz"]["HIGHRES_IMU"] == pytest.approx(0.85 * 250, rel=0.05)
    assert_comes_again(tmp_path / "run")


def test_a_flight_that_hangs_is_ended(tmp_path, monkeypatch):
    # Given a flight and less virtual time than it needs; the square takes about 35 s, 10 tries of its 4 m more
    documents = [load_mission_document(SQUARE, by) for by in ((), ("on_collision.then=retry",))]
    once_s, retried_s = map(virtual_time_limit_s, map(mission_from, documents))
    assert 100 < once_s < 300 and retried_s - once_s == pytest.approx(10 * 4.0 / 0.3, abs=1.0)
    monkeypatch.setattr(lockstep, "virtual_time_limit_s", lambda _: 3.0)
    # When it runs, then it is given up
    given_up = run_here("fly", SQUARE, "--lockstep", "--out", tmp_path / "run")
    assert given_up.returncode == 1
    assert "the flight was not over after 3 s of virtual time" in given_up.stdout + given_up.stderr


# Into the wall 4 m north, in a room that leaves a way round it; the second item asks for a place behind it.
TO_WALL = "items=[{takeoff: {height_m: 1.5}}, {go_to: {position_ned_m: [6, 0, -1.5], speed_m_s: 2}}, {return: {}}]"
NARROW = "sim.walls.0.width_m=1.0"


def fly_north(*arguments):
    return main(["fly", str(WALL), "--lockstep", "--set", TO_WALL, "--set", NARROW, *QUICK, *map(str, arguments)])


def test_a_flight_that_is_resumed_still_knows(tmp_path):
    # Given a flight that its time limit ends after the hit
    first, second = tmp_path / "first", tmp_path / "second"
    limit = ("--set", "abort_when.flight_time_above_s=8", "--set", "on_collision.then=detour")
    assert fly_north(*limit, "--out", first) == 1
    found = json.loads((first / "obstacles.json").read_text())
    (patch,) = found["patches"]
    assert patch["normal_ned"][0] < -0.9 and patch["touches_ned_m"][0][0] == pytest.approx(4.0, abs=0.2)
    # When it goes on, then round what it has found
    assert fly_north("--set", "on_collision.then=detour", "--resume", first, "--out", second) == 0
    summary = json.loads((second / "summary.json").read_text())
    assert summary["collisions"] == [] and summary["unreachable"] == []
    resolved = yaml.safe_load((second / "resolved.yaml").read_text())
    assert resolved["resume"]["hits"] == 1
    # And its folder holds all that a replay needs, and the memory goes on
    assert "file" not in resolved["obstacles"] and len(resolved["obstacles"]["known"]) == 1
    assert json.loads((second / "obstacles.json").read_text()) == found
    assert_comes_again(second)


def test_the_file_in_a_mission_lies_beside_it(tmp_path):
    data = yaml.safe_load(WALL.read_text())
    (tmp_path / "hall.yaml").write_text("patches: [{touches_ned_m: [[4, 0, -1]], normal_ned: [-2, 0, 0]}]")
    mission = tmp_path / "mission.yaml"
    mission.write_text(yaml.safe_dump({**data, "obstacles": {"file": "hall.yaml"}}))
    (patch,) = mission_from(load_mission_document(mission, ())).obstacles.known
    assert patch.normal_ned == (-1.0, 0.0, 0.0)


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ("patches:\n  - {touches_ned_m: [[4, 0]], normal_ned: [-1, 0, 0]}", (":2", "touches_ned_m")),
        ("patches:\n  - touches_ned_m: [[4, 0, -1]]\n    normal_ned: [0, 0, 0]", ("normal_ned", "direction")),
        ("walls: []", (":1", "unknown key 'walls'")),
    ],
)
def test_what_is_wrong_in_the_file_is_named_with_its_line(tmp_path, capsys, text, words):
    stored = tmp_path / "hall.yaml"
    stored.write_text(text)
    assert fly_north("--obstacles", stored, "--out", tmp_path / "run") == 78
    error = capsys.readouterr().err
    assert "hall.yaml" in error and all(word in error for word in words)


def test_check_shows_the_way_round_what_is_known(tmp_path, capsys):
    stored = tmp_path / "hall.yaml"
    stored.write_text("patches: [{touches_ned_m: [[4, 0, -1.5]], normal_ned: [-1, 0, 0]}]")
    assert main(["check", str(WALL), "--set", f"obstacles.file={stored}", "--no-picture"]) == 0
    shown = capsys.readouterr().out
    assert "round what is known" in shown and "Known      surface facing 180 deg" in shown


def fly_square(*arguments):
    return main(["fly", str(SQUARE), "--lockstep", *map(str, arguments)])


def steps(folder):
    return [event["data"]["step"] for event in events_of(folder) if event["kind"] == "item"]


def test_a_flight_cut_short_is_flown_on(tmp_path, capsys):
    # Given the square, ended by its own time limit on its third side
    first, second = tmp_path / "first", tmp_path / "second"
    limit = ("--set", "abort_when.flight_time_above_s=14", *QUICK)
    assert fly_square(*limit, "--out", first) == 1
    assert "flight time above 14 s" in capsys.readouterr().out
    assert steps(first) == [1, 2, 3]
    # When it is resumed
    code = fly_square(*QUICK, "--resume", first, "--out", second)
    # Then it begins where the third side does, and ends as the mission says
    assert code == 0
    assert steps(second) == [3, 3, 4, 5, 6]
    resume = yaml.safe_load((second / "resolved.yaml").read_text())["resume"]
    assert resume["at_step"] == 3
    assert json.loads((second / "summary.json").read_text())["outcome"] == "completed"
    # and neither another mission nor a flight that is over can be resumed
    assert fly_square("--resume", second) == 78 and "nothing to resume" in capsys.readouterr().err
    assert fly_square("--set", "items.1.go_to.speed_m_s=1", "--resume", first) == 78
    assert "its items are others" in capsys.readouterr().err
    # An item that a hit has ended is left behind, though no other had begun
    whole = (first / EVENTS_NAME).read_text()
    (first / EVENTS_NAME).write_text(whole.replace('"next_step": 3', '"next_step": 4'))
    assert resume_of(first, mission_from(load_mission_document(SQUARE, QUICK[1:])))["at_step"] == 4
    # A reset of the vehicle's position since has moved its frame
    reset = {"time_us": 9, "kind": "estimate", "text": "", "data": {"shift_ned_m": [3.0, 0.0, 0.0]}}
    (first / EVENTS_NAME).write_text(f"{whole}{json.dumps(reset)}\n")
    moved = resume_of(first, mission_from(load_mission_document(SQUARE, QUICK[1:])))
    assert moved["origin_ned_m"][0] - resume["origin_ned_m"][0] == 3.0
    (first / EVENTS_NAME).write_text(whole)
    # A process that was killed leaves no word of an end, and perhaps half a line
    events = (first / EVENTS_NAME).read_text().splitlines(keepends=True)
    cut = [line for line in events if '"aborted"' not in line and '"mode"' not in line]
    (first / EVENTS_NAME).write_text("".join(cut) + cut[-1][:20])
    assert resume_of(first, mission_from(load_mission_document(SQUARE, QUICK[1:])))["at_step"] == 3
    # and what is no word of a flight is refused
    for damage in (b"5\n", b"\xff\xfe\n", b'{"time_us": 1, "kind": "armed"}\n{"time_us": 2, "kind": "item"}\n'):
        (first / EVENTS_NAME).write_bytes(damage)
        capsys.readouterr()
        assert fly_square(*QUICK, "--resume", first) != 0
        assert capsys.readouterr().err.startswith(f"rebound: {first / EVENTS_NAME}")


def test_a_mission_that_waits_for_a_file_goes_on_when_it_is_there_and_replays(tmp_path):
    sign, folder = tmp_path / "go", tmp_path / "run"
    sign.touch()
    # A name that no file can have is never there
    waits = f"{{wait_for: {{file: {'n' * 300}}}, timeout_s: 2, on_timeout: continue}}, {{wait_for: {{file: {sign}}}}}"
    items = f"items=[{{takeoff: {{height_m: 0.6}}}}, {waits}, {{land: {{}}}}]"
    assert fly_square("--set", items, *QUICK, "--out", folder) == 0
    assert steps(folder) == [1, 2, 3]
    assert_comes_again(folder)
