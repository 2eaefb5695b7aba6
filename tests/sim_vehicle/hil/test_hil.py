"""PX4's external simulator without sockets: messages, lockstep as a table, sensors, and our airframes' parameters."""

import math

import pytest
from pymavlink.dialects.v20 import development as dialect

from companion.autopilot.px4.setup import judge_parameters
from companion.autopilot.setup import Setup, Verdict
from companion.reflex.config import EstimateConfig
from sim_vehicle.airframe import load_built_in
from sim_vehicle.errors import NotInLockstep
from sim_vehicle.estimator.samples import CaptureSample, FlowSample, RangeSample
from sim_vehicle.geography import Place
from sim_vehicle.hil.exchange import ANSWER_TIMEOUT_US, STARTING_TIMEOUT_US, Exchange, ExchangePhase
from sim_vehicle.hil.messages import MOTORS_STOPPED, ActuatorControls, Air, HilGps, HilSensor
from sim_vehicle.hil.parameters import Position, px4_parameters
from sim_vehicle.hil.sensors import air_at
from sim_vehicle.hil.vehicle import HilVehicle
from sim_vehicle.mavlink.decode import Decoder
from sim_vehicle.mavlink.encode import Encoder
from sim_vehicle.mavlink.hil import ANSWERS, SIMULATOR, answered, filled
from sim_vehicle.scene import Scene
from tests.sim_vehicle.physics.throwing import quiet

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
    sent = on_the_wire(CaptureSample(20_000, (1.0, 2.0, -3.0), (0.8, 0.0, 0.6, 0.0), 2e-3, 5e-3))
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


def answer(time_us: int, armed: bool = True, is_lockstep: bool = True) -> ActuatorControls:
    return ActuatorControls(time_us, armed, is_lockstep, (0.5,) * 4)


def test_an_answer_to_an_older_sample_gives_its_commands_but_not_the_turn():
    exchange = Exchange(0)
    exchange.sent(4_000, 0)
    exchange.sent(8_000, 4_000)
    exchange.received(answer(4_000))
    exchange.sent(12_000, 8_000)
    exchange.received(answer(8_000, armed=False))
    assert exchange.phase is ExchangePhase.AWAITING
    assert exchange.motor_fractions == MOTORS_STOPPED, "disarmed, whatever it says of them"
    exchange.received(answer(12_000))
    assert exchange.phase is ExchangePhase.READY


def test_an_answer_that_does_not_come_is_given_up_after_the_timeout_and_told_once():
    exchange = Exchange(0)
    exchange.sent(4_000, 1_000)
    exchange.received(answer(4_000))
    exchange.notices.clear()
    exchange.sent(8_000, 10)
    exchange.look_at_clock(10 + ANSWER_TIMEOUT_US - 1)
    assert exchange.next_sample_at_us() is None
    exchange.look_at_clock(10 + ANSWER_TIMEOUT_US)
    assert exchange.next_sample_at_us() is not None
    exchange.sent(12_000, 20 + ANSWER_TIMEOUT_US)
    exchange.look_at_clock(20 + 2 * ANSWER_TIMEOUT_US)
    assert exchange.overdue_answers == 2
    assert len(exchange.notices) == 1


def test_a_px4_that_never_answers_is_told_of_once():
    exchange = Exchange(0)
    for now_us in range(0, STARTING_TIMEOUT_US + 3_000_000, 1_000_000):
        exchange.look_at_clock(now_us)
    assert len(exchange.notices) == 1
    assert "no motor commands" in exchange.notices[0]


@pytest.mark.parametrize("wrong", [answer(4_000, is_lockstep=False), answer(8_000)])
def test_a_px4_with_a_clock_of_its_own_is_refused(wrong):
    exchange = Exchange(0)
    exchange.sent(4_000, 0)
    with pytest.raises(NotInLockstep, match="lockstep"):
        exchange.received(wrong)


FOLDABLE = load_built_in("foldable")


def of_kind(messages: list, kind: type) -> list:
    return [message for message in messages if isinstance(message, kind)]


def test_pressure_is_the_standard_atmospheres_and_falls_with_height():
    # ICAO 7488: 954.61 hPa at 500 m, 0.115 hPa less a metre there; 9 deg C at 924 m.
    assert air_at(500.0).pressure_hpa == pytest.approx(954.61, abs=0.05)
    assert air_at(500.0).pressure_hpa - air_at(501.0).pressure_hpa == pytest.approx(0.115, abs=0.002)
    assert air_at(924.0).temperature_c == pytest.approx(9.0, abs=0.1)
    assert air_at(500.0).altitude_m == pytest.approx(500.0)


def test_every_sensor_comes_at_its_rate_and_the_inertial_one_last():
    vehicle = HilVehicle(FOLDABLE, Scene(), seed=1, sample_interval_us=4_000)
    steps = [vehicle.step(MOTORS_STOPPED) for _ in range(250)]
    assert all(isinstance(messages[-1], HilSensor) for messages in steps)
    assert all(messages[-1].time_us == 4000 * (i + 1) for i, messages in enumerate(steps))
    everything = [message for messages in steps for message in messages]
    assert len(of_kind(everything, HilGps)) == 10
    assert len(of_kind(everything, CaptureSample)) == 50
    sensors = of_kind(everything, HilSensor)
    assert sum(sensor.magnetic_field_frd_gauss is not None for sensor in sensors) == 50
    assert sum(sensor.air is not None for sensor in sensors) == 50


def test_what_px4s_sixteen_bits_cannot_hold_is_clipped_and_does_not_wrap():
    # Given a sensor of a larger range than PX4's simulated one, far off on an axis at least
    off = {"accelerometer_range_m_s2": 400.0, "accelerometer_bias_m_s2": 500.0, "gyroscope_bias_rad_s": 100.0}
    vehicle = HilVehicle(quiet(FOLDABLE, **{f"imu__{name}": value for name, value in off.items()}), Scene(), 1)
    (sample,) = of_kind(list(vehicle.step(MOTORS_STOPPED)), HilSensor)
    # Then the largest is the largest number of the driver, g / 2048 and 2000 deg/s / 32768 apart
    assert max(map(abs, sample.specific_force_frd_m_s2)) == pytest.approx(32_767 * 9.80665 / 2048, rel=1e-6)
    assert max(map(abs, sample.angular_velocity_frd_rad_s)) == pytest.approx(32_767 * math.radians(2000 / 32_768))


def test_a_lost_gps_is_silent():
    scene = Scene.model_validate({"faults": [{"kind": "aiding_loss", "sensor": "gps", "at_s": 0.5}]})
    vehicle = HilVehicle(FOLDABLE, scene, seed=1, sample_interval_us=4_000)
    sent = [of_kind(list(vehicle.step(MOTORS_STOPPED)), HilGps) for _ in range(370)]
    assert any(sent[:110]) and not any(sent[126:])


def test_a_unit_of_roll_torque_turns_as_fast_as_the_gains_assume():
    """A roll torque setpoint s moves each motor by s / sqrt(2); P times the acceleration of s = 1 is the loop."""
    vehicle = HilVehicle(quiet(FOLDABLE), Scene(), 1, sample_interval_us=4_000)
    values = {parameter.name: parameter.value for parameter in px4_parameters(FOLDABLE, "mocap")}
    hover, part = values["MPC_THR_HOVER"], 0.01
    for _ in range(150):
        vehicle.step((0.95,) * 4)
    offset = part / math.sqrt(2)
    rates = []
    for _ in range(40):
        messages = vehicle.step((hover - offset, hover + offset, hover + offset, hover - offset))
        rates += [(m.time_us, m.angular_velocity_frd_rad_s[0]) for m in messages if isinstance(m, HilSensor)]
    (t0, p0), (t1, p1) = rates[-6], rates[-1]
    per_unit = (p1 - p0) / (1e-6 * (t1 - t0)) / part
    loop_per_s = 2 * FOLDABLE.control.attitude_damping * FOLDABLE.control.attitude_frequency_rad_s
    assert values["MC_ROLLRATE_P"] * per_unit == pytest.approx(loop_per_s, rel=0.05)


@pytest.mark.parametrize("position", ["mocap", "gps", "flow"])
def test_they_are_what_preflight_asks_for(position: Position) -> None:
    told = {parameter.name: parameter.value for parameter in px4_parameters(FOLDABLE, position)}
    setup = Setup(told, None, "quadrotor", EstimateConfig(), 250.0, 5.0, "")
    found = {item.item: item.verdict for item in judge_parameters(setup) if item.item in told}
    assert {"COM_OF_LOSS_T", "COM_OBL_RC_ACT", "COM_RCL_EXCEPT", "IMU_INTEG_RATE"} <= set(found)
    assert set(found.values()) == {Verdict.GOOD}
