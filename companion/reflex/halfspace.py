"""Keep-out half-spaces: touched surfaces and remembered ones."""

import math
from collections.abc import Sequence
from dataclasses import dataclass

from companion.messages import Vector3
from companion.motion.vector import along, plus, unit
from companion.reflex.config import ROUNDS, STEEP


def away_from(normal_ned: Vector3) -> Vector3:
    """Unit normal out of the obstacle: horizontal unless it is steeper than STEEP; zero for a zero vector."""
    n, e, d = normal_ned
    return unit((n, e, d if abs(d) > STEEP * math.hypot(n, e, d) else 0.0))


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
        (n, e, d), (a, b, c), (x, y, z) = place_ned_m, self.normal_ned, self.point_ned_m
        return (n - x) * a + (e - y) * b + (d - z) * c


def projected(vector: Vector3, sides: Sequence[tuple[Vector3, float]]) -> Vector3:
    """The vector, moved by as little as gives it so much along each unit normal at least.

    Of places, velocities and accelerations alike. It converges in a few rounds, or between facing surfaces never.
    """
    for _ in range(ROUNDS):
        before = vector
        for normal, least in sides:
            short = least - along(vector, normal)
            if short > 0.0:
                vector = plus(vector, short, normal)
        if vector is before:
            break
    return vector
