"""What a person reads at the end of a flight."""

import json

import pytest

from rebound_cli.results.ending import ending_text


@pytest.fixture
def summary(wall_folder):
    """Of a flight with one hit."""
    return json.loads((wall_folder / "summary.json").read_text())


def test_a_real_vehicle_is_told_of_by_its_telemetry_alone(summary):
    (hit,) = summary["collisions"]
    hit |= {"impact_speed_m_s": 1.98, "settled_after_s": 1.728, "stopped_off_m": 0.53, "truth": None}
    unknown = dict.fromkeys(("false_detections", "missed_contacts", "recontacts", "airframe", "seed"))
    _, _, told, *_ = ending_text(summary | unknown).splitlines()
    assert told == "Hit something at 1.98 m/s. Stopped 0.5 m off it in 1.7 s, landed safely."


def test_what_went_wrong_is_told_and_no_landing_is_claimed(summary):
    # Given a flight that was aborted in its second recovery, with a false alarm and a contact that nobody saw
    (hit,) = summary["collisions"]
    wrong = {"outcome": "aborted", "false_detections": 1, "missed_contacts": 2, "recontacts": 1}
    hits = [hit | {"truth": None}, hit | {"settled_after_s": None}]
    _, _, *lines = ending_text(summary | wrong | {"collisions": hits}).splitlines()
    # Then each is a sentence
    assert lines[0] == "1. False alarm: nothing was touched."
    assert "Not yet still when the flight went on" in lines[1]
    assert "2 hits not seen." in lines
    assert "1 hit before the vehicle had recovered from the one before." in lines
    assert not any("afely" in line for line in lines)
