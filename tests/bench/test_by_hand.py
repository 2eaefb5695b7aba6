"""Vigorous flight by hand: where its sticks come from, that it is vigorous, and what its table counts."""

import itertools
import math

import numpy as np
import pytest

from bench.guarded import STICKS_S, at_most_an_hour
from bench.hand_flown import HandCase, agile, fly_by_hand, table
from bench.hand_pilot import wishes
from bench.stick_logs import StickLogError, logs_with_sticks, sticks_of
from sim_vehicle.airframe import load_built_in

FORMATS = "FMT, 128, 89, FMT, BBnNZ, Type,Length,Name,Format,Columns\nFMT, 135, 40, RCIN, Qhhhh, TimeUS,C1,C2,C3,C4\n"


def log_of(pulses_us, file, hz=10):
    rows = [f"RCIN, {round(1e6 * place / hz)}, {', '.join(map(str, four))}" for place, four in enumerate(pulses_us)]
    file.write_text(FORMATS + "\n".join(rows) + "\n")
    return file


def test_sticks_of_a_log_are_what_its_pulses_say_while_it_flies(tmp_path):
    # Given a throttle that rises to 1700 us for 30 s, and roll that goes from stop to stop meanwhile
    ground, air = [(1500, 1500, 1000, 1500)] * 50, []
    for place in range(300):
        air.append((1000 if place % 20 < 10 else 2000, 1500, 1700, 1750))
    file = log_of([*ground, *air, *ground], tmp_path / "flight.log")
    # When its sticks are read
    sticks = sticks_of(file)
    # Then they are those of the flight alone, at the pilot's own rate, with the hovering throttle in the middle
    assert len(sticks) * STICKS_S == pytest.approx(29.9, abs=0.05)
    assert sticks[:, 0].min() == -1.0 and sticks[:, 0].max() == 1.0
    assert np.all(sticks[:, 1] == 0.0) and np.all(sticks[:, 2] == 0.0) and np.all(sticks[:, 3] == 0.5)
    # and between two of its samples a stick is on its way
    assert len(np.unique(sticks[:, 0])) > 2
    assert logs_with_sticks(tmp_path) == [file]


@pytest.mark.parametrize("case", ["still", "short", "slow", "damaged"])
def test_a_log_that_flies_nothing_hard_is_none(case, tmp_path):
    # Given sticks that nobody moves, or for a moment, or at 5 Hz; or something else with that name
    moving = [(1000 + 1000 * (place % 2), 1500, 1600, 1500) for place in range(300)]
    file = tmp_path / "flight.log"
    if case == "damaged":
        (tmp_path / "flight.bin").write_bytes(b"no log at all" * 99)
    else:
        pulses_us = {"still": [(1500, 1500, 1600, 1500)] * 300, "short": moving[:100], "slow": moving}[case]
        log_of(pulses_us, file, hz=5 if case == "slow" else 10)
    # When a folder is searched for sticks, then it says that there are none
    with pytest.raises(StickLogError, match="no log in it has moving sticks"):
        logs_with_sticks(tmp_path)


def test_drawn_sticks_reach_every_stop_and_never_pass_one():
    # Given two minutes of one seed
    drawn = [wishes(None, np.random.default_rng(5)) for _ in range(2)]
    first, second = (list(itertools.islice(one, round(120.0 / STICKS_S))) for one in drawn)
    values = np.array([(one.roll, one.pitch, one.throttle, one.yaw) for one in first])
    # Then each stick was at both stops, none beyond, and the same seed flies the same
    assert np.all(values.max(axis=0) == 1.0) and np.all(values.min(axis=0) == -1.0)
    assert first == second


def test_no_vehicle_is_asked_for_more_tilt_than_carries_its_weight():
    # Given the named airframe, which hovers at 78 % of its thrust
    airframe = load_built_in("foldable")
    for seed in range(20):
        agile_one, parameters = agile(airframe, np.random.default_rng(seed))
        # Then at the steepest tilt the vertical part of its thrust is still its weight
        upright = math.cos(math.radians(parameters["MPC_MAN_TILT_MAX"]))
        assert upright / airframe.hover_fraction > 1.0
        assert agile_one.control.tilt_max_rad == pytest.approx(math.radians(parameters["MPC_MAN_TILT_MAX"]))


def test_the_bound_of_nothing_in_an_hour_is_the_rule_of_three():
    assert at_most_an_hour(0, 1.0) == pytest.approx(-math.log(0.05))
    assert at_most_an_hour(0, 5.0) == pytest.approx(-math.log(0.05) / 5.0)
    assert at_most_an_hour(0, 0.0) == math.inf


def test_the_table_counts_what_is_reported_in_the_air_and_not_after_a_touch():
    # Given an hour at each rate, with one report in the air at 50 Hz and one after a touch at 100 Hz
    def row(imu_hz, reported):
        vehicle = {"imu_hz": imu_hz, "mode": "ACRO", "sticks": "drawn", "seed": 1, "air": "calm"}
        return {**vehicle, "watched_s": 3600.0, "tilt_deg": [20.0, 35.0, 50.0], "touched": False, "reported": reported}

    in_the_air, after = {"kind": "wall", "since_touch_s": None}, {"kind": "floor", "since_touch_s": 0.1}
    lines = list(table([row(50, [in_the_air]), row(100, [after]), row(250, [])]))
    # Then the rates' lines show one, none and none
    assert [line.split()[4] for line in lines[1:4]] == ["1", "0", "0"]
    assert lines[1].endswith("wall 1")
    assert sum("seed 1" in line for line in lines) == 1


@pytest.mark.slow
@pytest.mark.parametrize("mode", ["POSCTL", "ALTCTL", "STABILIZED", "ACRO"])
def test_a_flight_by_hand_is_vigorous_and_is_watched_in_every_mode(mode, monkeypatch):
    # Given ten seconds in place of a minute
    monkeypatch.setattr("bench.hand_pilot.FLOWN_S", 10.0)
    # When a drawn vehicle is flown by drawn sticks
    row = fly_by_hand(HandCase(7, 250, mode))
    # Then it leant by 20 degrees and more, met nothing, and was watched all the time
    assert row["flown_s"] == pytest.approx(10.0, abs=0.1)
    assert row["tilt_deg"][1] > 20.0
    assert not row["touched"]
    assert row["watched_s"] >= 10.0
