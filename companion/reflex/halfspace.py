"""Keep-out half-spaces: touched surfaces, remembered surfaces, and the fence with its floor and ceiling."""

import math
from collections.abc import Sequence
from dataclasses import dataclass

from companion.detection.classify import STEEP
from companion.fence import Fence
from companion.messages import Vector3
from companion.reflex.config import BEHIND_M, FACING_COSINE, ROUNDS


def away_from(normal_ned: Vector3) -> Vector3:
    """Unit normal out of the obstacle: horizontal unless it is steeper than STEEP; zero for a zero vector."""
    n, e, d = normal_ned
    flat, size = math.hypot(n, e), math.sqrt(n * n + e * e + d * d)
    if size == 0.0:
        return (0.0, 0.0, 0.0)
    if abs(d) > STEEP * size:
        return (n / size, e / size, d / size)
    return (n / flat, e / flat, 0.0)


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
        (a, b, c), (x, y, z), (u, v, w) = self.normal_ned, place_ned_m, self.point_ned_m
        return a * (x - u) + b * (y - v) + c * (z - w)


@dataclass(frozen=True, slots=True)
class FenceBounds:
    """The mission's fence, placed at the arming position; local NED, metres."""

    origin_ned_m: Vector3
    fence: Fence

    def clamp(self, contact_ned_m: Vector3, setpoint_ned_m: Vector3) -> Vector3:
        """Shorten the line from the contact to the setpoint so that it ends inside the fence.

        For a contact outside the fence the setpoint is the nearest position inside.
        """
        north_m, east_m, down_m = self.origin_ned_m
        start = (contact_ned_m[0] - north_m, contact_ned_m[1] - east_m)
        end = (setpoint_ned_m[0] - north_m, setpoint_ned_m[1] - east_m)
        end = self.fence.shortened(start, end) if self.fence.contains(*start) else self.fence.nearest_inside(*end)
        top_m, floor_m = down_m - self.fence.max_height_m, down_m - self.fence.min_height_m
        return (north_m + end[0], east_m + end[1], min(max(setpoint_ned_m[2], top_m), floor_m))


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
