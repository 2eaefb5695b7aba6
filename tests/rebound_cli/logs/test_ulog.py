"""PX4's logs (docs.px4.io, ULog File Format), made small: each topic of each version, and what is missing."""

import struct

import pytest

from companion import messages
from companion.autopilot.px4.modes import AUTO_LAND, OFFBOARD
from companion.messages import Attitude, ImuSample, LandedState, LocalPosition, Odometry, PositionTarget
from rebound_cli.logs.log import LogError
from rebound_cli.logs.reader import read_log

_MAGIC = b"ULog\x01\x12\x35\x01"
_FLAG_BITS_SIZE = 40
# A value's type in the file, and how it is packed.
_KINDS = {bool: ("bool", "?"), int: ("uint64_t", "Q"), float: ("float", "f")}


def ulog(topics, started_us=0, info=None, parameters=()):
    """Topics: name -> ("field field ...", [(timestamp_us, value, ...), ...]).

    A field's type is that of its first value. Keys of `info` begin with the value's type.
    """
    parts = [_MAGIC, struct.pack("<Q", started_us), _message("B", bytes(_FLAG_BITS_SIZE))]
    parts += (_keyed("I", key, value) for key, value in (info or {}).items())
    parts += (_keyed("P", f"float {key}", struct.pack("<f", value)) for key, value in parameters)
    added, data = [], []
    for number, (topic, (names, rows)) in enumerate((name, rows) for name, rows in topics.items() if rows[1]):
        firsts = [_several(value) for value in rows[0][1:]]
        kinds = [(len(first), *_KINDS.get(type(first[0]), _KINDS[float])) for first in firsts]
        fields = [
            f"{kind}{f'[{n}]' if n > 1 else ''} {name};"
            for name, (n, kind, _) in zip(names.split(), kinds, strict=True)
        ]
        parts.append(_message("F", f"{topic}:uint64_t timestamp;{''.join(fields)}".encode()))
        added.append(_message("A", struct.pack("<BH", 0, number) + topic.encode()))
        packer = struct.Struct("<HQ" + "".join(f"{n}{letter}" for n, _, letter in kinds))
        for time_us, *values in rows:
            flat = [one for value in values for one in _several(value)]
            data.append((time_us, _message("D", packer.pack(number, time_us, *flat))))
    return b"".join([*parts, *added, *(message for _, message in sorted(data, key=lambda row: row[0]))])


def _several(value):
    return value if isinstance(value, list | tuple) else (value,)


def _keyed(kind, key, value):
    return _message(kind, bytes([len(key)]) + key.encode() + value)


def _message(kind, content):
    return struct.pack("<HB", len(content), ord(kind)) + content


def sensor_combined(times_us, force=lambda time_us: (0.0, 0.0, -9.8), clipped=()):
    fields = "gyro_rad accelerometer_m_s2 accelerometer_integral_dt accelerometer_clipping"
    return fields, [(t, (0.1, 0.2, 0.3), force(t), 5000, int(t in clipped)) for t in times_us]


def every(interval_us, start_us, end_us):
    return range(start_us, end_us, interval_us)


START = 1_000_000
IMU = {"sensor_combined": sensor_combined(every(5000, START, START + 500_000))}
PATH = "x y z vx vy vz"
RESETS = "xy_reset_counter z_reset_counter vxy_reset_counter vz_reset_counter"
POSITION = f"{PATH} v_xy_valid v_z_valid {RESETS}"


def read(tmp_path, imu=IMU, info=None, parameters=(), **topics):
    path = tmp_path / "flight.ulg"
    path.write_bytes(ulog({**imu, **topics}, START, info, parameters))
    return read_log(path)


def of(log, kind):
    return [heard.sample for heard in log.heard if isinstance(heard.sample, kind)]


def test_sensor_combined_is_the_mean_over_the_interval_that_ends_at_its_time(tmp_path):
    log = read(tmp_path, {"sensor_combined": sensor_combined([START, START + 5000], clipped=[START + 5000])})
    first, second = of(log, ImuSample)
    assert (first.time_boot_us, second.time_boot_us) == (START, START + 5000)
    assert first.specific_force_frd_m_s2 == pytest.approx((0.0, 0.0, -9.8), abs=1e-6)
    assert first.angular_velocity_frd_rad_s == pytest.approx((0.1, 0.2, 0.3), abs=1e-6)
    assert log.clipped_at_us == (START + 5000,)


def test_vehicle_imu_is_increments_over_the_time_they_took(tmp_path):
    # Given a log of vehicle_imu at full rate, as a logging profile for high rates has it, and sensor_combined beside it
    fields = "timestamp_sample delta_angle delta_velocity delta_angle_dt delta_velocity_dt delta_velocity_clipping"
    pushes = [(t, 0.01) for t in every(5000, START, START + 50_000)] + [(START + 50_000, 6e14)]  # the last damaged
    rows = [(t + 700, t, (0.0005, 0.0, 0.0), (push, 0.0, -0.049), 2500, 5000, 0) for t, push in pushes]
    slow = sensor_combined(every(20_000, START, START + 50_000))
    log = read(tmp_path, {"vehicle_imu": (fields, rows), "sensor_combined": slow})
    # Then the faster one is taken: force = velocity / time, rate = angle / time, stamped with the sample's time
    samples = of(log, ImuSample)
    assert len(samples) == 10 and samples[0].time_boot_us == START
    assert samples[0].specific_force_frd_m_s2 == pytest.approx((2.0, 0.0, -9.8), abs=1e-5)
    assert samples[0].angular_velocity_frd_rad_s == pytest.approx((0.2, 0.0, 0.0), abs=1e-6)
    assert log.heard[0].at_us == START + 700


def test_the_estimators_bias_is_taken_off_as_highres_imu_does(tmp_path):
    # Given a bias of 0.5 m/s^2 that the estimator finds at 0.1 s
    bias = ("accel_device_id accel_bias gyro_bias", [(START + 100_000, 7, (0.5, 0.0, 0.0), (0.0, 0.0, 0.1))])
    log = read(tmp_path, estimator_sensor_bias=bias)
    forces = [sample.specific_force_frd_m_s2[0] for sample in of(log, ImuSample)]
    assert forces[19:21] == pytest.approx([0.0, -0.5], abs=1e-6)


def test_a_position_is_both_messages_of_the_wire_with_the_jumps_counted(tmp_path):
    row = (START + 123_456, 1.0, 2.0, -3.0, 0.1, 0.2, 0.3, True, True, 1, 2, 3, 255)
    log = read(tmp_path, vehicle_local_position=(POSITION, [row]))
    (position,) = of(log, LocalPosition)
    # LOCAL_POSITION_NED's stamp is cut to milliseconds, ODOMETRY's is not
    assert position.time_boot_us == START + 123_000
    assert position.position_ned_m == (1.0, 2.0, -3.0)
    assert position.velocity_ned_m_s == pytest.approx((0.1, 0.2, 0.3), abs=1e-6)
    (odometry,) = of(log, Odometry)
    assert (odometry.time_boot_us, odometry.reset_counter) == (START + 123_456, (1 + 2 + 3 + 255) % 256)


def test_attitude_and_thrust(tmp_path):
    level, unknown = (1.0, 0.0, 0.0, 0.0), (float("nan"),) * 4
    asked = [(START + 20, level, (0.0, 0.0, -0.6)), (START + 30, unknown, (0.3, 0.0, -0.4))]
    log = read(
        tmp_path,
        vehicle_attitude=("q", [(START + 10, level)]),
        vehicle_attitude_setpoint=("q_d thrust_body", asked),
    )
    assert of(log, Attitude)[0].attitude_wxyz == level
    whole, without_attitude = of(log, messages.AttitudeTarget)
    assert (whole.thrust_fraction, without_attitude.thrust_fraction) == pytest.approx((0.6, 0.5))
    assert whole.attitude_wxyz is not None and without_attitude.attitude_wxyz is None


def test_mode_arming_and_failsafe_become_heartbeats(tmp_path):
    fields = "nav_state arming_state failsafe"
    rows = [(START, 14, 1, False), (START + 10, 14, 2, False), (START + 20, 18, 2, True)]
    beats = of(read(tmp_path, vehicle_status=(fields, rows)), messages.Heartbeat)
    seen = [(beat.custom_mode, beat.armed, beat.system_status) for beat in beats]
    assert seen == [(OFFBOARD, False, 3), (OFFBOARD, True, 4), (AUTO_LAND, True, 5)]


@pytest.mark.parametrize(
    ("status", "parameters", "kind"),
    [
        ({"system_type": 1}, (), 1),
        ({"vehicle_type": 2}, (), 1),
        ({"vehicle_type": 3}, (), 10),
        ({"system_type": 2, "vehicle_type": 1, "is_vtol": 1}, (), 19),
        ({"arming_state": 2}, [("MAV_TYPE", 1.0)], 1),
    ],
)
def test_a_log_of_no_multicopter_is_refused_with_its_type(tmp_path, status, parameters, kind):
    # vehicle_status.vehicle_type: 1 rotary wing, 2 fixed wing, 3 rover
    topic = (" ".join(status), [(START, *status.values())])
    with pytest.raises(LogError, match=f"is not a multicopter .MAV_TYPE {kind}."):
        read(tmp_path, vehicle_status=topic, parameters=parameters)


def test_landed_state_is_what_px4_would_send(tmp_path):
    automatic = [(START, False), (START + 30, True), (START + 70, False)]
    log = read(
        tmp_path,
        vehicle_land_detected=("landed", [(START, True), (START + 10, False), (START + 90, True)]),
        vehicle_control_mode=("flag_control_auto_enabled", automatic),
        position_setpoint_triplet=("current.valid current.type", [(START + 20, True, 3), (START + 50, True, 4)]),
    )
    # A take-off or landing setpoint counts only while an automatic mode flies
    heard = [heard for heard in log.heard if isinstance(heard.sample, messages.ExtendedState)]
    states = {one.at_us - START: one.sample.landed_state for one in heard}
    assert states == {
        0: LandedState.ON_GROUND,
        10: LandedState.IN_AIR,
        20: LandedState.IN_AIR,
        30: LandedState.TAKEOFF,
        50: LandedState.LANDING,
        70: LandedState.IN_AIR,
        90: LandedState.ON_GROUND,
    }


@pytest.mark.parametrize(
    ("fields", "row"),
    [
        # since v1.13
        ("position velocity", ((1.0, 2.0, 3.0), (float("nan"),) * 2 + (0.5,))),
        # before
        (PATH, (1.0, 2.0, 3.0, float("nan"), float("nan"), 0.5)),
    ],
)
def test_what_was_asked_for_in_the_words_of_two_versions(tmp_path, fields, row):
    log = read(tmp_path, trajectory_setpoint=(fields, [(START + 5, *row)]))
    assert of(log, PositionTarget) == [PositionTarget((1.0, 2.0, 3.0), 0.5)]


def test_the_vehicle_is_named(tmp_path):
    info = {"uint32_t ver_sw_release": struct.pack("<I", 0x010C03FF), "char[12] ver_hw": b"PX4_FMU_V5XX"}
    assert read(tmp_path, info=info).vehicle == "PX4 1.12.3 on PX4_FMU_V5XX"


def test_what_is_missing_is_said_with_its_cost(tmp_path):
    late = ("q", [(START + 2_000_000, (1.0, 0.0, 0.0, 0.0))])
    log = read(tmp_path, vehicle_attitude=late)
    said = "\n".join(log.losses)
    assert "no vehicle_local_position: height and velocity are not known" in said
    assert "no vehicle_attitude before 2.0 s" in said
    assert "no vehicle_status: armed or not" in said


def test_a_log_without_inertial_samples_is_one_sentence(tmp_path):
    with pytest.raises(LogError, match=r"flight\.ulg: neither sensor_combined nor vehicle_imu"):
        read(tmp_path, {"vehicle_attitude": ("q", [(START, (1.0, 0.0, 0.0, 0.0))])})
