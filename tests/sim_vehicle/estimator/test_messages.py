"""What of the filter and its sensors is on the wire."""

import math

import pytest

from sim_vehicle.geography import Origin
from sim_vehicle.scene import Scene
from tests.sim_vehicle.estimator.flying import filtered
from tests.sim_vehicle.vehicle_client import SET_INTERVAL, Client

TRUTH = 115  # HIL_STATE_QUATERNION


def test_the_truth_is_sent_on_request_alone():
    scene = Scene.model_validate({"start": {"position_ned_m": [30.0, -20.0, 0.0], "yaw_deg": 90}})
    wire = Client(airframe=filtered(), scene=scene)
    wire.run(1.0)
    assert not wire.all("HIL_STATE_QUATERNION")
    wire.command(SET_INTERVAL, TRUTH, 20_000)
    assert wire.rate_hz("HIL_STATE_QUATERNION", 2.0) == pytest.approx(50, rel=0.05)
    truth = wire.last("HIL_STATE_QUATERNION")
    place = Origin().place_at((30.0, -20.0, -0.08))
    assert (truth.lat, truth.lon) == (round(1e7 * place.latitude_deg), round(1e7 * place.longitude_deg))
    assert truth.alt == pytest.approx(1e3 * place.altitude_m, abs=20)
    assert truth.attitude_quaternion == pytest.approx([math.sqrt(0.5), 0, 0, math.sqrt(0.5)], abs=0.01)


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
