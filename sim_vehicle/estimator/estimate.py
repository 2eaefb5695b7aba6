"""What the vehicle's own software may know of itself at the end of an interval."""

import math
from typing import NamedTuple

from sim_vehicle.quantities import Quaternion, Vector3


class Estimate(NamedTuple):
    """One inertial sample and the state estimated at its time. World NED, body FRD, SI units.

    A tuple: one is made every 4 ms.
    """

    time_boot_us: int
    specific_force_frd_m_s2: Vector3
    """Mean over the interval of the raw samples, each clipped first."""
    angular_velocity_frd_rad_s: Vector3
    clipping_counts: tuple[int, int, int]
    """Clipped raw samples per axis since boot."""
    position_ned_m: Vector3
    velocity_ned_m_s: Vector3
    acceleration_ned_m_s2: Vector3
    attitude_wxyz: Quaternion
    thrust_fraction: float
    """Commanded collective thrust over the greatest."""
    motor_fractions: tuple[float, ...]
    """Thrust commanded of each motor over its greatest, in motor order."""
    reset_counter: int = 0
    """How often the estimator has let its position or velocity jump."""


def yaw_of(attitude_wxyz: Quaternion) -> float:
    """Heading of the nose from north, radians, clockwise from above."""
    w, x, y, z = attitude_wxyz
    return math.atan2(2 * (w * z + x * y), 1 - 2 * (y * y + z * z))


def to_ned(attitude_wxyz: Quaternion, vector_frd: Vector3) -> Vector3:
    """A vector of the body's in NED."""
    w, x, y, z = attitude_wxyz
    forward, right, down = vector_frd
    return (
        (1 - 2 * (y * y + z * z)) * forward + 2 * (x * y - w * z) * right + 2 * (x * z + w * y) * down,
        2 * (x * y + w * z) * forward + (1 - 2 * (x * x + z * z)) * right + 2 * (y * z - w * x) * down,
        2 * (x * z - w * y) * forward + 2 * (y * z + w * x) * right + (1 - 2 * (x * x + y * y)) * down,
    )


def level_to_north_east(forward: float, right: float, yaw_rad: float) -> tuple[float, float]:
    """A level vector ahead and to the right of a heading."""
    cos, sin = math.cos(yaw_rad), math.sin(yaw_rad)
    return cos * forward - sin * right, sin * forward + cos * right


def roll_pitch_of(attitude_wxyz: Quaternion) -> tuple[float, float]:
    """Both lean angles in radians."""
    w, x, y, z = attitude_wxyz
    roll = math.atan2(2 * (w * x + y * z), 1 - 2 * (x * x + y * y))
    return roll, math.asin(min(max(2 * (w * y - z * x), -1.0), 1.0))
