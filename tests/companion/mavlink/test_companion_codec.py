"""MAVLink bytes to samples and commands to bytes, against pymavlink's own packing and parsing."""

import copy
import functools
import inspect
import math
import struct

import pytest
from pymavlink.dialects.v20 import development as mav

from companion import messages as ours
from companion.mavlink.decode import WRAP_US, Decoder
from companion.mavlink.encode import Encoder
from companion.mavlink.packet import payload_of
from companion.mavlink.readers import GUARD_READERS, Reader
from tests.filled import example

HEARTBEAT = (
    mav.MAVLink_heartbeat_message(2, 12, 0x9D, 4 << 16 | 3 << 24, 4, 3),
    ours.Heartbeat(1, 1, 2, 12, True, 0x03040000, 4),
)
CASES = [
    HEARTBEAT,
    (
        mav.MAVLink_highres_imu_message(123_456_789, 1.0, -2.0, -9.5, 0.5, 0.25, -0.5, 0, 0, 0, 0, 0, 0, 0, 0x3F),
        ours.ImuSample(123_456_789, (1.0, -2.0, -9.5), (0.5, 0.25, -0.5)),
    ),
    (
        mav.MAVLink_local_position_ned_message(5000, 1.0, 2.0, -3.0, 0.5, -0.5, 0.25),
        ours.LocalPosition(5_000_000, (1.0, 2.0, -3.0), (0.5, -0.5, 0.25)),
    ),
    (
        mav.MAVLink_attitude_quaternion_message(5000, 0.5, 0.5, -0.5, 0.5, 0.25, 0.5, -1.0),
        ours.Attitude(5_000_000, (0.5, 0.5, -0.5, 0.5), (0.25, 0.5, -1.0)),
    ),
    (
        # PX4's way: local NED in both frames, the resets counted
        mav.MAVLink_odometry_message(
            5_000_123, 1, 1, 1.0, 2.0, -3.0, [1, 0, 0, 0], 0.5, -0.5, 0.25, 0, 0, 0, [0] * 21, [0] * 21, 7
        ),
        ours.Odometry(5_000_123, (1.0, 2.0, -3.0), (0.5, -0.5, 0.25), 7),
    ),
    (
        mav.MAVLink_attitude_target_message(5000, 0, (0.5, 0.5, -0.5, 0.5), 0, 0, 0, 0.75),
        ours.AttitudeTarget(5_000_000, 0.75, (0.5, 0.5, -0.5, 0.5)),
    ),
    (
        mav.MAVLink_attitude_target_message(5000, 128, (1, 0, 0, 0), 0, 0, 0, 0.75),
        ours.AttitudeTarget(5_000_000, 0.75, None),
    ),
    (mav.MAVLink_vibration_message(5_000_000, 0.0, 0.125, 2.5, 12, 0, 3), ours.Vibration(15)),
    (mav.MAVLink_extended_sys_state_message(0, 2), ours.ExtendedState(ours.LandedState.IN_AIR)),
    (mav.MAVLink_current_mode_message(0, 6 << 16, 3 << 16), ours.CurrentMode(6 << 16, 3 << 16)),
    (mav.MAVLink_current_mode_message(0, 6 << 16, 0), ours.CurrentMode(6 << 16, None)),
    (
        mav.MAVLink_command_ack_message(400, 1, 0, 0, 1, 191),
        ours.CommandAck(400, ours.CommandResult.TEMPORARILY_REJECTED),
    ),
    (mav.MAVLink_timesync_message(0, 777), ours.TimeSync(777)),
    (mav.MAVLink_timesync_message(5, 777), ours.TimeSync(777, 5)),
    (mav.MAVLink_param_value_message(b"COM_OF_LOSS_T", 0.5, 9, 900, 12), ours.Parameter("COM_OF_LOSS_T", 0.5)),
    # The bytes of a whole number travel in the float's place
    (
        mav.MAVLink_param_value_message(b"IMU_INTEG_RATE", struct.unpack("<f", struct.pack("<i", 250))[0], 6, 900, 13),
        ours.Parameter("IMU_INTEG_RATE", 250),
    ),
    (
        mav.MAVLink_estimator_status_message(0, 2, 0.25, 0.5, 0.75, 0, 0, 0, 0, 0),
        ours.EstimatorStatus((0.25, 0.5, 0.75), True, False),
    ),
    # By motion capture no sensor measures the velocity, and PX4 says NaN
    (
        mav.MAVLink_estimator_status_message(0, 2, math.nan, 0.5, 0.75, 0, 0, 0, 0, 0),
        ours.EstimatorStatus((0.5, 0.75), True, False),
    ),
    (
        mav.MAVLink_autopilot_version_message(0, 0x010F02FF, 0, 0, 0, [0] * 8, [0] * 8, [0] * 8, 0, 0, 0),
        ours.AutopilotVersion((1, 15, 2)),
    ),
    (mav.MAVLink_sys_status_message(0, 0, 0, 300, 15_000, 900, 42, 0, 0, 0, 0, 0, 0), ours.Battery(42)),
    # What a terminal would obey is left out, PX4's closing tab, too
    (mav.MAVLink_statustext_message(4, b"Preflight Fail: \x1b[2J\t"), ours.StatusText(4, "Preflight Fail: [2J")),
]


# Nothing is made of these: body velocity without its attitude, a thrust that is not given, answers to others, values
# that are not measured.
NOT_TAKEN = [
    mav.MAVLink_odometry_message(5, 1, 12, 1, 2, 3, [1, 0, 0, 0], 1, 1, 1, 0, 0, 0, [0] * 21, [0] * 21, 7),
    mav.MAVLink_attitude_target_message(5000, 64, (1, 0, 0, 0), 0, 0, 0, 0.75),
    mav.MAVLink_command_ack_message(400, 0, 0, 0, 255, 190),
    mav.MAVLink_command_ack_message(400, 0, 0, 0, 255, 191),
    mav.MAVLink_command_ack_message(400, 0, 0, 0, 255, 0),
    mav.MAVLink_highres_imu_message(1, 1, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0x38),
    mav.MAVLink_sys_status_message(0, 0, 0, 300, 15_000, 900, 101, 0, 0, 0, 0, 0, 0),
    mav.MAVLink_statustext_message(6, b"Takeoff detected"),
    mav.MAVLink_param_value_message(b"MPC_XY_P", math.nan, mav.MAV_PARAM_TYPE_REAL32, 1, 0),
]


def packed(message, system=1, component=1, v1=False) -> bytes:
    return bytes(message.pack(mav.MAVLink(None, system, component), force_mavlink1=v1))


def listening_decoder() -> Decoder:
    decoder = Decoder()
    decoder.listen_to(1, 1)
    return decoder


def heard(message):
    return listening_decoder().feed(packed(message))[0][1]


@pytest.mark.parametrize("message", NOT_TAKEN)
def test_what_would_be_misread_is_not_taken(message):
    assert heard(message) is None


def test_millisecond_stamps_go_on_where_their_32_bits_wrap():
    """After 49.7 days of uptime HIGHRES_IMU's microseconds go on and time_boot_ms begins again."""
    wrap_ms = 1 << 32
    imu = mav.MAVLink_highres_imu_message((wrap_ms + 5) * 1000, 0, 0, -9.8, *[0] * 10, 0x3F)
    before = mav.MAVLink_local_position_ned_message(wrap_ms - 3, 1, 2, 3, 0, 0, 0)
    after = mav.MAVLink_local_position_ned_message(2, 1, 2, 3, 0, 0, 0)
    attitude = mav.MAVLink_attitude_quaternion_message(4, 1, 0, 0, 0, 0, 0, 0)
    frames = listening_decoder().feed(packed(imu) + packed(before) + packed(after) + packed(attitude))
    assert [sample.time_boot_us // 1000 - wrap_ms for _, sample in frames] == [5, -3, 2, 4]


def test_after_a_reboot_of_a_vehicle_that_was_up_for_a_month_stamps_are_as_they_come():
    """The first position comes before the first HIGHRES_IMU; it lies in no later wrap of the boot before."""
    imu = mav.MAVLink_highres_imu_message(30 * 86_400_000_000, 0, 0, -9.8, *[0] * 10, 0x3F)
    rebooted = mav.MAVLink_local_position_ned_message(2_500, 1, 2, 3, 0, 0, 0)
    frames = listening_decoder().feed(packed(imu) + packed(rebooted))
    assert frames[1][1].time_boot_us == 2_500_000


@pytest.mark.parametrize(("chunk", "v1"), [(1, False), (7, False), (100_000, False), (7, True)])
def test_every_sample_is_decoded_in_any_chunking_and_in_mavlink_1_too(chunk, v1):
    stream = b"".join(packed(message, v1=v1 and message.get_msgId() < 256) for message, _ in CASES)
    decoder = listening_decoder()
    frames = [f for i in range(0, len(stream), chunk) for f in decoder.feed(stream[i : i + chunk])]
    assert [sample for _, sample in frames] == [sample for _, sample in CASES]
    assert b"".join(frame for frame, _ in frames) == stream


@pytest.mark.parametrize(
    "junk", [b"\x00\x01\x02", b"\xfd", b"\xfe\x09\x00", b"\xfd\x09\x00\x00\x00\x01", b"\xfd\xff\x02"]
)
def test_bad_bytes_cost_no_good_packet_and_none_is_lost(junk):
    good = b"".join(packed(message) for message, _ in CASES)
    decoder = listening_decoder()
    frames = decoder.feed(good + junk + good)
    assert [s for _, s in frames if s is not None] == [s for _, s in CASES] * 2
    assert b"".join(frame for frame, _ in frames) == good + junk + good


def test_only_heartbeats_are_heard_before_the_vehicle_is_known_and_only_the_vehicle_afterwards():
    imu = CASES[1][0]
    decoder = Decoder()
    assert decoder.feed(packed(imu))[0][1] is None
    assert decoder.feed(packed(HEARTBEAT[0]))[0][1] == HEARTBEAT[1]
    decoder.listen_to(1, 1)
    assert decoder.feed(packed(imu, 1, 1))[0][1] is not None
    assert decoder.feed(packed(imu, 2, 1))[0][1] is None
    assert decoder.feed(packed(HEARTBEAT[0], 1, 190))[0][1] is None


# All three axes at the end of the widest range among PX4's drivers: 40 g and 4000 deg/s.
FORCE, RATE = math.sqrt(3.0) * 40 * 9.80665, math.sqrt(3.0) * math.radians(4000)
# Message, the fields that must be finite and bounded, and the largest value that PX4 can mean by them.
MEASURED = [
    ("HIGHRES_IMU", ("xacc", "yacc", "zacc"), FORCE),
    ("HIGHRES_IMU", ("xgyro", "ygyro", "zgyro"), RATE),
    ("LOCAL_POSITION_NED", ("x", "y", "z"), 1e6),
    ("LOCAL_POSITION_NED", ("vx", "vy", "vz"), 100.0),
    ("ODOMETRY", ("x", "y", "z"), 1e6),
    ("ODOMETRY", ("vx", "vy", "vz"), 100.0),
    ("ATTITUDE_QUATERNION", ("rollspeed", "pitchspeed", "yawspeed"), RATE),
    ("ATTITUDE_TARGET", ("thrust",), math.sqrt(3.0)),
]
BROKEN = (math.nan, math.inf, -math.inf, 3e38, -3e38)


def measured(name):
    return next(message for message, sample in CASES if message.get_type() == name)


@pytest.mark.parametrize(("name", "fields", "most"), MEASURED)
def test_a_value_that_no_vehicle_can_have_is_refused_and_the_greatest_it_can_have_is_not(name, fields, most):
    for field in fields:
        message = copy.copy(measured(name))
        setattr(message, field, 0.99 * most)
        assert not isinstance(heard(message), ours.Refused | None), field
        for value in (*BROKEN, -1.6 * most, 1.6 * most):
            setattr(message, field, value)
            refused = heard(message)
            assert isinstance(refused, ours.Refused) and refused.message == name, (field, value)


@pytest.mark.parametrize("field", ["q1", "q2", "q3", "q4"])
def test_what_is_no_rotation_is_refused_and_one_to_a_thousandth_of_its_squared_length_is_not(field):
    for value, is_believed in (
        *((value, False) for value in (*BROKEN, 1e20, 2.0, 0.0)),
        *((math.sqrt(square), 0.999 < square < 1.001) for square in (1.0009, 0.9991, 1.0011, 0.9989)),
    ):
        message = copy.copy(measured("ATTITUDE_QUATERNION"))
        message.q1 = message.q2 = message.q3 = message.q4 = 0.0
        setattr(message, field, value)
        assert isinstance(heard(message), ours.Refused) is not is_believed, value


@pytest.mark.parametrize(("force_m_s2", "is_off"), [(0.0, True), (0.75, True), (-0.75, True), (0.82, False)])
def test_an_accelerometer_that_shows_no_more_than_its_zero_g_offset_is_off(force_m_s2, is_off):
    # The widest among PX4's drivers: 80 mg, 0.785 m/s^2
    message = copy.copy(measured("HIGHRES_IMU"))
    message.xacc, message.yacc, message.zacc = force_m_s2, 0.0, 0.0
    assert isinstance(heard(message), ours.Refused) is is_off


def test_a_stamp_that_is_not_exact_in_double_precision_is_refused():
    for name in ("HIGHRES_IMU", "ODOMETRY"):
        message = copy.copy(measured(name))
        message.time_usec = 1 << 63
        assert isinstance(heard(message), ours.Refused), name


def sent(outgoing):
    encoder = Encoder()
    encoder.speak_to(7, 1)
    return mav.MAVLink(None).decode(bytearray(encoder.packets(outgoing)[0]))


@pytest.mark.parametrize(
    ("velocity", "acceleration", "yaw", "mask"),
    [
        ((0.5, 0.0, -0.5), (0.0, 2.0, 0.0), 1.0, 0x800),
        ((0.5, 0.0, -0.5), None, 1.0, 0x9C0),
        (None, None, 1.0, 0x9F8),
        (None, None, None, 0xDF8),
        ((0.0, 0.0, 1.0), None, None, 0xDC0),
    ],
)
def test_setpoint_masks_are_px4s(velocity, acceleration, yaw, mask):
    m = sent(ours.PositionSetpoint(WRAP_US + 2_000_000, (1.0, 2.0, -3.0), yaw, velocity, acceleration))
    assert (m.type_mask, m.coordinate_frame, m.target_system, m.target_component) == (mask, 1, 7, 1)
    assert (m.x, m.y, m.z, m.time_boot_ms) == (1.0, 2.0, -3.0, 2000)
    assert (m.afx, m.afy, m.afz) == acceleration if acceleration else math.isnan(m.afx)
    assert math.isnan(m.yaw_rate)
    assert (m.vx, m.vy, m.vz) == velocity if velocity else math.isnan(m.vx)
    assert m.yaw == yaw if yaw is not None else math.isnan(m.yaw)


@pytest.mark.parametrize("kept", [0, 1, 3, 100])
@pytest.mark.parametrize("reader", GUARD_READERS.values(), ids=lambda reader: reader.name)
def test_each_reader_picks_the_fields_that_pymavlink_reads(reader, kept):
    """Zeros at the end of a payload, which are not sent, included."""
    # Given a message whose fields are zero but for the first on the wire
    number = mav.__dict__[f"MAVLINK_MSG_ID_{reader.name}"]
    packet = packed(example(number, kept))
    # When it is read
    seen = []
    make = functools.wraps(reader._make)(lambda *fields: seen.append(fields))
    Reader(mav.mavlink_map[number], make).from_payload(payload_of(packet), (1, 1))
    # Then the fields are those that pymavlink's own parser finds
    theirs, (fields,) = mav.MAVLink(None).decode(bytearray(packet)), seen
    names = list(inspect.signature(reader._make).parameters)
    for name, value in zip(names, fields, strict=True):
        if name == "source":
            assert value == (1, 1)
        elif isinstance(value, bytes):
            assert value.rstrip(b"\0").decode() == getattr(theirs, name)
        else:
            assert value == (tuple(found) if isinstance(found := getattr(theirs, name), list) else found), name


@pytest.mark.parametrize(
    ("outgoing", "fields"),
    [
        (ours.OnboardHeartbeat(True), {"type": 18, "autopilot": 8}),
        (ours.TimeSync(777, 12345), {"ts1": 777, "tc1": 12345}),
        # Our own question is told from an answer by its zero
        (ours.TimeSync(12345), {"ts1": 12345, "tc1": 0}),
        (ours.ReadParameter("COM_OF_LOSS_T"), {"target_system": 7, "param_id": "COM_OF_LOSS_T", "param_index": -1}),
        (ours.NamedValue(1_500_000, "rb_thresh", 4.25), {"name": "rb_thresh", "value": 4.25, "time_boot_ms": 1500}),
        (
            ours.NamedValue(1_500_000, "rb_v_c", (2.0, -1.0, 0.5)),
            {"name": "rb_v_c", "x": 2.0, "y": -1.0, "z": 0.5, "time_usec": 1_500_000},
        ),
        # An attitude leaves the rates of roll and pitch to the vehicle
        (
            ours.AttitudeSetpoint(WRAP_US + 2_000_000, (0.5, 0.5, -0.5, 0.5), 0.625, 1.5),
            {"type_mask": 0x03, "target_system": 7, "target_component": 1, "time_boot_ms": 2000}
            | {"q": [0.5, 0.5, -0.5, 0.5], "thrust": 0.625, "body_yaw_rate": 1.5},
        ),
    ],
    ids=lambda value: type(value).__name__,
)
def test_what_is_sent_is_an_onboard_computers_of_the_vehicles_system(outgoing, fields):
    m = sent(outgoing)
    assert (m.get_srcSystem(), m.get_srcComponent()) == (7, 191)
    assert {name: getattr(m, name) for name in fields} == fields


@pytest.mark.parametrize(("value", "kind"), [(0.5, 9), (4, 6), (-1, 6)])
def test_a_parameter_is_set_with_its_type_and_bytes(value, kind):
    m = sent(ours.Parameter("COM_OBL_RC_ACT", value))
    assert (m.target_system, m.param_id, m.param_type) == (7, "COM_OBL_RC_ACT", kind)
    assert struct.pack("<f", m.param_value) == struct.pack("<f" if kind == 9 else "<i", value)


@pytest.mark.parametrize("minor", [15, 16, None])
def test_the_throttle_of_older_px4s_goes_from_minus_a_thousand_on(minor):
    decoder, link = Decoder(GUARD_READERS), mav.MAVLink(None, 1, 1)
    decoder.listen_to(1, 1)

    def throttles(*values):
        told = [mav.MAVLink_manual_control_message(1, 0, 0, value, 0, 0) for value in values]
        return [sample.deflections[2] for each in told for _, sample in decoder.feed(each.pack(link))]

    if minor is not None:
        version = mav.MAVLink_autopilot_version_message(
            0, 1 << 24 | minor << 16, 0, 0, 0, [0] * 8, [0] * 8, [0] * 8, 0, 0, 0
        )
        decoder.feed(version.pack(link))
    # Where no version is known one below zero tells
    assert throttles(500) == [0.5 if minor == 15 else 0.0]
    assert minor == 16 or throttles(-1000, 0, 1000) == [-1.0, 0.0, 1.0]
