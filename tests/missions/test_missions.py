"""The missions that ship, as files."""

import pytest

from rebound_cli.inputs.documents import load_document
from rebound_cli.inputs.inputs import mission_from, world_from
from tests.simulated import MISSIONS

NAMES = tuple(sorted(path.stem for path in MISSIONS.glob("*.yaml")))
# Nothing in them that a real vehicle could not find: they fly on one as they are.
WITHOUT_OBSTACLES = ("orbit", "path", "square")


@pytest.mark.parametrize("name", NAMES)
def test_each_is_valid_and_called_like_its_file(name):
    document = load_document(MISSIONS / f"{name}.yaml")
    world = world_from(document)
    mission = mission_from(document, world)
    assert mission.name == name and mission.description
    assert (world.scene.obstacles() == ()) is (name in WITHOUT_OBSTACLES)
