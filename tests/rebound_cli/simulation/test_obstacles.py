"""What a flight has found is kept: in its folder, for the next flight, for one that is resumed, for a replay."""

import json
import re

import pytest
import yaml

from rebound_cli.inputs import load_mission_document, mission_from
from rebound_cli.main import main
from tests.rebound_cli.command import QUICK, WALL, assert_comes_again

pytestmark = pytest.mark.flight

# Into the wall 4 m north, in a room that leaves a way round it; the second item asks for a place behind it.
TO_WALL = "items=[{takeoff: {height_m: 1.5}}, {go_to: {position_ned_m: [6, 0, -1.5], speed_m_s: 2}}, {return: {}}]"
NARROW = "sim.walls.0.width_m=1.0"


def fly(*arguments):
    return main(["fly", str(WALL), "--lockstep", "--set", TO_WALL, "--set", NARROW, *QUICK, *map(str, arguments)])


def test_a_flight_that_is_resumed_still_knows(tmp_path):
    # Given a flight that its time limit ends after the hit
    first, second = tmp_path / "first", tmp_path / "second"
    limit = ("--set", "abort_when.flight_time_above_s=8", "--set", "on_collision.then=detour")
    assert fly(*limit, "--out", first) == 1
    found = json.loads((first / "obstacles.json").read_text())
    (patch,) = found["patches"]
    assert patch["normal_ned"][0] < -0.9 and patch["touches_ned_m"][0][0] == pytest.approx(4.0, abs=0.2)
    # When it goes on, then round what it has found
    assert fly("--set", "on_collision.then=detour", "--resume", first, "--out", second) == 0
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
    (patch,) = mission_from(load_mission_document(mission, ())).obstacles.patches()
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
    assert fly("--obstacles", stored, "--out", tmp_path / "run") == 78
    error = capsys.readouterr().err
    assert "hall.yaml" in error and all(word in error for word in words)


def test_check_shows_the_way_round_what_is_known(tmp_path, capsys):
    stored = tmp_path / "hall.yaml"
    stored.write_text("patches: [{touches_ned_m: [[4, 0, -1.5]], normal_ned: [-1, 0, 0]}]")
    asked = ["check", str(WALL), "--set", f"obstacles.file={stored}", "--out", str(tmp_path)]
    assert main(asked) == 0
    shown = capsys.readouterr().out
    assert "round what is known" in shown and "Known      surface facing 180 deg" in shown
    page = (tmp_path / "wall.html").read_text()
    assert re.search(r'"surfaces": ?\[[^\]]', page), "what is known is drawn, too"
