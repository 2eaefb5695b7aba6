"""What of the filter and its sensors is on the wire."""

import math

import pytest
from pymavlink.dialects.v20 import development as dialect

from sim_vehicle.geography import Origin
from sim_vehicle.scene import Scene
from sim_vehicle.vehicle import SimulatedVehicle
from tests.sim_vehicle.estimator.flying import filtered

OPTICAL_FLOW_RAD, HIL_STATE_QUATERNION, DISTANCE_SENSOR, ODOMETRY = 106, 115, 132, 331


class Wire:
    """Everything that a vehicle sends, decoded, with a way to ask for a stream."""

    def __init__(self, airframe, scene=None, parameters=None):
        self.vehicle = SimulatedVehicle(airframe, scene or Scene(), seed=1, parameters=parameters)
        self._link = dialect.MAVLink(None, srcSystem=1, srcComponent=191)
        self._parser = dialect.MAVLink(None)
        self._waiting = b""
        self.received = {}

    def ask(self, message_id, hz):
        fields = (1, 1, 511, 0, message_id, 1e6 / hz, 0, 0, 0, 0, 0)
        self._waiting = dialect.MAVLink_command_long_message(*fields).pack(self._link)

    def run(self, seconds):
        for _ in range(round(250 * seconds)):
            waiting, self._waiting = self._waiting, b""
            for raw in self.vehicle.step(waiting):
                message = self._parser.decode(bytearray(raw))
                self.received.setdefault(message.get_msgId(), []).append(message)

    def rate_hz(self, message_id, seconds):
        self.received.clear()
        self.run(seconds)
        return len(self.received.get(message_id, [])) / seconds


def test_flow_and_range_are_sent_at_ten_hertz_where_they_are_simulated():
    wire = Wire(filtered())
    assert wire.rate_hz(OPTICAL_FLOW_RAD, 10.0) == pytest.approx(10, rel=0.03)
    assert len(wire.received[DISTANCE_SENSOR]) == pytest.approx(100, rel=0.03)
    distance = wire.received[DISTANCE_SENSOR][-1]
    assert distance.current_distance == pytest.approx(8, abs=4)
    assert (distance.min_distance, distance.max_distance, distance.orientation) == (1, 4000, 25)
    assert distance.signal_quality == 100
    flow = wire.received[OPTICAL_FLOW_RAD][-1]
    # On its feet the camera is too near to see anything.
    assert (flow.integration_time_us, flow.quality, flow.distance) == (100_000, 0, -1.0)


def test_without_the_filter_neither_is_sent():
    wire = Wire(filtered(changes={"estimate": {"kind": "markov"}}))
    wire.run(2.0)
    assert not {OPTICAL_FLOW_RAD, DISTANCE_SENSOR} & wire.received.keys()


def test_the_truth_is_sent_on_request_alone():
    scene = Scene.model_validate({"start": {"position_ned_m": [30.0, -20.0, 0.0], "yaw_deg": 90}})
    wire = Wire(filtered(), scene)
    wire.run(1.0)
    assert HIL_STATE_QUATERNION not in wire.received
    wire.ask(HIL_STATE_QUATERNION, 50)
    assert wire.rate_hz(HIL_STATE_QUATERNION, 2.0) == pytest.approx(50, rel=0.05)
    truth = wire.received[HIL_STATE_QUATERNION][-1]
    place = Origin().place_at((30.0, -20.0, -0.08))
    assert (truth.lat, truth.lon) == (round(1e7 * place.latitude_deg), round(1e7 * place.longitude_deg))
    assert truth.alt == pytest.approx(1e3 * place.altitude_m, abs=20)
    assert truth.attitude_quaternion == pytest.approx([math.sqrt(0.5), 0, 0, math.sqrt(0.5)], abs=0.01)


def test_the_truth_lies_where_the_parameters_put_the_world():
    there = {"SIH_LOC_LAT0": -33.0, "SIH_LOC_LON0": 151.0, "SIH_LOC_H0": 20.0}
    wire = Wire(filtered(), parameters=there)
    wire.ask(HIL_STATE_QUATERNION, 50)
    wire.run(0.5)
    truth = wire.received[HIL_STATE_QUATERNION][-1]
    assert (truth.lat, truth.lon) == pytest.approx((-330_000_000, 1_510_000_000), abs=1)
    assert truth.alt == pytest.approx(20_000, abs=100)


def test_odometry_counts_the_filters_resets_and_states_its_variances():
    wire = Wire(filtered())
    wire.run(2.0)
    assert {message.reset_counter for message in wire.received[ODOMETRY]} == {0}
    onboard = wire.vehicle._plant.onboard
    wire.received.clear()
    onboard.reset_counter = 258
    wire.run(0.2)
    last = wire.received[ODOMETRY][-1]
    assert last.reset_counter == 2
    position, velocity, attitude = onboard.variances()
    assert last.pose_covariance[0] == pytest.approx(position, rel=0.1)
    assert last.velocity_covariance[0] == pytest.approx(velocity, rel=0.1)
    assert last.pose_covariance[15] == pytest.approx(attitude, rel=0.1)
