"""The samples that arrive dozens of times a second, straight from their payloads.

The packets' layout is pymavlink's own; only its message objects are left out, which take most of the time.
"""

from collections.abc import Callable
from operator import attrgetter, itemgetter
from typing import Any

from pymavlink.dialects.v20 import development as dialect

from companion.messages import (
    ANGULAR_VELOCITY_RAD_S,
    POSITION_M,
    SPECIFIC_FORCE_M_S2,
    TIME_US,
    VELOCITY_M_S,
    ZERO_G_OFFSET_M_S2,
    Attitude,
    ImuSample,
    LocalPosition,
    Odometry,
    Refused,
    Sample,
    is_rotation,
    within,
)

# HIGHRES_UPDATED_FLAGS: the accelerometer's three axes.
ACCELEROMETER_UPDATED = 0x7


def _imu(
    time_us: int, x: float, y: float, z: float, p: float, q: float, r: float, updated: int
) -> ImuSample | Refused | None:
    if updated & ACCELEROMETER_UPDATED != ACCELEROMETER_UPDATED:
        return None
    if within(ZERO_G_OFFSET_M_S2, x, y, z):
        return Refused("HIGHRES_IMU", "the accelerometer reads zero on all axes")
    if not (within(SPECIFIC_FORCE_M_S2, x, y, z) and within(ANGULAR_VELOCITY_RAD_S, p, q, r) and time_us < TIME_US):
        text = f"specific force {x:g} {y:g} {z:g} m/s^2, rates {p:g} {q:g} {r:g} rad/s at {time_us} us"
        return Refused("HIGHRES_IMU", text)
    return ImuSample(time_us, (x, y, z), (p, q, r))


def _local_position(
    time_ms: int, x: float, y: float, z: float, vx: float, vy: float, vz: float
) -> LocalPosition | Refused:
    if not (within(POSITION_M, x, y, z) and within(VELOCITY_M_S, vx, vy, vz)):
        return Refused("LOCAL_POSITION_NED", _motion_text(x, y, z, vx, vy, vz))
    return LocalPosition(time_ms * 1000, (x, y, z), (vx, vy, vz))


def _attitude(time_ms: int, w: float, x: float, y: float, z: float, p: float, q: float, r: float) -> Attitude | Refused:
    if not (is_rotation(w, x, y, z) and within(ANGULAR_VELOCITY_RAD_S, p, q, r)):
        text = f"quaternion {w:g} {x:g} {y:g} {z:g}, rates {p:g} {q:g} {r:g} rad/s"
        return Refused("ATTITUDE_QUATERNION", text)
    return Attitude(time_ms * 1000, (w, x, y, z), (p, q, r))


def _odometry(
    time_us: int, frame: int, child: int, x: float, y: float, z: float, vx: float, vy: float, vz: float, resets: int
) -> Odometry | Refused | None:
    # PX4 sends NED velocity under child frame LOCAL_NED; any other frame would have to be turned first.
    if frame != dialect.MAV_FRAME_LOCAL_NED or child != dialect.MAV_FRAME_LOCAL_NED:
        return None
    if not (within(POSITION_M, x, y, z) and within(VELOCITY_M_S, vx, vy, vz) and time_us < TIME_US):
        return Refused("ODOMETRY", _motion_text(x, y, z, vx, vy, vz))
    return Odometry(time_us, (x, y, z), (vx, vy, vz), resets)


def _motion_text(x: float, y: float, z: float, vx: float, vy: float, vz: float) -> str:
    return f"position {x:g} {y:g} {z:g} m, velocity {vx:g} {vy:g} {vz:g} m/s"


class FrequentReader:
    """Of one message: the named fields, handed to whoever makes a sample of them."""

    def __init__(self, message: Any, fields: tuple[str, ...], make: Callable[..., Sample | None]) -> None:
        # One name may stand for several values: q[4].
        places: list[str] = []
        for name, length in zip(message.ordered_fieldnames, message.lengths, strict=True):
            places += [name] * length
        self._pick = itemgetter(*[places.index(name) for name in fields])
        self._unpacker = message.unpacker
        self._make = make
        self._fields = attrgetter(*fields)

    def from_message(self, message: Any) -> Sample | None:
        """Of a message whose fields are its attributes; where a name stands for several values, there is none."""
        return self._make(*self._fields(message))

    def sample(self, payload: bytes) -> Sample | None:
        """MAVLink 2 leaves out the zeros at a payload's end."""
        unpacker = self._unpacker
        return self._make(*self._pick(unpacker.unpack(payload.ljust(unpacker.size, b"\0")[: unpacker.size])))


FREQUENT: dict[int, FrequentReader] = {
    dialect.MAVLINK_MSG_ID_HIGHRES_IMU: FrequentReader(
        dialect.MAVLink_highres_imu_message,
        ("time_usec", "xacc", "yacc", "zacc", "xgyro", "ygyro", "zgyro", "fields_updated"),
        _imu,
    ),
    dialect.MAVLINK_MSG_ID_LOCAL_POSITION_NED: FrequentReader(
        dialect.MAVLink_local_position_ned_message, ("time_boot_ms", "x", "y", "z", "vx", "vy", "vz"), _local_position
    ),
    dialect.MAVLINK_MSG_ID_ATTITUDE_QUATERNION: FrequentReader(
        dialect.MAVLink_attitude_quaternion_message,
        ("time_boot_ms", "q1", "q2", "q3", "q4", "rollspeed", "pitchspeed", "yawspeed"),
        _attitude,
    ),
    dialect.MAVLINK_MSG_ID_ODOMETRY: FrequentReader(
        dialect.MAVLink_odometry_message,
        ("time_usec", "frame_id", "child_frame_id", "x", "y", "z", "vx", "vy", "vz", "reset_counter"),
        _odometry,
    ),
}
