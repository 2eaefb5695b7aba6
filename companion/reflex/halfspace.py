"""Keep-out half-spaces: touched surfaces, remembered surfaces, and the fence with its floor and ceiling."""

import math
from collections.abc import Sequence
from dataclasses import dataclass

from companion.fence import Fence
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


def inside_fence(fence: Fence, origin_ned_m: Vector3, contact_ned_m: Vector3, setpoint_ned_m: Vector3) -> Vector3:
    """The setpoint inside a fence at that origin: where the line from the contact leaves it; local NED, metres.

    For a contact outside the fence it is the nearest position inside.
    """
    (start_n, start_e, _), (end_n, end_e, end_d) = (
        plus(place, -1.0, origin_ned_m) for place in (contact_ned_m, setpoint_ned_m)
    )
    n, e = fence.nearest_inside(end_n, end_e)
    if fence.contains(start_n, start_e):
        n, e = fence.shortened((start_n, start_e), (end_n, end_e))
    return plus((n, e, min(max(end_d, -fence.max_height_m), -fence.min_height_m)), 1.0, origin_ned_m)


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
