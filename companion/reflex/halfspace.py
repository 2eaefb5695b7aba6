"""Keep-out half-spaces: touched surfaces, remembered surfaces, and the fence with its floor and ceiling."""

import math
from collections.abc import Sequence
from dataclasses import dataclass

from companion.fence import Fence
from companion.messages import Vector3
from companion.reflex.config import BEHIND_M, FACING_COSINE, ROUNDS, STEEP


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


@dataclass(frozen=True, slots=True)
class Surface:
    """A keep-out half-space: the vehicle's centre when it touched, the unit normal out of the surface, the clearance.

    `comes_m_s` is the surface's own speed along its normal.
    """

    point_ned_m: Vector3
    normal_ned: Vector3
    distance_m: float
    comes_m_s: float = 0.0

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


@dataclass(frozen=True, slots=True)
class FreeSpace:
    """A fence and the surfaces known besides the one just hit."""

    envelope: FenceBounds
    surfaces: Sequence[Surface] = ()

    def goal(self, contact_ned_m: Vector3, normal_ned: Vector3, goal_ned_m: Vector3) -> Vector3:
        """The law's goal, moved as little as possible to clear the surfaces and stay inside the fence."""
        for _ in range(ROUNDS):
            before = goal_ned_m
            for surface in self.surfaces:
                goal_ned_m = _clear_of(surface, contact_ned_m, normal_ned, goal_ned_m)
            if goal_ned_m == before:
                break
        return self.envelope.clamp(contact_ned_m, goal_ned_m)


def _clear_of(surface: Surface, contact: Vector3, normal: Vector3, goal: Vector3) -> Vector3:
    """The goal, clear of the surface by its distance; between facing surfaces by at most half of the room."""
    wanted_m, room_m = surface.distance_m, surface.off_m(contact)
    if room_m < -BEHIND_M:
        return goal
    cosine = sum(a * b for a, b in zip(normal, surface.normal_ned, strict=True))
    if cosine < FACING_COSINE:
        wanted_m = min(wanted_m, 0.5 * max(0.0, room_m))
    short_m = wanted_m - surface.off_m(goal)
    return goal if short_m <= 0.0 else plus(goal, short_m, surface.normal_ned)
