"""The two airframes of the paper without noise, for tests of physics."""

import pytest

from sim_vehicle.airframe import Airframe, load_built_in
from tests.sim_vehicle.physics.throwing import quiet


@pytest.fixture(scope="session")
def foldable() -> Airframe:
    return quiet(load_built_in("foldable"))


@pytest.fixture(scope="session")
def rigid() -> Airframe:
    return quiet(load_built_in("rigid"))
