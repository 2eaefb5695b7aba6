"""Parameters: PX4's names, what counts and when, and what they change."""

import math

import pytest

from sim_vehicle.parameters.store import Parameters


@pytest.mark.parametrize(("value", "counts"), [(100.0, 8.0), (-1.0, 0.5), (math.nan, 3.0), (math.inf, 8.0)])
def test_what_is_out_of_range_is_stored_but_does_not_count(value, counts):
    parameters = Parameters()
    parameters.set("MPC_Z_VEL_MAX_UP", value)
    assert str(parameters.stored("MPC_Z_VEL_MAX_UP")) == str(value)
    assert parameters["MPC_Z_VEL_MAX_UP"] == counts
