"""The ways to the ground: that they are flown as stated, and that each verdict is right."""

import math

import pytest

from bench.fly.by_hand.ways_down import FALLS, FALLS_FROM_M, LANDINGS, GroundCase
from bench.studies.landings import fly_to_the_ground, judged

TOUCHED_S = 5.0
LANDED, FALLEN = False, True


def verdict_on(is_fall, reported):
    """On impacts of these kinds, so many seconds after the touch; the hardest moment is 0.05 s after it."""
    rows = [{"kind": kind, "sample_s": TOUCHED_S + after_s} for kind, after_s in reported]
    return judged(is_fall, round(1e6 * TOUCHED_S), round(1e6 * TOUCHED_S) + 50_000, rows)


@pytest.mark.parametrize(
    ("is_fall", "reported", "outcome", "wrong"),
    [
        (LANDED, [], "nothing", ""),
        (LANDED, [("landing", 0.01)], "landing", ""),
        (LANDED, [("landing", 0.01), ("floor", 0.5)], "landing", "floor in a landing"),
        (LANDED, [("crash", 0.01)], "crash", "crash in a landing"),
        (LANDED, [("wall", -1.0)], "nothing", "wall before the touch"),
        (FALLEN, [], "nothing", "nothing in a crash"),
        (FALLEN, [("landing", 0.01)], "landing", "landing in a crash"),
        (FALLEN, [("crash", 0.01), ("crash", 0.5), ("landing", 0.9)], "crash", ""),
        (FALLEN, [("crash", 0.01), ("wall", 0.5)], "crash", "wall after the crash"),
        (FALLEN, [("crash", 0.3)], "crash", "0.25 s late"),
        (FALLEN, [("ceiling", -0.2), ("crash", 0.01)], "crash", "ceiling before the touch"),
    ],
)
def test_a_way_to_the_ground_is_judged_by_all_that_was_reported(is_fall, reported, outcome, wrong):
    assert verdict_on(is_fall, reported) == (outcome, wrong)


def test_a_flight_that_never_touches_the_ground_shows_nothing():
    assert judged(False, None, None, []) == ("not there", "the ground was not reached")


@pytest.mark.slow
@pytest.mark.parametrize("way", LANDINGS)
def test_a_landing_meets_the_ground_level_at_the_speed_that_was_asked_for(way):
    # When a drawn vehicle lands
    row = fly_to_the_ground(GroundCase(8, 250, way, "hard"))
    # Then it is there, level, about as fast as asked for
    assert row["touched_s"] is not None
    assert row["tilt_deg"] < 5.0
    assert row["sink_m_s"] == pytest.approx(row["asked_m_s"], abs=0.25)


@pytest.mark.slow
def test_falls_meet_the_ground_as_fast_as_their_height_says_and_at_any_tilt():
    # When vehicles fall whose motors stop, some of them after one alone
    rows = [fly_to_the_ground(GroundCase(seed, 250, way, "soft")) for seed in (3, 6, 9) for way in FALLS[:2]]
    # Then none is faster than a fall from the highest height, and none slower than from the lowest
    low_m_s, high_m_s = (math.sqrt(2.0 * 9.81 * height_m) for height_m in FALLS_FROM_M)
    assert all(0.8 * low_m_s < row["sink_m_s"] < 1.05 * high_m_s for row in rows)
    # and what loses one motor first is tipped, by up to more than a right angle
    assert max(row["tilt_deg"] for row in rows if row["way"] == FALLS[0]) < 20.0
    assert max(row["tilt_deg"] for row in rows if row["way"] == FALLS[1]) > 60.0
