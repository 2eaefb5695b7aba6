"""Every contact of a flight by the simulator's truth: a hit, the same surface again in its recovery, or a landing."""

from collections.abc import Sequence
from dataclasses import dataclass
from enum import Enum

import numpy as np
import numpy.typing as npt

from bench.random_missions.crashes import heights_m
from bench.random_missions.flight import JudgedFlight
from bench.random_missions.phases import MissionPhase, phases_of
from companion.report import CollisionReport
from rebound_cli.results.truth_match import LATE_SAMPLE_US
from sim_vehicle.truth import Hit

Floats = npt.NDArray[np.float64]

# A guard that bounces, before the companion has told of the first touch or while nobody has noticed it: one hit.
FOLLOWS_WITHIN_US = 250_000
# A fall at 5 m/s comes so far from one row of the path to the next.
ON_GROUND_M = 0.025
# Cosine between normals above which two faces of an obstacle are one surface to someone who touches them.
SAME_SURFACE = 0.5


class Role(Enum):
    HIT = "hit"
    AGAIN = "same surface again"
    NEXT = "another surface"
    LANDING = "landing"


@dataclass(frozen=True, slots=True)
class JudgedContact:
    """`collision`: number of the companion's report of it, None where it was not noticed."""

    hit: Hit
    role: Role
    phase: MissionPhase
    collision: int | None

    @property
    def speed_m_s(self) -> float:
        return float(np.linalg.norm(_approach(self.hit)))

    @property
    def closing_m_s(self) -> float:
        """Into the surface."""
        return float(-_approach(self.hit) @ np.array(self.hit.normal_ned))


def _approach(hit: Hit) -> Floats:
    velocity: Floats = np.array(hit.impact_velocity_ned_m_s) - np.array(hit.surface_velocity_ned_m_s)
    return velocity


def contacts_of(flight: JudgedFlight) -> list[JudgedContact]:
    """In the order in which they began."""
    phases = phases_of(flight.events, flight.truth.epoch_at_boot_us)
    found: list[JudgedContact] = []
    episode: list[Hit] = []
    for hit in flight.truth.hits:
        phase = phases.at(hit.contact_at_boot_us)
        is_landing = phase in (MissionPhase.LANDING, MissionPhase.OVER, MissionPhase.GROUND)
        collision = None if is_landing else _seen_as(hit, flight.report.collisions)
        if is_landing:
            role = Role.LANDING
        elif not episode or (phase is not MissionPhase.RECOVERING and not _follows(hit, episode[-1])):
            role, episode = Role.HIT, [hit]
        else:
            role = Role.AGAIN if any(same_surface(hit, earlier) for earlier in episode) else Role.NEXT
            episode.append(hit)
        found.append(JudgedContact(hit, role, phase, collision))
    return found


def _follows(hit: Hit, earlier: Hit) -> bool:
    return hit.contact_at_boot_us - earlier.ended_at_boot_us <= FOLLOWS_WITHIN_US


def same_surface(hit: Hit, other: Hit) -> bool:
    facing = sum(a * b for a, b in zip(hit.normal_ned, other.normal_ned, strict=True))
    return hit.obstacle == other.obstacle and facing > SAME_SURFACE


def _seen_as(hit: Hit, collisions: Sequence[CollisionReport]) -> int | None:
    return next((n for n, collision in enumerate(collisions) if _covers(hit, collision)), None)


def _covers(hit: Hit, collision: CollisionReport) -> bool:
    return hit.contact_at_boot_us <= collision.sample_time_boot_us <= hit.ended_at_boot_us + LATE_SAMPLE_US


def without_contact(flight: JudgedFlight) -> list[CollisionReport]:
    """The companion's collisions that were none: with nothing in the room, nor with the ground."""
    time_us, on_ground = flight.truth.series["time_boot_us"], heights_m(flight) < ON_GROUND_M

    def meets_ground(collision: CollisionReport) -> bool:
        at_us = collision.sample_time_boot_us
        return bool(on_ground[(time_us >= at_us - LATE_SAMPLE_US) & (time_us <= at_us)].any())

    found = [c for c in flight.report.collisions if not any(_covers(hit, c) for hit in flight.truth.hits)]
    return [collision for collision in found if not meets_ground(collision)]
