"""Vigorous flight by hand: its sticks, that it is vigorous, and what its table counts."""

import pytest

from bench.studies.hand import HandCase, fly_by_hand, text_of


def test_the_table_counts_what_is_reported_in_the_air_and_not_after_a_touch():
    # Given an hour at each rate, with one report in the air at 50 Hz and one after a touch at 100 Hz
    def row(imu_hz, reported):
        vehicle = {"imu_hz": imu_hz, "mode": "STABILIZED", "seed": 1, "air": "calm"}
        return {**vehicle, "watched_s": 3600.0, "tilt_deg": [20.0, 35.0, 50.0], "touched": False, "reported": reported}

    in_the_air, after = {"kind": "wall", "since_touch_s": None}, {"kind": "floor", "since_touch_s": 0.1}
    lines = text_of([row(50, [in_the_air]), row(100, [after]), row(250, [])]).splitlines()
    # Then the rates' lines show one, none and none
    cells = [[cell.strip() for cell in line.split("|")[1:-1]] for line in lines[2:5]]
    assert [(row[0], row[3], row[6]) for row in cells] == [("50", "1", "wall 1"), ("100", "0", ""), ("250", "0", "")]
    assert sum("seed 1" in line for line in lines) == 1


@pytest.mark.slow
@pytest.mark.parametrize("mode", ["POSCTL", "ALTCTL", "STABILIZED"])
def test_a_flight_by_hand_is_vigorous_and_is_watched_in_every_mode(mode, monkeypatch):
    # Given ten seconds in place of a minute
    monkeypatch.setattr("bench.fly.by_hand.hand_pilot.FLOWN_S", 10.0)
    # When a drawn vehicle is flown by drawn sticks
    row = fly_by_hand(HandCase(7, mode))
    # Then it leant by 20 degrees and more, met nothing, and was watched all the time
    assert row["flown_s"] == pytest.approx(10.0, abs=0.1)
    assert row["tilt_deg"][1] > 20.0
    assert not row["touched"]
    assert all(watched["watched_s"] >= 10.0 for watched in row["watched"])
