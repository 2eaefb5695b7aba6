"""What of the filter and its sensors is on the wire."""

import pytest

from tests.sim_vehicle.estimator.flying import filtered
from tests.sim_vehicle.vehicle_client import Client


def test_odometry_counts_the_filters_resets_and_states_its_variances():
    wire = Client(airframe=filtered())
    wire.run(2.0)
    assert {message.reset_counter for message in wire.all("ODOMETRY")} == {0}
    onboard = wire.vehicle._plant.onboard
    onboard.reset_counter = 258
    wire.run(0.2)
    last = wire.last("ODOMETRY")
    assert last.reset_counter == 2
    position, velocity, attitude = onboard.variances()
    assert last.pose_covariance[0] == pytest.approx(position, rel=0.1)
    assert last.velocity_covariance[0] == pytest.approx(velocity, rel=0.1)
    assert last.pose_covariance[15] == pytest.approx(attitude, rel=0.1)
