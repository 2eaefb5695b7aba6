"""What happened in a flight: its phases by what was reported, its crashes and contacts by the simulator's truth."""

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from enum import Enum

import numpy as np
import numpy.typing as npt

from bench.fly.lockstep import JudgedFlight
from companion.reflex.recovery.collision import CollisionReport
from companion.report import Event
from rebound_cli.results.truth_match import LATE_SAMPLE_US, Vector3
from sim_vehicle.truth import Hit


class MissionPhase(Enum):
    GROUND = "on the ground"
    CLIMB = "take-off"
    ITEM = "item"
    RECOVERING = "recovering"
    HOLDING = "holding"
    RETURNING = "returning"
    LANDING = "landing"
    OVER = "over"


_BEGUN_BY = {
    "armed": MissionPhase.CLIMB,
    "item": MissionPhase.ITEM,
    "detection": MissionPhase.RECOVERING,
    "hold": MissionPhase.HOLDING,
    "return": MissionPhase.RETURNING,
    "landing": MissionPhase.LANDING,
    "done": MissionPhase.OVER,
    "aborted": MissionPhase.OVER,
}


@dataclass(frozen=True, slots=True)
class Phases:
    """When each phase of a flight began, in microseconds of the vehicle's boot clock."""

    begun: tuple[tuple[float, MissionPhase], ...]

    def at(self, boot_us: float) -> MissionPhase:
        return next((phase for at_us, phase in reversed(self.begun) if at_us <= boot_us), MissionPhase.GROUND)

    def end_of(self, boot_us: float) -> float | None:
        """When the phase of this moment ended; None if it did not."""
        now = self.at(boot_us)
        return next((at_us for at_us, phase in self.begun if at_us > boot_us and phase is not now), None)


def phases_of(events: Sequence[Event], epoch_at_boot_us: float) -> Phases:
    told = (event for event in events if event.kind in _BEGUN_BY)
    return Phases(tuple((event.time_us - epoch_at_boot_us, _BEGUN_BY[event.kind]) for event in told))


# --- crashes

Floats = npt.NDArray[np.float64]

# MPC_LAND_SPEED is 0.7 m/s; half as much again is a gust. More is a fall.
LANDING_SPEED_MOST_M_S = 1.2
# On the ground: the feet, or a guard of a vehicle that leans, this near to it.
TOUCHING_M = 0.01
# In the air: the first time the feet are this high.
AIRBORNE_M = 0.3
# As a mission's own default for the vehicle itself; setpoints never lie outside.
OUTSIDE_MOST_M = 1.0


def crashes(flight: JudgedFlight) -> Iterator[tuple[str, str]]:
    """Cause and details of each kind that happened."""
    series = flight.truth.series
    time_us, height_m = series["time_boot_us"], heights_m(flight)
    tilt_deg = tilts_deg(series["attitude_wxyz"])
    if tilt_deg.max() > 90.0:
        yield "tumbled", f"leant by {tilt_deg.max():.0f} deg {flight.at(time_us[int(tilt_deg.argmax())])}"
    index = first_touch(height_m, TOUCHING_M)
    if index is not None and not tilt_deg.max() > 90.0:
        sink_m_s = float(series["velocity_ned_m_s"][index - 1, 2])
        if sink_m_s > LANDING_SPEED_MOST_M_S:
            yield "fell", f"reached the ground with {sink_m_s:.1f} m/s {flight.at(time_us[index])}"
        phase = phases_of(flight.events, flight.truth.epoch_at_boot_us).at(float(time_us[index]))
        if phase not in (MissionPhase.LANDING, MissionPhase.OVER):
            yield "touched the ground", f"while {phase.value} {flight.at(time_us[index])}"
    fence, start = flight.mission.fence, flight.start_ned_m
    places = series["position_ned_m"][:: max(1, len(time_us) // 2000)] - start
    outside_m = max(fence.outside_by_m((float(n), float(e), float(d))) for n, e, d in places)
    if outside_m > OUTSIDE_MOST_M:
        yield "left the fence", f"by {outside_m:.1f} m"


def first_touch(height_m: Floats, below_m: float) -> int | None:
    """The first row on the ground after one in the air; None where there is none."""
    airborne = np.flatnonzero(height_m > AIRBORNE_M)
    touching = np.flatnonzero(height_m[airborne[0] :] < below_m) if len(airborne) else airborne
    return int(airborne[0] + touching[0]) if len(touching) else None


def heights_m(flight: JudgedFlight) -> Floats:
    """Of the lowest part above the ground, (n,): the feet, or where the vehicle leans by more the rim of a guard."""
    series, frame = flight.truth.series, flight.airframe.geometry
    w, x, y, z = series["attitude_wxyz"].T
    # By how much a metre along body x and y is lower.
    along_x, along_y = np.abs(2.0 * (x * z - w * y)), np.abs(2.0 * (y * z + w * x))
    reach_m, guard_m = frame.motor_radius_m * np.sqrt(0.5), frame.guard_radius_m
    depth_m = reach_m * (along_x + along_y) + guard_m * np.hypot(along_x, along_y)
    heights: Floats = -series["position_ned_m"][:, 2] - np.maximum(flight.standing_m, depth_m)
    return heights


def tilts_deg(attitude_wxyz: Floats) -> Floats:
    """Between the body's down and the world's, (n,)."""
    cosine = 1.0 - 2.0 * (attitude_wxyz[:, 1] ** 2 + attitude_wxyz[:, 2] ** 2)
    tilts: Floats = np.degrees(np.arccos(np.clip(cosine, -1.0, 1.0)))
    return tilts


def angle_deg(one: Vector3, other: Vector3) -> float:
    lengths = math.hypot(*one) * math.hypot(*other)
    if lengths == 0.0:
        return 180.0
    cosine = sum(a * b for a, b in zip(one, other, strict=True)) / lengths
    return math.degrees(math.acos(max(-1.0, min(1.0, cosine))))


# --- contacts


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
        seen = (number for number, told in enumerate(flight.report.collisions) if _covers(hit, told))
        collision = None if is_landing else next(seen, None)
        is_bounce = bool(episode) and hit.contact_at_boot_us - episode[-1].ended_at_boot_us <= FOLLOWS_WITHIN_US
        if is_landing:
            role = Role.LANDING
        elif not episode or not (phase is MissionPhase.RECOVERING or is_bounce):
            role, episode = Role.HIT, [hit]
        else:
            role = Role.AGAIN if any(same_surface(hit, earlier) for earlier in episode) else Role.NEXT
            episode.append(hit)
        found.append(JudgedContact(hit, role, phase, collision))
    return found


def same_surface(hit: Hit, other: Hit) -> bool:
    facing = sum(a * b for a, b in zip(hit.normal_ned, other.normal_ned, strict=True))
    return hit.obstacle == other.obstacle and facing > SAME_SURFACE


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
