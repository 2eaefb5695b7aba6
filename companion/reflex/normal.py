"""The obstacle's unit normal with its standard deviation, from directions that each show it with an error.

The contact's impulse leans by friction, and by clipping of each axis by itself. The direction that the vehicle came
from is free. The change of the velocity contains the whole contact, and is known when the vehicle's own estimate shows
the motion after it. The normal is their mean, weighted by the inverse of each variance.
"""

import math
from dataclasses import dataclass

from companion.messages import Vector3
from companion.motion.vector import ZERO, unit
from companion.reflex.config import (
    APPROACH_M_S,
    APPROACH_RAD,
    CHANGE_M_S,
    CHANGE_RAD,
    FROM_BEHIND,
    IMPULSE_RAD,
    UNKNOWN_RAD,
)


@dataclass(frozen=True, slots=True)
class Normal:
    """Unit vector out of the obstacle, NED, and its standard deviation, rad; zero and `UNKNOWN_RAD` if unknown."""

    direction_ned: Vector3 = ZERO
    error_rad: float = UNKNOWN_RAD

    def with_direction(self, vector_ned: Vector3, error_rad: float) -> "Normal":
        """The normal after another vector of that direction; a zero vector changes nothing."""
        other = unit(vector_ned)
        if other == ZERO:
            return self
        was, more = 0.0 if self.direction_ned == ZERO else self.error_rad**-2, error_rad**-2
        n, e, d = (was * a + more * b for a, b in zip(self.direction_ned, other, strict=True))
        return Normal(unit((n, e, d)), (was + more) ** -0.5)


def normal_of(impulse_ned: Vector3, velocity_ned_m_s: Vector3) -> Normal:
    """The normal by the contact's impulse or force, and by the velocity before it."""
    normal, (n, e, d) = Normal().with_direction(impulse_ned, IMPULSE_RAD), velocity_ned_m_s
    back = unit((-n, -e, -d)) if math.hypot(n, e, d) > APPROACH_M_S else ZERO
    is_behind = sum(a * b for a, b in zip(normal.direction_ned, back, strict=True)) < FROM_BEHIND
    return normal if is_behind else normal.with_direction(back, APPROACH_RAD)


def with_change(normal: Normal, before_ned_m_s: Vector3, after_ned_m_s: Vector3) -> Normal:
    """The normal with the change of the velocity by the whole contact."""
    n, e, d = (after - before for before, after in zip(before_ned_m_s, after_ned_m_s, strict=True))
    size_m_s = math.hypot(n, e, d)
    return normal.with_direction((n, e, d), math.hypot(CHANGE_RAD, CHANGE_M_S / max(size_m_s, 1e-6)))
