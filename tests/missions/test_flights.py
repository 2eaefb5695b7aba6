"""The missions that ship, flown in lockstep: each does what its file says."""

import functools
import math

import numpy as np
import pytest

from rebound_cli.results.truth_match import match_contacts
from tests.missions.test_missions import NAMES, WITHOUT_OBSTACLES
from tests.simulated import SimulatedFlight, simulated

pytestmark = [pytest.mark.flight, pytest.mark.slow]


@functools.cache
def fly(name: str) -> SimulatedFlight:
    """Once, to its end."""
    flight = simulated(name)
    flight.run_to_end(600.0)
    return flight


@pytest.mark.parametrize("name", NAMES)
def test_each_mission_ends_as_its_file_says(name):
    flown = fly(name)
    assert flown.report.outcome == "completed", flown.report.reason
    assert [wish.text for wish in flown.report.expectations if not wish.met] == []
    matches = match_contacts(flown.report.collisions, flown.hits, 0.5)
    assert (matches.false_detections, matches.missed_contacts) == (0, 0)
    assert (len(flown.hits) == 0) is (name in WITHOUT_OBSTACLES)


def test_the_wall_missions_come_home():
    for name in ("wall", "corner", "oblique", "knock", "corridor", "patrol", "home", "windy", "acceptance"):
        assert np.hypot(*fly(name).series["position_ned_m"][-1, :2]) < 0.5


def test_where_the_wall_was_touched_is_where_it_stands():
    """Two touches 2 m apart give the wall's angle, 10 degrees."""
    first, second = (np.array(hit.position_ned_m) for hit in fly("touch").report.collisions)
    north_m, east_m, _ = second - first
    assert np.degrees(np.arctan2(north_m, east_m)) == pytest.approx(10.0, abs=3.0)


def test_the_wall_is_found_by_touch_and_no_place_of_it_touched_twice():
    """The first two touches show so much of the wall that the way round is free, there and back."""
    flown = fly("detour")
    assert 2 <= len(flown.hits) <= 3
    (patch,) = flown.report.obstacles
    assert patch.hits == len(flown.hits) and patch.normal_ned == pytest.approx((-1, 0, 0), abs=0.05)
    touched = [(hit.contact_position_ned_m[1], hit.contact_position_ned_m[2]) for hit in flown.hits]
    assert all(math.dist(a, b) > 0.5 for number, a in enumerate(touched) for b in touched[:number])
    # 3 m stand there, from 1.1 m west to 1.9 m east
    for place in patch.touches_ned_m:
        assert place[0] == pytest.approx(4.0, abs=0.2) and -1.3 < place[1] < 2.1
    path = flown.series["position_ned_m"]
    assert np.hypot(*(path[:, :2] - [7, 0.6]).T).min() < 0.5, "the goal was reached"
    assert np.hypot(*path[-1, :2]) < 0.5
