"""Messages of the external simulator on the wire, as PX4 reads and writes them."""

import math

import pytest
from pymavlink.dialects.v20 import development as dialect

from sim_vehicle.estimator.samples import FlowSample, RangeSample
from sim_vehicle.geography import Place
from sim_vehicle.hil.messages import ActuatorControls, Air, HilGps, HilSensor, MotionCapture
from sim_vehicle.mavlink.decode import Decoder
from sim_vehicle.mavlink.encode import Encoder
from sim_vehicle.mavlink.hil import ANSWERS, SIMULATOR, answered, filled

ZURICH = Place(47.397742, 8.545594, 488.123)


def on_the_wire(message) -> dialect.MAVLink_message:
    return dialect.MAVLink(None).decode(bytearray(Encoder(SIMULATOR).packet(filled(message))))


def controls_packet(controls: list[float], mode: int, flags: int) -> bytes:
    link = dialect.MAVLink(None, srcSystem=1, srcComponent=1)
    return dialect.MAVLink_hil_actuator_controls_message(
        4_000, controls + [0.0] * (16 - len(controls)), mode, flags
    ).pack(link)


def test_a_sample_with_everything_has_every_bit_of_every_group():
    air = Air(pressure_hpa=955.8, altitude_m=488.0, temperature_c=11.8)
    sent = on_the_wire(HilSensor(4_000, (0, 0, -9.81), (0, 0, 0), (0.21, 0.01, 0.43), air))
    assert sent.fields_updated == 0x3F | 0x1C0 | 0x1A00
    assert (sent.xmag, sent.ymag, sent.zmag) == pytest.approx((0.21, 0.01, 0.43))
    assert (sent.abs_pressure, sent.pressure_alt, sent.temperature) == pytest.approx((955.8, 488.0, 11.8))


def test_a_fix_in_the_units_of_the_protocol():
    sent = on_the_wire(HilGps(100_000, ZURICH, (3.0, -4.0, 0.25), 0.03))
    assert (sent.lat, sent.lon, sent.alt) == (473977420, 85455940, 488123)
    assert (sent.vn, sent.ve, sent.vd, sent.vel) == (300, -400, 25, 500)
    assert sent.cog == round(100 * (360 - math.degrees(math.atan2(4, 3))))
    assert (sent.fix_type, sent.eph, sent.epv) == (3, 3, 3)
    assert sent.satellites_visible >= 6


def test_motion_capture_is_an_odometry_in_local_ned_that_ekf2_reads():
    sent = on_the_wire(MotionCapture(20_000, (1.0, 2.0, -3.0), (0.8, 0.0, 0.6, 0.0), 4e-6, 2.5e-5))
    assert (sent.frame_id, sent.estimator_type) == (dialect.MAV_FRAME_LOCAL_NED, dialect.MAV_ESTIMATOR_TYPE_VISION)
    assert (sent.x, sent.y, sent.z) == (1.0, 2.0, -3.0)
    assert tuple(sent.q) == pytest.approx((0.8, 0.0, 0.6, 0.0))
    assert all(math.isnan(value) for value in (sent.vx, sent.vy, sent.vz, sent.rollspeed))
    covariance = sent.pose_covariance
    assert [covariance[i] for i in (0, 6, 11)] == pytest.approx([4e-6] * 3)
    assert [covariance[i] for i in (15, 18, 20)] == pytest.approx([2.5e-5] * 3)
    assert sum(value != 0 for value in covariance) == 6


@pytest.mark.parametrize(
    ("packet", "expected"),
    [
        (
            controls_packet([0.1, 0.2, 0.3, 0.4] * 2, 0x81, 1),
            ActuatorControls(4_000, True, True, (0.1, 0.2, 0.3, 0.4) * 2),
        ),
        (controls_packet([0.0] * 8, 0x01, 1), ActuatorControls(4_000, False, True, (0.0,) * 8)),
        (controls_packet([0.5] * 8, 0x81, 0), ActuatorControls(4_000, True, False, (0.5,) * 8)),
        (controls_packet([math.nan, 0.5] * 4, 0x81, 1), ActuatorControls(4_000, True, True, (0, 0.5) * 4)),
    ],
    ids=["armed", "disarmed", "without lockstep", "a motor that is off"],
)
def test_answers_of_px4(packet, expected):
    (answer,) = Decoder(SIMULATOR, ANSWERS).push(packet)
    found = answered(answer)
    assert found.motor_fractions == pytest.approx(expected.motor_fractions)
    assert (found.time_us, found.armed, found.is_lockstep) == (expected.time_us, expected.armed, expected.is_lockstep)


def test_optical_flow_as_px4_takes_it():
    """The simulator's message, with the gyroscope beside the flow; the distance is a range finder's business."""
    sent = on_the_wire(FlowSample(200_000, 100_000, (0.02, -0.1), (0.01, 0.002, -0.003), 200))
    assert sent.get_type() == "HIL_OPTICAL_FLOW"
    assert (sent.time_usec, sent.integration_time_us, sent.quality) == (200_000, 100_000, 200)
    assert (sent.integrated_x, sent.integrated_y) == pytest.approx((0.02, -0.1))
    assert (sent.integrated_xgyro, sent.integrated_ygyro, sent.integrated_zgyro) == pytest.approx((0.01, 0.002, -0.003))
    assert sent.distance < 0  # unknown


@pytest.mark.parametrize(("distance_m", "shown_cm", "signal"), [(1.234, 123, 100), (None, 4001, 1)])
def test_the_range_finder_looks_down(distance_m: float | None, shown_cm: int, signal: int):
    sent = on_the_wire(RangeSample(200_000, distance_m, 0.01, 40.0))
    assert sent.get_type() == "DISTANCE_SENSOR"
    assert (sent.orientation, sent.id) == (dialect.MAV_SENSOR_ROTATION_PITCH_270, 0)
    assert (sent.current_distance, sent.min_distance, sent.max_distance) == (shown_cm, 1, 4000)
    assert sent.signal_quality == signal
