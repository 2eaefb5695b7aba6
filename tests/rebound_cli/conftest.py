"""One flight into the wall for all who look at its folder."""

import shutil

import pytest

from rebound_cli.report.shown_flight import recorded_flight
from tests.rebound_cli.command import WALL, run_here


@pytest.fixture(scope="session")
def wall_flight(tmp_path_factory):
    """The wall mission, flown once: its folder, to be left as it is, and what the command printed."""
    folder = tmp_path_factory.mktemp("flights") / "wall"
    return folder, run_here("fly", WALL, "--lockstep", "--json", "--out", folder)


@pytest.fixture(scope="session")
def wall_folder(wall_flight):
    return wall_flight[0]


@pytest.fixture
def copied(wall_folder, tmp_path):
    """A copy to spoil."""
    return shutil.copytree(wall_folder, tmp_path / "wall")


@pytest.fixture(scope="session")
def wall(wall_folder):
    return recorded_flight(wall_folder)
