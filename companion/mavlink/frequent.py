"""The samples that arrive dozens of times a second, straight from their payloads.

The packets' layout is pymavlink's own; only its message objects are left out, which take most of the time.
"""

import math
from collections.abc import Callable
from operator import attrgetter, itemgetter
from typing import Any

from pymavlink.dialects.v20 import development as dialect

from companion.messages import Attitude, ImuSample, LocalPosition, Odometry, Sample

# HIGHRES_UPDATED_FLAGS: the accelerometer's three axes.
ACCELEROMETER_UPDATED = 0x7


def finite(*values: float) -> bool:
    """False when any value is NaN or infinite (either makes the sum so)."""
    return math.isfinite(sum(values))


def _imu(time_us: int, x: float, y: float, z: float, p: float, q: float, r: float, updated: int) -> ImuSample | None:
    if updated & ACCELEROMETER_UPDATED != ACCELEROMETER_UPDATED or not finite(x, y, z):
        return None
    return ImuSample(time_us, (x, y, z), (p, q, r))


def _local_position(
    time_ms: int, x: float, y: float, z: float, vx: float, vy: float, vz: float
) -> LocalPosition | None:
    return LocalPosition(time_ms * 1000, (x, y, z), (vx, vy, vz)) if finite(x, y, z, vx, vy, vz) else None


def _attitude(time_ms: int, w: float, x: float, y: float, z: float, p: float, q: float, r: float) -> Attitude | None:
    if not finite(w, x, y, z):
        return None
    return Attitude(time_ms * 1000, (w, x, y, z), (p, q, r) if finite(p, q, r) else None)


def _odometry(
    time_us: int, frame: int, child: int, x: float, y: float, z: float, vx: float, vy: float, vz: float, resets: int
) -> Odometry | None:
    # PX4 sends NED velocity under child frame LOCAL_NED; any other frame would have to be turned first.
    in_ned = frame == dialect.MAV_FRAME_LOCAL_NED and child == dialect.MAV_FRAME_LOCAL_NED
    if not in_ned or not finite(x, y, z, vx, vy, vz):
        return None
    return Odometry(time_us, (x, y, z), (vx, vy, vz), resets)


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
