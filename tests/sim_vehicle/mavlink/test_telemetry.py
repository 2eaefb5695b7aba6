"""What a client is told on each kind of link, unasked or at which rate it asked, and whether it fits together."""

import math
from collections import Counter
from itertools import pairwise

import pytest
from pymavlink.dialects.v20 import development as dialect

from sim_vehicle.geography import Origin, Place
from sim_vehicle.mavlink.streams import streams as module
from sim_vehicle.mavlink.streams.stream_rates import LinkKind
from sim_vehicle.mavlink.streams.streams import KINDS
from sim_vehicle.mavlink.streams.topics import OPTIONAL, Topic
from sim_vehicle.scene import Scene
from sim_vehicle.vehicle import SimulatedVehicle
from tests.sim_vehicle.estimator.flying import filtered
from tests.sim_vehicle.vehicle_client import REQUEST_MESSAGE, SET_INTERVAL, SET_MODE, Client


@pytest.mark.parametrize("kind", [LinkKind.ONBOARD, LinkKind.GROUND])
def test_each_links_set_is_sent_at_its_rates(kind):
    # Without a flow sensor and a range finder
    vehicle = SimulatedVehicle(filtered(changes={"estimate": {"kind": "markov"}}), Scene(), 1)
    link, parser, seconds = vehicle.add_link(kind), dialect.MAVLink(None), 20.0
    counts: Counter[int] = Counter()
    for _ in range(round(seconds * 250)):
        vehicle.advance()
        counts.update(parser.decode(bytearray(raw)).get_msgId() for raw in link.take())
    # GPS_RAW_INT comes with each fix, the origin once; there is no flow sensor and no range finder
    expected = {
        **{stream.message_id: stream.rates.on(kind) for stream in KINDS if stream.rates.on(kind)},
        24: 8.0 if kind is LinkKind.ONBOARD else 5.0,
        49: 1 / seconds,
        42: 1.0,  # MISSION_CURRENT
    }
    expected = {number: rate for number, rate in expected.items() if number not in (106, 132)}
    measured = {number: count / seconds for number, count in counts.items()}
    assert measured == pytest.approx(expected, rel=0.05, abs=1 / seconds)


@pytest.fixture(scope="module")
def hovering() -> Client:
    """A vehicle that has taken off and holds, with everything asked for that is not sent unasked."""
    client = Client(epoch_at_boot_us=10**15)
    client.take_off(14.0)
    return client


@pytest.mark.parametrize(
    "kind", [kind for kind in KINDS if kind.topic not in (*OPTIONAL, Topic.GPS)], ids=lambda kind: kind.message_id
)
def test_every_message_can_be_asked_for(hovering, kind):
    # As on a PX4, what the stream has already sent is denied until there is a new sample
    for _ in range(40):
        hovering.forget()
        hovering.command(REQUEST_MESSAGE, kind.message_id)
        hovering.step()
        if hovering.results(REQUEST_MESSAGE) == [0]:
            break
    kinds = [message.get_type() for _, message in hovering.received]
    assert kinds.index(dialect.mavlink_map[kind.message_id].msgname) < kinds.index("COMMAND_ACK")
    assert kind.message_id != 264 or hovering.last("FLIGHT_INFORMATION").takeoff_time_utc < 14e6


def test_what_a_hovering_vehicle_says_of_itself_and_of_its_place_agrees(hovering):
    local, place = hovering.last("LOCAL_POSITION_NED"), hovering.last("GLOBAL_POSITION_INT")
    home, fix = hovering.last("HOME_POSITION"), hovering.last("GPS_RAW_INT")
    origin = hovering.last("GPS_GLOBAL_ORIGIN")
    to_local = Origin(Place(origin.latitude / 1e7, origin.longitude / 1e7, origin.altitude / 1e3)).position_of
    by_place = to_local(Place(place.lat / 1e7, place.lon / 1e7, place.alt / 1e3))
    assert by_place == pytest.approx((local.x, local.y, local.z), abs=0.05)
    assert to_local(Place(fix.lat / 1e7, fix.lon / 1e7, fix.alt / 1e3)) == pytest.approx(by_place, abs=0.2)
    assert to_local(Place(home.latitude / 1e7, home.longitude / 1e7, home.altitude / 1e3)) == pytest.approx(
        (home.x, home.y, home.z), abs=0.02
    )
    assert place.relative_alt / 1e3 == pytest.approx(home.z - local.z, abs=0.05)
    assert hovering.last("ALTITUDE").altitude_relative == pytest.approx(home.z - local.z, abs=0.05)
    assert hovering.last("VFR_HUD").alt == pytest.approx(place.alt / 1e3, abs=0.05)
    assert (fix.fix_type, fix.satellites_visible) == (3, 10)
    assert 50 < hovering.last("VFR_HUD").throttle < 100
    motors = hovering.last("SERVO_OUTPUT_RAW")
    assert all(1500 < width < 2000 for width in (motors.servo1_raw, motors.servo4_raw))
    assert motors.servo5_raw == 900
    target = hovering.last("ATTITUDE_TARGET")
    assert math.hypot(*target.q) == pytest.approx(1.0) and target.q[0] == pytest.approx(1.0, abs=0.05)
    assert 100 * target.thrust == pytest.approx(hovering.last("VFR_HUD").throttle, abs=10)
    asked = hovering.last("POSITION_TARGET_LOCAL_NED")
    # Every axis is asked for, and the heading; no turning
    assert (asked.coordinate_frame, asked.type_mask) == (1, 0x800)
    assert (asked.x, asked.y, asked.z) == pytest.approx(hovering.position(), abs=0.2) and asked.vz == 0.0
    field = hovering.last("HIGHRES_IMU")
    # The field of Zurich: 0.2 gauss north, 0.43 down; the nose points north
    assert (field.xmag, field.zmag) == (pytest.approx(0.21, abs=0.03), pytest.approx(0.43, abs=0.03))
    assert 950 < field.abs_pressure < 960


def test_magnetometer_and_barometer_are_marked_when_they_are_new():
    client = Client()
    client.run(10.0)
    fields = [message.fields_updated for message in client.all("HIGHRES_IMU")]
    # 15 and 20 times a second against 50
    assert sum(bool(f & 0x1C0) for f in fields) / 10 == pytest.approx(15.6, abs=0.5)
    assert sum(bool(f & 0x1A00) for f in fields) / 10 == pytest.approx(20.8, abs=0.5)


def test_the_battery_drains_in_flight_and_is_full_again_on_the_ground():
    client = Client()
    client.send(dialect.MAVLink_param_set_message(1, 1, b"SIM_BAT_DRAIN", 20.0, 9))
    client.run(3.0)
    at_rest = client.last("BATTERY_STATUS")
    # 20 s would empty it (SIM_BAT_DRAIN), but not below half (SIM_BAT_MIN_PCT)
    client.take_off(16.0)
    late = client.last("BATTERY_STATUS")
    assert at_rest.battery_remaining == 100 and at_rest.charge_state == 1
    assert late.battery_remaining == 50 and late.voltages[0] < at_rest.voltages[0] - 300
    assert client.last("SYS_STATUS").battery_remaining == 50
    client.send(dialect.MAVLink_param_set_message(1, 1, b"BAT1_V_CHARGED", 1e30, 9))
    client.run(2.1)
    assert client.last("SYS_STATUS").voltage_battery == client.last("BATTERY_STATUS").voltages[0] == 65_534


def test_the_world_lies_where_the_parameters_say():
    there = {"SIH_LOC_LAT0": -33.9, "SIH_LOC_LON0": 151.2, "SIH_LOC_H0": 20.0}
    client = Client(parameters=there)
    client.run(2.0)
    for name in ("GLOBAL_POSITION_INT", "GPS_RAW_INT"):
        told = client.last(name)
        assert (told.lat, told.lon) == pytest.approx((-339_000_000, 1_512_000_000), abs=100)
        assert told.alt == pytest.approx(20_000, abs=500)
    assert client.last("ALTITUDE").altitude_monotonic == pytest.approx(20.0, abs=3.0)
    origin = Origin(Place(-32.5, 151.2, 20.0))
    pole = origin.place_at(origin.position_of(Place(90.0, -100.0, 0.0)))
    assert pole.latitude_deg == pytest.approx(90.0) and abs(pole.longitude_deg) <= 180.0


def test_where_a_vehicle_is_how_it_moves_and_turns_is_so_in_every_message():
    # Given a vehicle that flies ahead at 2 m/s in OFFBOARD, and to the left by a third of a radian a second
    circling = Client(system=255, component=190)
    circling.take_off(8.0)

    def ask() -> None:
        fields = (0.0, 0.0, 0.0, 2.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, -1 / 3)
        circling.send(dialect.MAVLink_set_position_target_local_ned_message(0, 1, 1, 8, 0x5C7, *fields))

    circling.run(0.2, ask)
    circling.command(SET_MODE, 1, 6)
    circling.run(20.0, ask)
    # Then the truth is in each message
    x, y, z, vx, vy, vz, qw, qx, qy, qz, p, q, r = circling.vehicle.state.body
    for kind in ("LOCAL_POSITION_NED", "ODOMETRY"):
        told = circling.last(kind)
        assert (told.x, told.y, told.z) == pytest.approx((x, y, z), abs=0.2), kind
        assert (told.vx, told.vy, told.vz) == pytest.approx((vx, vy, vz), abs=0.2), kind
    assert (told.frame_id, told.child_frame_id, told.estimator_type) == (1, 1, 8)
    turned = circling.last("ATTITUDE_QUATERNION")
    alike = qw * turned.q1 + qx * turned.q2 + qy * turned.q3 + qz * turned.q4
    assert abs(alike) == pytest.approx(1.0, abs=1e-3)
    told = circling.last("ATTITUDE")
    yaw_rad = math.atan2(2 * (qw * qz + qx * qy), 1 - 2 * (qy * qy + qz * qz))
    roll_rad, pitch_rad = math.atan2(2 * (qw * qx + qy * qz), 1 - 2 * (qx * qx + qy * qy)), 2 * (qw * qy - qz * qx)
    assert math.remainder(told.yaw - yaw_rad, 2 * math.pi) == pytest.approx(0.0, abs=0.05)
    # It leans inward, which is to the left, by 4 degrees: the left side is down
    assert (told.roll, told.pitch) == pytest.approx((roll_rad, pitch_rad), abs=0.03) and told.roll < -0.04
    assert (told.rollspeed, told.pitchspeed, told.yawspeed) == pytest.approx((p, q, r), abs=0.06)
    assert (turned.rollspeed, turned.pitchspeed, turned.yawspeed) == pytest.approx((p, q, r), abs=0.06)
    felt = circling.last("HIGHRES_IMU")
    assert (felt.xgyro, felt.ygyro, felt.zgyro) == pytest.approx((p, q, r), abs=0.06)
    assert felt.zacc == pytest.approx(-9.8, abs=1.0) and felt.fields_updated & 0x3F == 0x3F
    # It flies at 2 m/s round a circle of 6 m, anticlockwise
    assert math.hypot(vx, vy) == pytest.approx(2.0, abs=0.2) and r == pytest.approx(-1 / 3, abs=0.1)
    for stamp_us in (felt.time_usec, circling.last("ODOMETRY").time_usec, 1000 * told.time_boot_ms):
        assert circling.time_s - 1e-6 * stamp_us < 0.05


def test_a_vehicle_with_a_filter_says_how_sure_it_is_of_itself():
    # Given a vehicle that sees the ground pass, and nothing that stays
    client = Client(airframe=filtered())
    client.run(3.0)
    stands = client.last("ODOMETRY")
    client.take_off(30.0)
    flies, body = client.last("ODOMETRY"), client.vehicle.state.body
    # Then it is less and less sure of its place, and rightly so; of its speed and its tilt it stays as sure
    assert flies.pose_covariance[0] > 20 * stands.pose_covariance[0] > 0.0
    assert math.dist((flies.x, flies.y), body[:2]) < 3 * math.sqrt(2 * flies.pose_covariance[0])
    assert math.dist((flies.vx, flies.vy), body[3:5]) < 3 * math.sqrt(2 * flies.velocity_covariance[0]) < 0.2
    assert 0.0 < flies.pose_covariance[15] < 0.01**2 and flies.velocity_covariance[0] > stands.velocity_covariance[0]


NUMBERS = {"HIGHRES_IMU": 105, "ATTITUDE_QUATERNION": 31, "ODOMETRY": 331, "LOCAL_POSITION_NED": 32}
ACCEPTED, FAILED = 0, 4


def asked(message_id: int, interval_us: float) -> tuple[Client, list[int]]:
    """A vehicle that stands still and was asked for a message a second ago, and its answer."""
    client = Client()
    client.command(SET_INTERVAL, message_id, interval_us)
    client.run(1.0)
    return client, client.results(SET_INTERVAL)


@pytest.mark.parametrize(
    ("kind", "asked_hz", "received_hz", "gaps"),
    [
        ("HIGHRES_IMU", 250, 250, {4}),
        ("HIGHRES_IMU", 200, 125, {8}),
        ("HIGHRES_IMU", 100, 100, {8, 12}),
        ("HIGHRES_IMU", 50, 50, {20}),
        ("ATTITUDE_QUATERNION", 250, 250, {4}),
        ("ODOMETRY", 100, 100, {8, 12}),
        ("ODOMETRY", 250, 125, {8}),
        ("LOCAL_POSITION_NED", 250, 125, {8}),
        ("LOCAL_POSITION_NED", 50, 50, {20}),
    ],
)
def test_asked_and_received(monkeypatch, kind, asked_hz, received_hz, gaps):
    # Given a link of which no loop comes too late
    monkeypatch.setattr(module, "MISSED_LOOPS_SHARE", 0.0)
    client, _ = asked(NUMBERS[kind], 1e6 / asked_hz)
    assert client.rate_hz(kind, 8.0) == pytest.approx(received_hz, rel=0.005)
    assert {round(1e3 * (b - a)) for a, b in pairwise(client.times(kind))} == gaps


def test_an_imu_sample_as_measured_is_that_of_highres_imu_in_thousandths_of_g():
    # Given both at the vehicle's fastest
    client, answers = asked(26, 4_000)
    assert answers == [ACCEPTED]
    client.command(SET_INTERVAL, NUMBERS["HIGHRES_IMU"], 4_000)
    client.run(1.0)
    told = {each.time_usec // 1000: each for each in client.all("HIGHRES_IMU")}
    same = [(told[each.time_boot_ms], each) for each in client.all("SCALED_IMU") if each.time_boot_ms in told]
    # Then of each sample no more is cut off than a whole number loses
    assert len(same) > 100
    for one, other in same:
        for axis in "xyz":
            assert abs(getattr(one, f"{axis}acc") / 9.80665e-3 - getattr(other, f"{axis}acc")) < 1.001
            assert abs(getattr(one, f"{axis}gyro") / 1e-3 - getattr(other, f"{axis}gyro")) < 1.001


def told_interval_us(client: Client, message_id: int) -> int:
    """By both commands that ask for it."""
    client.forget()
    for command, params in ((510, (message_id,)), (REQUEST_MESSAGE, (244, message_id))):
        client.command(command, *params)
        client.run(0.02)
        assert client.results(command) == [ACCEPTED]
    first, second = client.all("MESSAGE_INTERVAL")
    assert first.message_id == second.message_id == message_id & 0xFFFF and first.interval_us == second.interval_us
    return first.interval_us


# GPS_RAW_INT comes whenever there is a fix, 9999 never; an interval longer than 32 bits hold is the longest
@pytest.mark.parametrize(("message_id", "asked_us", "told_us"), [
    (105, 0, 20_000), (31, 10_000, 10_000), (24, 0, -1), (9999, 0, -1), (30, 5e11, 2**31 - 1),
])  # fmt: skip
def test_the_interval_is_told(message_id, asked_us, told_us):
    assert told_interval_us(asked(message_id, asked_us)[0], message_id) == told_us


def test_minus_one_stops_and_zero_restores():
    client, _ = asked(105, -1)
    assert client.rate_hz("HIGHRES_IMU", 2.0) == 0
    assert told_interval_us(client, 105) == -1
    client.command(SET_INTERVAL, 105, 0)
    assert client.rate_hz("HIGHRES_IMU", 5.0) == pytest.approx(50, rel=0.02)
    # What is not streamed by default is stopped by 0
    client, _ = asked(148, 500_000)
    assert client.rate_hz("AUTOPILOT_VERSION", 5.0) == pytest.approx(2, abs=0.2)
    client.command(SET_INTERVAL, 148, 0)
    client.run(0.1)
    assert client.rate_hz("AUTOPILOT_VERSION", 2.0) == 0


def test_current_mode_comes_on_a_change_and_twice_a_second_at_most_otherwise():
    # Given CURRENT_MODE asked for at 50 Hz
    client, _ = asked(436, 20_000)
    assert client.rate_hz("CURRENT_MODE", 10.0) == pytest.approx(2.0, abs=0.1)
    # When the mode changes
    client.forget()
    client.command(SET_MODE, 1, 6)
    client.run(0.02)
    # Then it says so at once
    (told,) = client.all("CURRENT_MODE")
    assert told.custom_mode == told.intended_custom_mode == 0x00060000
