"""The missions that ship, flown in lockstep: each does what its file says."""

import functools

import numpy as np
import pytest

from rebound_cli.results.truth_match import FlightTruth, match_contacts
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
    matches = match_contacts(flown.report.collisions, FlightTruth(flown.hits, flown.series, 0), 0.5)
    assert (matches.false_detections, matches.missed_contacts) == (0, 0)
    assert (len(flown.hits) == 0) is (name in WITHOUT_OBSTACLES)


def test_the_wall_missions_come_home():
    for name in ("wall", "corner", "oblique", "knock", "corridor", "patrol", "home", "windy", "acceptance", "detour"):
        assert np.hypot(*fly(name).series["position_ned_m"][-1, :2]) < 0.5
