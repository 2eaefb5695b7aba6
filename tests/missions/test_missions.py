"""The missions that ship."""

import math
import re
from pathlib import Path

import pytest

from rebound_cli.documents import load_document
from rebound_cli.inputs import mission_from, world_from

DOCUMENT = Path(__file__).parents[2] / "docs" / "reference" / "missions.md"
FOLDER = Path(__file__).parents[2] / "missions"
NAMES = tuple(sorted(path.stem for path in FOLDER.glob("*.yaml")))
# Nothing in them that a real vehicle could not find: they fly on one as they are.
WITHOUT_OBSTACLES = ("orbit", "path", "square")

# Of the foldable airframe: how far ahead of the centre a head-on wall is touched.
CONTACT_REACH_M = 0.145 * math.cos(math.pi / 4) + 0.08


def load(name):
    document = load_document(FOLDER / f"{name}.yaml")
    world = world_from(document)
    return mission_from(document, world), world


def test_the_document_lists_all_and_says_which_a_real_vehicle_can_fly():
    rows = re.findall(r"^\| `(\w+)\.yaml` \|.*\| (.*) \|$", DOCUMENT.read_text(), flags=re.MULTILINE)
    assert sorted(name for name, _ in rows) == list(NAMES)
    assert len(NAMES) >= 12
    assert sorted(name for name, obstacles in rows if obstacles == "none") == list(WITHOUT_OBSTACLES)
    for name in NAMES:
        _, world = load(name)
        assert (world.scene.obstacles() == ()) is (name in WITHOUT_OBSTACLES)


@pytest.mark.parametrize("name", NAMES)
def test_each_is_valid_and_called_like_its_file(name):
    mission, world = load(name)
    assert mission.name == name
    assert world.airframe.name == "foldable"
    assert mission.description


def test_the_wall_is_met_at_full_speed():
    # Given wall.yaml, at its own speed and at the fastest of the results
    mission, world = load("wall")
    approach = mission.items[1].go_to
    contact_m = world.scene.walls[0].point_ned_m[0] - CONTACT_REACH_M
    for speed_m_s in (approach.speed_m_s, 2.5):
        ramp_m = speed_m_s**2 / (2 * approach.acceleration_m_s2)
        # Then speeding up is over before the contact and slowing down begins after it
        assert ramp_m < contact_m < approach.position_ned_m[0] - ramp_m


def test_the_oblique_wall_stands_at_35_degrees_to_the_path():
    _, world = load("oblique")
    north, east, _ = world.scene.walls_built()[0].normal_ned
    along_wall = (east, -north)
    assert math.degrees(math.acos(abs(along_wall[0]))) == pytest.approx(35.0, abs=0.01)


def test_the_corner_is_two_walls_that_meet():
    _, world = load("corner")
    first, second = world.scene.walls_built()
    assert sum(a * b for a, b in zip(first.normal_ned, second.normal_ned, strict=True)) == 0.0
    assert first.point_ned_m[0] + first.width_m / 2 >= second.point_ned_m[1]


def test_the_papers_scenario_states_the_papers_law_and_gain():
    data = load_document(FOLDER / "paper.yaml").data
    assert data["recovery"] == {"law": "paper", "gamma": 0.5}


def test_the_papers_scenario_has_the_papers_wall_and_target():
    mission, world = load("paper")
    run = mission.items[3].go_to
    wall_m = world.scene.walls[0].point_ned_m[0]
    assert wall_m == 0.3 and run.position_ned_m == (2.0, 0.0, -4.0)
    # slowing down has begun when the contact points cross x = 0, so that the hit is slower
    braking_from_m = run.position_ned_m[0] - run.speed_m_s**2 / (2 * run.acceleration_m_s2)
    assert braking_from_m < -CONTACT_REACH_M


def test_the_square_returns_to_its_start_and_has_no_wall():
    mission, world = load("square")
    corners = [item.go_to.position_ned_m for item in mission.items if item.go_to]
    assert len(set(corners)) == 4 and corners[-1][:2] == (0.0, 0.0)
    assert world.scene.walls == ()
