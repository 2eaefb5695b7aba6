"""Random missions follow from their seed alone, can be flown, and are of all kinds."""

from collections import Counter

import pytest
import yaml

from bench.cases.missions import (
    MissionCase,
    random_mission,
)
from companion.mission.model import Mission

SEEDS = range(1, 121)


@pytest.fixture(scope="module")
def drawn():
    return {seed: random_mission(MissionCase(seed, "foldable")) for seed in SEEDS}


def test_the_same_seed_is_the_same_mission_and_another_seed_another(drawn):
    assert random_mission(MissionCase(7, "foldable")) == drawn[7]
    assert len({yaml.safe_dump(mission.data) for mission in drawn.values()}) == len(SEEDS)


def test_every_mission_is_a_mission_file_that_reads_back_the_same(drawn):
    for mission in drawn.values():
        read = yaml.safe_load(yaml.safe_dump(mission.data))
        assert read == mission.data
        assert Mission.model_validate(read).name.startswith("random-")


def test_every_kind_of_room_item_policy_and_end_comes_up(drawn):
    rooms = {mission.room for mission in drawn.values()}
    assert rooms == {"closed room", "free walls", "corner", "corridor", "poles", "boxes"}
    items = Counter(next(iter(item)) for mission in drawn.values() for item in mission.data["items"])
    wanted = {"takeoff", "go_to", "velocity", "path", "orbit", "hold", "set_yaw", "set_speed", "wait_for", "repeat"}
    assert set(items) == wanted | {"land", "return"}
    policies = {mission.data["on_collision"]["then"] for mission in drawn.values()}
    assert policies >= {"detour", "hold", "continue", "retry", "return", "land"}
    assert {mission.stream_hz for mission in drawn.values()} == {50, 200}
    assert {extra for mission in drawn.values() for extra in mission.extras} == {
        "beam over the start",
        "cart",
        "block at the landing",
    }
    assert any("on_collision" in item for mission in drawn.values() for item in mission.data["items"])
    assert any(wall["name"] == "ceiling" for m in drawn.values() for wall in m.data["sim"].get("walls", ()))
