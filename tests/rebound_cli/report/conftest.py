"""The flight into a wall for all tests of its page."""

import pytest

from rebound_cli.report.shown_flight import recorded_flight


@pytest.fixture(scope="session")
def wall_folder(wall_flight):
    return wall_flight[0]


@pytest.fixture(scope="session")
def wall(wall_folder):
    return recorded_flight(wall_folder)
