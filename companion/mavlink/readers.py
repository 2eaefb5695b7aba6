"""MAVLink messages to typed samples: one function a message, whose parameters are the fields that it reads.

The layout is pymavlink's own; its message objects, which take most of the time, are left out. A vector with NaN or
infinity in it has a length that is within no limit.
"""

import math
import re
import struct
from collections.abc import Callable, Mapping
from inspect import signature
from math import hypot
from operator import itemgetter
from typing import Any

from pymavlink.dialects.v20 import development as dialect

from companion import messages
from companion.mavlink.encode import COMPONENT_ID, IGNORE_POSITION
from companion.messages import Refused, Sample, Vector3, is_rotation

# HIGHRES_UPDATED_FLAGS: the accelerometer's three axes.
ACCELEROMETER_UPDATED = 0x7
# POSITION_TARGET_TYPEMASK: the vertical velocity.
DESCENT_IGNORED = 0x20


class Reader:
    """Of one message: the fields that a function names, handed over to it; before them who sent it, where it asks."""

    def __init__(self, message: Any, make: Callable[..., Sample | None]) -> None:
        names = list(signature(make).parameters)
        self._takes_source = names[0] == "source"
        self._names = names[self._takes_source :]
        # The fields that are not named are passed over. One name may stand for several values: q[4].
        places, count, layout = dict[str, int | slice](), 0, "<"
        parts = re.findall(r"\d*[a-zA-Z]", message.unpacker.format)
        for name, length, part in zip(message.ordered_fieldnames, message.lengths, parts, strict=True):
            if name not in self._names:
                layout += f"{struct.calcsize('<' + part)}x"
                continue
            layout += part
            places[name] = count if length == 1 else slice(count, count + length)
            count += length
        picked = [places[name] for name in self._names]
        self._pick = None if picked == list(range(count)) else itemgetter(*picked)
        self._unpacker, self._make, self.name = struct.Struct(layout), make, str(message.msgname)

    def from_payload(self, payload: bytes, source: tuple[int, int]) -> Sample | None:
        """MAVLink 2 leaves out the zeros at a payload's end."""
        unpacker = self._unpacker
        fields = unpacker.unpack(payload.ljust(unpacker.size, b"\0")[: unpacker.size])
        if self._pick is not None:
            fields = self._pick(fields)
        return self._make(source, *fields) if self._takes_source else self._make(*fields)


def _imu(
    time_usec: int, xacc: float, yacc: float, zacc: float, xgyro: float, ygyro: float, zgyro: float, fields_updated: int
) -> Sample | None:
    if fields_updated & ACCELEROMETER_UPDATED != ACCELEROMETER_UPDATED:
        return None
    force, rates = (xacc, yacc, zacc), (xgyro, ygyro, zgyro)
    force_m_s2 = hypot(xacc, yacc, zacc)
    if force_m_s2 <= messages.ZERO_G_OFFSET_M_S2:
        return Refused("HIGHRES_IMU", "the accelerometer reads zero on all axes")
    if not (
        force_m_s2 <= messages.SPECIFIC_FORCE_M_S2
        and hypot(xgyro, ygyro, zgyro) <= messages.ANGULAR_VELOCITY_RAD_S
        and time_usec < messages.TIME_US
    ):
        text = f"specific force {_text(*force)} m/s^2, rates {_text(*rates)} rad/s at {time_usec} us"
        return Refused("HIGHRES_IMU", text)
    return messages.ImuSample(time_usec, force, rates)


# What RAW_IMU and SCALED_IMU count in, SI: thousandths of standard gravity, and of a radian a second.
_MILLI_G_M_S2, _MILLI_RAD_S = 9.80665e-3, 1e-3


def _in_si(xacc: int, yacc: int, zacc: int, xgyro: int, ygyro: int, zgyro: int) -> tuple[Vector3, Vector3]:
    """Specific force and rates."""
    force = (_MILLI_G_M_S2 * xacc, _MILLI_G_M_S2 * yacc, _MILLI_G_M_S2 * zacc)
    return force, (_MILLI_RAD_S * xgyro, _MILLI_RAD_S * ygyro, _MILLI_RAD_S * zgyro)


def _raw_imu(time_usec: int, xacc: int, yacc: int, zacc: int, xgyro: int, ygyro: int, zgyro: int) -> Sample | None:
    """As ArduPilot has it: the same samples as in HIGHRES_IMU, rounded."""
    force, rates = _in_si(xacc, yacc, zacc, xgyro, ygyro, zgyro)
    return _imu(time_usec, *force, *rates, ACCELEROMETER_UPDATED)


def _scaled_imu(time_boot_ms: int, xacc: int, yacc: int, zacc: int, xgyro: int, ygyro: int, zgyro: int) -> Sample:
    return messages.ScaledImu(time_boot_ms * 1000, *_in_si(xacc, yacc, zacc, xgyro, ygyro, zgyro))


def _local_position(time_boot_ms: int, x: float, y: float, z: float, vx: float, vy: float, vz: float) -> Sample:
    if not (hypot(x, y, z) <= messages.POSITION_M and hypot(vx, vy, vz) <= messages.VELOCITY_M_S):
        return _moves_too_far("LOCAL_POSITION_NED", x, y, z, vx, vy, vz)
    return messages.LocalPosition(time_boot_ms * 1000, (x, y, z), (vx, vy, vz))


def _attitude(
    time_boot_ms: int, q1: float, q2: float, q3: float, q4: float, rollspeed: float, pitchspeed: float, yawspeed: float
) -> Sample:
    turn, rates = (q1, q2, q3, q4), (rollspeed, pitchspeed, yawspeed)
    if not (is_rotation(*turn) and hypot(*rates) <= messages.ANGULAR_VELOCITY_RAD_S):
        return Refused("ATTITUDE_QUATERNION", f"quaternion {_text(*turn)}, rates {_text(*rates)} rad/s")
    return messages.Attitude(time_boot_ms * 1000, turn, rates)


def _odometry(
    time_usec: int,
    frame_id: int,
    child_frame_id: int,
    x: float,
    y: float,
    z: float,
    vx: float,
    vy: float,
    vz: float,
    reset_counter: int,
) -> Sample | None:
    # PX4 sends NED velocity under child frame LOCAL_NED; any other frame would have to be turned first.
    if frame_id != dialect.MAV_FRAME_LOCAL_NED or child_frame_id != dialect.MAV_FRAME_LOCAL_NED:
        return None
    is_near = hypot(x, y, z) <= messages.POSITION_M and hypot(vx, vy, vz) <= messages.VELOCITY_M_S
    if not is_near or time_usec >= messages.TIME_US:
        return _moves_too_far("ODOMETRY", x, y, z, vx, vy, vz)
    return messages.Odometry(time_usec, (x, y, z), (vx, vy, vz), reset_counter)


def _moves_too_far(message: str, *motion: float) -> Refused:
    return Refused(message, f"position {_text(*motion[:3])} m, velocity {_text(*motion[3:])} m/s")


def _text(*values: float) -> str:
    return " ".join(f"{value:g}" for value in values)


# GPS_FIX_TYPE of a place in three dimensions; a speed or a course that is not known.
FIX_3D, UNKNOWN = 3, 0xFFFF


def _gps_raw(fix_type: int, lat: int, lon: int, alt: int, vel: int, cog: int) -> Sample | None:
    if fix_type < FIX_3D or UNKNOWN in (vel, cog):
        return None
    speed_m_s, course_rad = 0.01 * vel, math.radians(0.01 * cog)
    if speed_m_s > messages.VELOCITY_M_S:
        return Refused("GPS_RAW_INT", f"speed {speed_m_s:g} m/s")
    velocity_ne_m_s = (speed_m_s * math.cos(course_rad), speed_m_s * math.sin(course_rad))
    return messages.GpsFix(velocity_ne_m_s, 1e-7 * lat, 1e-7 * lon, 1e-3 * alt)


def _heartbeat(
    source: tuple[int, int], type: int, autopilot: int, base_mode: int, custom_mode: int, system_status: int
) -> Sample:
    armed = bool(base_mode & dialect.MAV_MODE_FLAG_SAFETY_ARMED)
    return messages.Heartbeat(*source, type, autopilot, armed, custom_mode, system_status)


def _attitude_target(time_boot_ms: int, type_mask: int, q: tuple[float, ...], thrust: float) -> Sample | None:
    if type_mask & dialect.ATTITUDE_TARGET_TYPEMASK_THROTTLE_IGNORE:
        return None
    # ArduPilot's height control asks for less than none at a landing.
    if not -1.0 <= thrust <= messages.THRUST_FRACTION:
        return Refused("ATTITUDE_TARGET", f"thrust {thrust:g}")
    w, x, y, z = q
    given = not type_mask & dialect.ATTITUDE_TARGET_TYPEMASK_ATTITUDE_IGNORE and is_rotation(w, x, y, z)
    return messages.AttitudeTarget(time_boot_ms * 1000, max(thrust, 0.0), (w, x, y, z) if given else None)


def _vibration(clipping_0: int, clipping_1: int, clipping_2: int) -> Sample:
    return messages.Vibration(clipping_0 + clipping_1 + clipping_2)


# What PX4 shows of an output that drives nothing: no value, or that of a disarmed PWM output.
_UNUSED_OUTPUTS = (0, 900)


def _motor_outputs(
    port: int,
    servo1_raw: int,
    servo2_raw: int,
    servo3_raw: int,
    servo4_raw: int,
    servo5_raw: int,
    servo6_raw: int,
    servo7_raw: int,
    servo8_raw: int,
) -> Sample | None:
    outputs = [servo1_raw, servo2_raw, servo3_raw, servo4_raw, servo5_raw, servo6_raw, servo7_raw, servo8_raw]
    while len(outputs) > 4 and outputs[-1] in _UNUSED_OUTPUTS:
        outputs.pop()
    return messages.MotorOutputs(tuple(outputs)) if port == 0 else None


def _battery(battery_remaining: int) -> Sample | None:
    # -1: the autopilot does not know.
    return messages.Battery(battery_remaining) if 0 <= battery_remaining <= 100 else None


def _extended_state(landed_state: int) -> Sample | None:
    known = landed_state in messages.LandedState.__members__.values()
    return messages.ExtendedState(messages.LandedState(landed_state)) if known else None


def _current_mode(custom_mode: int, intended_custom_mode: int) -> Sample:
    # 0 stands for "not known" in the intended mode.
    return messages.CurrentMode(custom_mode, intended_custom_mode or None)


def _command_ack(
    source: tuple[int, int], command: int, result: int, target_system: int, target_component: int
) -> Sample | None:
    # PX4 names whom it answers, as others ask on the same link. The companion is of the vehicle's system.
    ours = target_system in (0, source[0]) and target_component in (0, COMPONENT_ID)
    known = result in messages.CommandResult.__members__.values()
    return messages.CommandAck(command, messages.CommandResult(result)) if ours and known else None


def _timesync(tc1: int, ts1: int) -> Sample:
    return messages.TimeSync(ts1, tc1 or None)


def _parameter(param_id: bytes, param_value: float, param_type: int) -> Sample | None:
    name = param_id.split(b"\0", 1)[0].decode("ascii", errors="replace")
    # PX4 has two kinds; the bytes of a whole number travel in the float's place.
    if param_type == dialect.MAV_PARAM_TYPE_INT32:
        return messages.Parameter(name, struct.unpack("<i", struct.pack("<f", param_value))[0])
    is_real = param_type == dialect.MAV_PARAM_TYPE_REAL32 and math.isfinite(param_value)
    return messages.Parameter(name, param_value) if is_real else None


def _estimator_status(flags: int, vel_ratio: float, pos_horiz_ratio: float, pos_vert_ratio: float) -> Sample:
    ratios = (vel_ratio, pos_horiz_ratio, pos_vert_ratio)
    if any(map(math.isinf, ratios)):
        return Refused("ESTIMATOR_STATUS", f"ratios {_text(*ratios)}")
    return messages.EstimatorStatus(
        # NaN is PX4's word for what no sensor measures: the velocity, by motion capture.
        tuple(ratio for ratio in ratios if not math.isnan(ratio)),
        bool(flags & dialect.ESTIMATOR_VELOCITY_HORIZ),
        bool(flags & dialect.ESTIMATOR_ACCEL_ERROR),
    )


class EkfStatusReport:
    """ArduPilot's message of that name, which is in none of the dialects that PX4 speaks."""

    id, msgname = messages.MessageId.EKF_STATUS_REPORT, "EKF_STATUS_REPORT"
    unpacker = struct.Struct("<fffffHf")
    ordered_fieldnames = (
        *("velocity_variance", "pos_horiz_variance", "pos_vert_variance", "compass_variance", "terrain_alt_variance"),
        *("flags", "airspeed_variance"),
    )
    lengths = (1,) * len(ordered_fieldnames)


# EKF_STATUS_FLAGS.
EKF_VELOCITY_HORIZ = 1 << 1


def _ekf_status(flags: int, velocity_variance: float, pos_horiz_variance: float, pos_vert_variance: float) -> Sample:
    """Ratios, too, in spite of their names: at 1 the sensor is turned down."""
    ratios = (velocity_variance, pos_horiz_variance, pos_vert_variance)
    if not all(map(math.isfinite, ratios)):
        return Refused(EkfStatusReport.msgname, f"ratios {_text(*ratios)}")
    return messages.EstimatorStatus(ratios, bool(flags & EKF_VELOCITY_HORIZ), False)


def _cast_parameter(param_id: bytes, param_value: float, param_type: int) -> Sample | None:
    name = param_id.split(b"\0", 1)[0].decode("ascii", errors="replace")
    if not math.isfinite(param_value):
        return None
    is_real = param_type == dialect.MAV_PARAM_TYPE_REAL32
    return messages.Parameter(name, param_value if is_real else int(param_value))


# A pulse of a remote control, microseconds: its middle and the way to either end.
_MIDDLE_US, _WAY_US = 1500, 500
# One that is not connected has none, or all bits.
_NO_PULSES = (0, 0xFFFF)


def _radio(chan1_raw: int, chan2_raw: int, chan3_raw: int, chan4_raw: int) -> Sample | None:
    """The pilot's sticks as ArduPilot has them by default: roll, pitch, throttle, yaw. Forward is the short pulse."""
    pulses = (chan1_raw, chan2_raw, chan3_raw, chan4_raw)
    if any(pulse in _NO_PULSES for pulse in pulses):
        return None
    right, back, up, clockwise = (min(max((pulse - _MIDDLE_US) / _WAY_US, -1.0), 1.0) for pulse in pulses)
    return messages.Sticks((-back, right, up, clockwise))


def _vehicle_text(severity: int, text: bytes) -> Sample | None:
    said = "".join(filter(str.isprintable, text.decode("utf-8", errors="replace")))
    return messages.StatusText(severity, said) if said and severity <= messages.Severity.WARNING else None


def _autopilot_version(flight_sw_version: int) -> Sample:
    major, minor, patch, _type = flight_sw_version.to_bytes(4, "big")
    return messages.AutopilotVersion((major, minor, patch))


def _position_target(type_mask: int, x: float, y: float, z: float, vz: float) -> Sample:
    known = not type_mask & IGNORE_POSITION and hypot(x, y, z) <= messages.POSITION_M
    is_speed = not type_mask & DESCENT_IGNORED and abs(vz) <= messages.VELOCITY_M_S
    return messages.PositionTarget((x, y, z) if known else None, vz if is_speed else None)


def _sticks(x: int, y: int, z: int, r: int) -> Sample:
    # The throttle goes from 0 to 1000 (PX4's streams/MANUAL_CONTROL.hpp), of older ones from -1000 (see decode).
    if max(abs(x), abs(y), abs(z), abs(r)) > 1000:
        return Refused("MANUAL_CONTROL", f"sticks {x} {y} {z} {r}")
    return messages.Sticks((x / 1000.0, y / 1000.0, z / 500.0 - 1.0, r / 1000.0))


def _readers(makers: Mapping[Any, Callable[..., Sample | None]]) -> dict[int, Reader]:
    return {message.id: Reader(message, make) for message, make in makers.items()}


READERS = _readers(
    {
        dialect.MAVLink_highres_imu_message: _imu,
        dialect.MAVLink_local_position_ned_message: _local_position,
        dialect.MAVLink_attitude_quaternion_message: _attitude,
        dialect.MAVLink_odometry_message: _odometry,
        dialect.MAVLink_gps_raw_int_message: _gps_raw,
        dialect.MAVLink_scaled_imu_message: _scaled_imu,
        dialect.MAVLink_heartbeat_message: _heartbeat,
        dialect.MAVLink_attitude_target_message: _attitude_target,
        dialect.MAVLink_vibration_message: _vibration,
        dialect.MAVLink_servo_output_raw_message: _motor_outputs,
        dialect.MAVLink_sys_status_message: _battery,
        dialect.MAVLink_extended_sys_state_message: _extended_state,
        dialect.MAVLink_current_mode_message: _current_mode,
        dialect.MAVLink_command_ack_message: _command_ack,
        dialect.MAVLink_timesync_message: _timesync,
        dialect.MAVLink_param_value_message: _parameter,
        dialect.MAVLink_estimator_status_message: _estimator_status,
        dialect.MAVLink_autopilot_version_message: _autopilot_version,
        dialect.MAVLink_statustext_message: _vehicle_text,
    }
)
# What only a guard looks at: another's setpoints and the pilot's hands.
GUARD_READERS = READERS | _readers(
    {
        dialect.MAVLink_position_target_local_ned_message: _position_target,
        dialect.MAVLink_manual_control_message: _sticks,
    }
)

# Beside them, or in their place: of ArduPilot.
ARDUPILOT_READERS = _readers(
    {
        dialect.MAVLink_param_value_message: _cast_parameter,
        EkfStatusReport: _ekf_status,
        dialect.MAVLink_rc_channels_message: _radio,
        dialect.MAVLink_raw_imu_message: _raw_imu,
    }
)
