"""Messages of PX4's external simulator to bytes and back.

Source of units, frames and field bits: PX4's simulation/simulator_mavlink/SimulatorMavlink.cpp and .hpp.
"""

import math
from collections.abc import Callable
from typing import Any

from pymavlink.dialects.v20 import development as dialect

from sim_vehicle.autopilot.messages import Identity
from sim_vehicle.estimator.samples import CaptureSample, FlowSample, RangeSample
from sim_vehicle.hil.messages import MOTORS_STOPPED, ActuatorControls, HilGps, HilSensor, ToPx4
from sim_vehicle.mavlink import encode, framing
from sim_vehicle.mavlink.encode import Message
from sim_vehicle.mavlink.streams import aiding

# PX4 reads neither of them.
SIMULATOR = Identity(1, 51)
# What is read of PX4; its greeting (HEARTBEAT, COMMAND_LONG) is dropped.
ANSWERS = (dialect.MAVLINK_MSG_ID_HIL_ACTUATOR_CONTROLS,)

_ARMED_FLAG = 0x80
_LOCKSTEP_FLAG = 0x1
_FIX_3D = 3
_SATELLITES = 16
_BEST_QUALITY = 100
_UNKNOWN_VELOCITY_AND_RATES = (math.nan,) * 6
_NO_COURSE = 65_535
# Below this the course over ground is noise.
_LEAST_SPEED_FOR_COURSE_M_S = 0.1


def filled(message: ToPx4) -> Message:
    """What the message is on the wire."""
    return _FILLED[type(message)](message)


def _sensor(sample: HilSensor) -> Message:
    inertial = (*sample.specific_force_frd_m_s2, *sample.angular_velocity_frd_rad_s)
    field, air = sample.magnetic_field_frd_gauss, sample.air
    fields = encode.INERTIAL_FIELDS | (0 if field is None else encode.MAGNETIC_FIELDS)
    fields |= 0 if air is None else encode.AIR_FIELDS
    slow = (*(field or (0.0, 0.0, 0.0)), *encode.air_fields(air))
    return framing.HIL_SENSOR, framing.HIL_SENSOR.pack(sample.time_us, *inertial, *slow, fields, 0)


def _gps(fix: HilGps) -> Message:
    north, east, down = fix.velocity_ned_m_s
    speed_m_s = math.hypot(north, east)
    course_cdeg = _NO_COURSE
    if speed_m_s >= _LEAST_SPEED_FOR_COURSE_M_S:
        course_cdeg = round(100 * math.degrees(math.atan2(east, north))) % 36_000
    accuracy_cm = max(1, round(100 * fix.accuracy_m))
    return dialect.MAVLink_hil_gps_message(
        fix.time_us,
        _FIX_3D,
        *encode.units_of(fix.place),
        accuracy_cm,
        accuracy_cm,
        round(100 * speed_m_s),
        round(100 * north),
        round(100 * east),
        round(100 * down),
        course_cdeg,
        _SATELLITES,
    )


def _motion_capture(seen: CaptureSample) -> Message:
    return dialect.MAVLink_odometry_message(
        seen.time_us,
        dialect.MAV_FRAME_LOCAL_NED,
        dialect.MAV_FRAME_LOCAL_NED,
        *seen.position_ned_m,
        list(seen.attitude_wxyz),
        *_UNKNOWN_VELOCITY_AND_RATES,
        encode.diagonal_covariance(seen.noise_m**2, seen.noise_rad**2),
        encode.diagonal_covariance(math.nan, math.nan),
        0,
        # As MOCAP it would go to a topic that EKF2 does not read.
        dialect.MAV_ESTIMATOR_TYPE_VISION,
        _BEST_QUALITY,
    )


_FILLED: dict[type[Any], Callable[[Any], Message]] = {
    HilSensor: _sensor,
    HilGps: _gps,
    CaptureSample: _motion_capture,
    FlowSample: aiding.hil_optical_flow,
    RangeSample: aiding.distance_looking_down,
}


def answered(message: Message) -> ActuatorControls:
    """PX4's answer as a value."""
    motors = message.controls[: len(MOTORS_STOPPED)]
    return ActuatorControls(
        time_us=message.time_usec,
        armed=bool(message.mode & _ARMED_FLAG),
        is_lockstep=bool(message.flags & _LOCKSTEP_FLAG),
        motor_fractions=tuple(value if math.isfinite(value) else 0.0 for value in motors),
    )
