"""Keep-out half-spaces: touched surfaces, remembered surfaces, and the fence with its floor and ceiling."""

import math
from collections.abc import Sequence
from dataclasses import dataclass

from companion.fence import Fence
from companion.messages import Vector3
from companion.reflex.config import BEHIND_M, FACING_COSINE, ROUNDS, STEEP
from companion.reflex.normal import unit


def away_from(normal_ned: Vector3) -> Vector3:
    """Unit normal out of the obstacle: horizontal unless it is steeper than STEEP; zero for a zero vector."""
    n, e, d = normal_ned
    return unit((n, e, d if abs(d) > STEEP * math.hypot(n, e, d) else 0.0))


def split(vector: Vector3, normal: Vector3) -> tuple[float, Vector3]:
    """The component of a vector along a unit normal, and the vector without it."""
    (u, v, w), (a, b, c) = vector, normal
    along = u * a + v * b + w * c
    return along, (u - along * a, v - along * b, w - along * c)


def plus(vector: Vector3, factor: float, direction: Vector3) -> Vector3:
    """vector + factor * direction."""
    return (
        vector[0] + factor * direction[0],
        vector[1] + factor * direction[1],
        vector[2] + factor * direction[2],
    )


def limited(vector: Vector3, most: float) -> Vector3:
    """The vector, no longer than that."""
    size = math.hypot(*vector)
    return vector if size <= most else plus((0.0, 0.0, 0.0), most / size, vector)


@dataclass(frozen=True, slots=True)
class Surface:
    """A keep-out half-space: the vehicle's centre when it touched, the unit normal out of it, the clearance."""

    point_ned_m: Vector3
    normal_ned: Vector3
    distance_m: float

    def off_m(self, place_ned_m: Vector3) -> float:
        """Distance of a position from touching, m; negative behind the surface."""
        return split(plus(place_ned_m, -1.0, self.point_ned_m), self.normal_ned)[0]


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


def clear_goal(
    surfaces: Sequence[Surface], contact_ned_m: Vector3, normal_ned: Vector3, goal_ned_m: Vector3
) -> Vector3:
    """The goal, clear of each surface by its distance; between facing surfaces by at most half of the room."""
    for surface in list(surfaces) * ROUNDS:
        wanted_m, room_m = surface.distance_m, surface.off_m(contact_ned_m)
        if split(normal_ned, surface.normal_ned)[0] < FACING_COSINE:
            wanted_m = min(wanted_m, 0.5 * max(0.0, room_m))
        short_m = wanted_m - surface.off_m(goal_ned_m)
        if room_m >= -BEHIND_M and short_m > 0.0:
            goal_ned_m = plus(goal_ned_m, short_m, surface.normal_ned)
    return goal_ned_m
