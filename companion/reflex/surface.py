"""Surfaces: an obstacle's normal by a hit, and the half-space that a vehicle keeps out of.

The contact's impulse leans by friction, and by clipping of each axis by itself. Where clipping cannot be seen, the
direction that the vehicle came from takes its place. The change of the velocity contains the whole contact, and is
known the better the motion after it is. The normal is the mean of both, weighted by the inverse of each variance.
"""

import math
from collections.abc import Sequence
from dataclasses import dataclass

from companion.messages import Vector3
from companion.motion.config import SAME_M_S
from companion.motion.vector import ZERO, along, minus, plus, split, unit
from companion.reflex import config as reflex


@dataclass(frozen=True, slots=True)
class Normal:
    """Unit vector out of the obstacle, NED, and its standard deviation, rad; zero and `UNKNOWN_RAD` if unknown."""

    direction_ned: Vector3 = ZERO
    error_rad: float = reflex.UNKNOWN_RAD

    def with_direction(self, vector_ned: Vector3, error_rad: float) -> "Normal":
        """The normal after another vector of that direction; a zero or an unknown one changes nothing."""
        other = unit(vector_ned)
        if other == ZERO or error_rad == math.inf:
            return self
        was, more = 0.0 if self.direction_ned == ZERO else self.error_rad**-2, error_rad**-2
        n, e, d = (was * a + more * b for a, b in zip(self.direction_ned, other, strict=True))
        return Normal(unit((n, e, d)), (was + more) ** -0.5)


def normal_of(impulse_ned: Vector3, velocity_ned_m_s: Vector3, is_hidden: bool = False) -> Normal:
    """The normal by the contact's impulse or force; where that shows none, or may be clipped unseen, by the velocity
    before it."""
    normal, (n, e, d) = Normal().with_direction(impulse_ned, reflex.IMPULSE_RAD), velocity_ned_m_s
    is_unclear = is_hidden or normal.direction_ned == ZERO
    if not is_unclear or math.hypot(n, e, d) <= reflex.SLOW_M_S:
        return normal
    back = Normal().with_direction((-n, -e, -d), reflex.APPROACH_RAD)
    return normal if is_from_behind(normal.direction_ned, back.direction_ned) else back


def is_from_behind(pushed_ned: Vector3, back_ned: Vector3) -> bool:
    """Whether a push is along the flight, and not back to where the vehicle came from; unit vectors."""
    return along(pushed_ned, back_ned) < reflex.OPPOSITE_COSINE


def with_change(normal: Normal, before_ned_m_s: Vector3, after_ned_m_s: Vector3, error_m_s: float) -> Normal:
    """The normal with the change of the velocity by the whole contact, which is known to `error_m_s`."""
    change_m_s = minus(after_ned_m_s, before_ned_m_s)
    size_m_s = math.hypot(*change_m_s)
    error_rad = math.hypot(SAME_M_S, error_m_s) / max(size_m_s, 1e-6)
    return normal.with_direction(change_m_s, math.hypot(reflex.CHANGE_RAD, error_rad))


def away_from(normal_ned: Vector3) -> Vector3:
    """Unit normal out of the obstacle, horizontal if that is upright: no steeper than STEEP; zero for a zero vector."""
    n, e, d = normal_ned
    return unit((n, e, d if abs(d) > reflex.STEEP * math.hypot(n, e, d) else 0.0))


@dataclass(frozen=True, slots=True)
class MotionState:
    """Position and velocity, local NED."""

    position_ned_m: Vector3
    velocity_ned_m_s: Vector3


@dataclass(frozen=True, slots=True)
class Contact:
    """The vehicle at the time of contact t_c: x(t_c), v_c, and the obstacle's outward normal; NED, SI.

    The normal is horizontal, or the obstacle's own where that is steep (see away_from); zero: not known.
    """

    position_ned_m: Vector3
    velocity_ned_m_s: Vector3
    normal_ned: Vector3
    normal_error_rad: float = 0.0
    velocity_error_m_s: float = 0.0  # standard deviation on an axis

    def rebound(self, restitution: float) -> MotionState:
        """The motion after it, as far as that can be known before it has been measured."""
        into_m_s, tangential = split(self.velocity_ned_m_s, self.normal_ned)
        back_m_s = max(into_m_s, -restitution * into_m_s)
        return MotionState(self.position_ned_m, plus(tangential, back_m_s, self.normal_ned))


@dataclass(frozen=True, slots=True)
class Surface:
    """A keep-out half-space: the vehicle's centre when it touched, the unit normal out of it, the clearance."""

    point_ned_m: Vector3
    normal_ned: Vector3
    distance_m: float

    @property
    def level_m(self) -> float:
        """The least component of a clear place along the normal."""
        return along(self.point_ned_m, self.normal_ned) + self.distance_m

    def off_m(self, place_ned_m: Vector3) -> float:
        """Distance of a position from touching, m; negative behind the surface."""
        return along(minus(place_ned_m, self.point_ned_m), self.normal_ned)


def projected(vector: Vector3, sides: Sequence[tuple[Vector3, float]]) -> Vector3:
    """The vector, moved by as little as gives it so much along each unit normal at least.

    Of places, velocities and accelerations alike. It converges in a few rounds, or between facing surfaces never.
    """
    for _ in range(reflex.ROUNDS):
        before = vector
        for normal, least in sides:
            short = least - along(vector, normal)
            if short > 0.0:
                vector = plus(vector, short, normal)
        if vector is before:
            break
    return vector
