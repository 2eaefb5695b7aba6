"""What the autopilot knows of itself: the part of the plant's output that is not truth."""

import math
from typing import Protocol

Vector3 = tuple[float, float, float]
Quaternion = tuple[float, float, float, float]


class Estimate(Protocol):
    """One inertial sample and the state estimated at its time. World NED, body FRD, SI units."""

    @property
    def time_boot_us(self) -> int: ...
    @property
    def specific_force_frd_m_s2(self) -> Vector3: ...
    @property
    def angular_velocity_frd_rad_s(self) -> Vector3: ...
    @property
    def clipping_counts(self) -> tuple[int, int, int]: ...
    @property
    def position_ned_m(self) -> Vector3: ...
    @property
    def velocity_ned_m_s(self) -> Vector3: ...
    @property
    def attitude_wxyz(self) -> Quaternion: ...
    @property
    def thrust_fraction(self) -> float: ...
    @property
    def motor_fractions(self) -> Quaternion: ...
    @property
    def reset_counter(self) -> int: ...


def yaw_of(attitude_wxyz: Quaternion) -> float:
    """Heading of the nose from north, radians, clockwise from above."""
    w, x, y, z = attitude_wxyz
    return math.atan2(2 * (w * z + x * y), 1 - 2 * (y * y + z * z))


def roll_pitch_of(attitude_wxyz: Quaternion) -> tuple[float, float]:
    """Both lean angles in radians."""
    w, x, y, z = attitude_wxyz
    roll = math.atan2(2 * (w * x + y * z), 1 - 2 * (x * x + y * y))
    return roll, math.asin(min(max(2 * (w * y - z * x), -1.0), 1.0))
