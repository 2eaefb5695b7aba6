"""One flight into a wall for all tests of its page."""

import pytest

from rebound_cli.main import main
from rebound_cli.report.shown_flight import recorded_flight
from tests.rebound_cli.command import WALL


@pytest.fixture(scope="session")
def wall_folder(tmp_path_factory):
    folder = tmp_path_factory.mktemp("flights") / "wall"
    assert main(["fly", str(WALL), "--lockstep", "--json", "--out", str(folder)]) == 0
    return folder


@pytest.fixture(scope="session")
def wall(wall_folder):
    return recorded_flight(wall_folder)
