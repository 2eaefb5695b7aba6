"""Flights that begin in the air are steady from the first interval on."""

import numpy as np
import pytest

from sim_vehicle.airframe import load_built_in
from sim_vehicle.plant.cruise import Cruise
from sim_vehicle.scene import Scene
from tests.sim_vehicle.physics.throwing import quiet


@pytest.mark.parametrize("velocity", [(2.0, 0.0, 0.0), (-1.0, 3.0, 0.0), (0.0, 0.0, -1.0), (0.0, 0.0, 0.0)])
@pytest.mark.parametrize("wind", [(0.0, 0.0, 0.0), (0.0, 3.0, 0.0)])
def test_it_goes_on_as_it_was(velocity, wind) -> None:
    airframe = quiet(load_built_in("foldable"), drag_n_s_m=0.25)
    cruise = Cruise(airframe, Scene(wind_ned_m_s=wind), (1.0, 2.0, -5.0), velocity, yaw_rad=2.5)
    outputs = [cruise.step() for _ in range(250)]
    body = cruise.plant.state.body
    assert np.array(body[3:6]) == pytest.approx(np.array(velocity), abs=1e-3)
    assert np.array(body[0:3]) == pytest.approx(np.array([1.0, 2.0, -5.0]) + np.array(velocity), abs=1e-3)
    assert np.abs(body[10:13]).max() < 1e-3
    # Its estimate has flown with it, late by what it is late.
    assert np.array([output.velocity_ned_m_s for output in outputs]) == pytest.approx(
        np.tile(velocity, (250, 1)), abs=1e-3
    )
    assert np.array(outputs[-1].position_ned_m) == pytest.approx(body[0:3] - 0.02 * np.array(velocity), abs=1e-3)
