"""`rebound fly MISSION --resume RUN`: a flight cut short and flown on, and runs that cannot be gone on with."""

import json

import pytest
import yaml

from rebound_cli.inputs import load_mission_document, mission_from, resume_of
from rebound_cli.main import main
from rebound_cli.results.run_folder import EVENTS_NAME
from tests.rebound_cli.command import QUICK, SQUARE, assert_comes_again, events_of

pytestmark = pytest.mark.flight


def fly(*arguments):
    return main(["fly", str(SQUARE), "--lockstep", *map(str, arguments)])


def steps(folder):
    return [event["data"]["step"] for event in events_of(folder) if event["kind"] == "item"]


def test_a_flight_cut_short_is_flown_on(tmp_path, capsys):
    # Given the square, ended by its own time limit on its third side
    first, second = tmp_path / "first", tmp_path / "second"
    limit = ("--set", "abort_when.flight_time_above_s=14", *QUICK)
    assert fly(*limit, "--out", first) == 1
    assert "flight time above 14 s" in capsys.readouterr().out
    assert steps(first) == [1, 2, 3]
    # When it is resumed
    code = fly(*QUICK, "--resume", first, "--out", second)
    # Then it begins where the third side does, and ends as the mission says
    assert code == 0
    assert steps(second) == [3, 3, 4, 5, 6]
    resume = yaml.safe_load((second / "resolved.yaml").read_text())["resume"]
    assert resume["at_step"] == 3
    assert json.loads((second / "summary.json").read_text())["outcome"] == "completed"
    # and neither another mission nor a flight that is over can be resumed
    assert fly("--resume", second) == 78 and "nothing to resume" in capsys.readouterr().err
    assert fly("--set", "items.1.go_to.speed_m_s=1", "--resume", first) == 78
    assert "its items are others" in capsys.readouterr().err
    # An item that a hit has ended is left behind, though no other had begun
    whole = (first / EVENTS_NAME).read_text()
    (first / EVENTS_NAME).write_text(whole.replace('"next_step": 3', '"next_step": 4'))
    assert resume_of(first, mission_from(load_mission_document(SQUARE, QUICK[1:])))["at_step"] == 4
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
        assert fly(*QUICK, "--resume", first) != 0
        assert capsys.readouterr().err.startswith(f"rebound: {first / EVENTS_NAME}")


def test_a_mission_that_waits_for_a_file_goes_on_when_it_is_there_and_replays(tmp_path):
    sign, folder = tmp_path / "go", tmp_path / "run"
    sign.touch()
    items = f"items=[{{takeoff: {{height_m: 0.6}}}}, {{wait_for: {{file: {sign}}}}}, {{land: {{}}}}]"
    assert fly("--set", items, *QUICK, "--out", folder) == 0
    assert steps(folder) == [1, 2]
    assert_comes_again(folder)
