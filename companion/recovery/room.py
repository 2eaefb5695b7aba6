"""What no recovery law knows of: the fence with its floor and ceiling, and the surfaces found by earlier hits."""

from collections.abc import Sequence
from dataclasses import dataclass

from companion.messages import Vector3
from companion.recovery.direction import plus
from companion.recovery.envelope import Envelope

# Cosine between two normals below which surfaces face each other, as in a corridor: away from one is towards the
# other, and where there is not room enough for both distances the middle is kept. Walls of a corner are at 0.
FACING_EACH_OTHER = -0.5
# Where the vehicle is, is free: behind a surface by more than an estimate's drift and a touch's depth, the surface is
# not where it was thought to be. A hit that only brushed a guard may show its normal 70 degrees beside.
BEHIND_M = 0.2
# In a corner of an acute angle, away from one wall is towards the other: that converges in a few rounds or not at all.
ROUNDS = 5


@dataclass(frozen=True, slots=True)
class Surface:
    """Where the vehicle's centre was when it touched, the unit normal out of the surface, and how far off to stay."""

    point_ned_m: Vector3
    normal_ned: Vector3
    distance_m: float

    def off_m(self, place_ned_m: Vector3) -> float:
        """How far a place is from touching."""
        return sum(n * (p - s) for n, p, s in zip(self.normal_ned, place_ned_m, self.point_ned_m, strict=True))


@dataclass(frozen=True, slots=True)
class Room:
    """A fence and the surfaces known besides the one just hit."""

    envelope: Envelope
    surfaces: Sequence[Surface] = ()

    def goal(self, contact_ned_m: Vector3, normal_ned: Vector3, goal_ned_m: Vector3) -> Vector3:
        """The law's goal, moved as little as keeps it off the surfaces and inside the fence."""
        for _ in range(ROUNDS):
            before = goal_ned_m
            for surface in self.surfaces:
                goal_ned_m = _clear_of(surface, contact_ned_m, normal_ned, goal_ned_m)
            if goal_ned_m == before:
                break
        return self.envelope.clamp(contact_ned_m, goal_ned_m)


def _clear_of(surface: Surface, contact: Vector3, normal: Vector3, goal: Vector3) -> Vector3:
    """The goal, off the surface by its distance or, between surfaces that face each other, by half of the room."""
    wanted_m, room_m = surface.distance_m, surface.off_m(contact)
    if room_m < -BEHIND_M:
        return goal
    cosine = sum(a * b for a, b in zip(normal, surface.normal_ned, strict=True))
    if cosine < FACING_EACH_OTHER:
        wanted_m = min(wanted_m, 0.5 * max(0.0, room_m))
    short_m = wanted_m - surface.off_m(goal)
    return goal if short_m <= 0.0 else plus(goal, short_m, surface.normal_ned)
