"""The missions that ship: valid files, and flown in lockstep each does what its file says."""

import numpy as np
import pytest

from rebound_cli.inputs.documents import load_document
from rebound_cli.inputs.inputs import mission_from, world_from
from rebound_cli.results.truth_match import FlightTruth, match_contacts
from tests.simulated import MISSIONS, simulated

NAMES = tuple(sorted(path.stem for path in MISSIONS.glob("*.yaml")))
# Nothing in them that a real vehicle could not find: they fly on one as they are.
WITHOUT_OBSTACLES = ("orbit", "path", "square")
COME_HOME = ("wall", "corner", "oblique", "knock", "corridor", "patrol", "home", "windy", "acceptance", "detour")


@pytest.mark.parametrize("name", NAMES)
def test_each_is_valid_and_called_like_its_file(name):
    document = load_document(MISSIONS / f"{name}.yaml")
    world = world_from(document)
    mission = mission_from(document, world)
    assert mission.name == name and mission.description
    assert (world.scene.obstacles() == ()) is (name in WITHOUT_OBSTACLES)


@pytest.mark.flight
@pytest.mark.slow
@pytest.mark.parametrize("name", NAMES)
def test_each_mission_ends_as_its_file_says(name):
    flown = simulated(name)
    flown.run_to_end(600.0)
    assert flown.report.outcome == "completed", flown.report.reason
    assert [wish.text for wish in flown.report.expectations if not wish.met] == []
    matches = match_contacts(flown.report.collisions, FlightTruth(flown.hits, flown.series, 0), 0.5)
    assert (matches.false_detections, matches.missed_contacts) == (0, 0)
    assert (len(flown.hits) == 0) is (name in WITHOUT_OBSTACLES)
    if name in COME_HOME:
        assert np.hypot(*flown.series["position_ned_m"][-1, :2]) < 0.5
