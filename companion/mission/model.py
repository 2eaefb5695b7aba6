"""The mission file as a model, and its ways worked out beforehand: where each step begins, how it goes, how long.

Coordinates: NED, relative to the arming position, aligned north.
"""

import math
from collections.abc import Iterator
from dataclasses import dataclass, replace
from typing import Annotated, Self

from pydantic import Field, model_validator

from companion.autopilot.known import defaults
from companion.fence import Fence
from companion.memory.patch import Patch
from companion.memory.stored import ObstaclesConfig
from companion.memory.surroundings import ObstacleMap
from companion.messages import Vector3
from companion.mission import items
from companion.mission.config import CompanionConfig
from companion.mission.item_trajectory import Planned, SpeedLimits, climb, home_around, looks, stay, trajectory_around
from companion.mission.items import MissionItem
from companion.mission.policy import AbortWhen, Handover, OnCollision, OnCrash, OnDamage, Resume, SetpointLimits
from companion.mission.trajectory import Chain, LineProfile, Trajectory
from companion.reflex.config import RecoveryConfig
from companion.strict_model import StrictModel


class Mission(StrictModel):
    """A whole mission file. `sim` belongs to the simulated vehicle and is ignored in a real flight."""

    name: Annotated[str, Field(min_length=1, pattern=r"^[A-Za-z0-9._-]+$")]
    """Letters, digits, dots, - and _; names the folder of the run."""
    description: str = ""
    """A line for people."""
    fence: Fence = Fence()
    limits: SetpointLimits = SetpointLimits()
    items: Annotated[tuple[MissionItem, ...], Field(min_length=2)]
    """Flown in order; take-off first, land or return last."""
    on_collision: OnCollision = OnCollision()
    """What follows a hit, where the item says nothing else."""
    recovery: RecoveryConfig = RecoveryConfig()
    obstacles: ObstaclesConfig = ObstaclesConfig()
    abort_when: AbortWhen = AbortWhen()
    on_damage: OnDamage = "tell"
    """After a hit that has hurt a propeller or a motor; told in any case. From the recovery's end on."""
    on_crash: OnCrash = "disarm"
    """When the vehicle lies on the ground after a crash, which is reported in any case. Never in the air."""
    on_interrupt: Handover = "hold"
    """What the vehicle is told to do when the flight ends early."""
    companion: CompanionConfig = CompanionConfig()
    resume: Resume | None = None
    sim: dict[str, object] | None = None
    """The simulated world (see `sim_vehicle.scene.Scene`)."""

    def known(self, patches: tuple[Patch, ...], keeps_in: bool = True) -> ObstacleMap:
        return ObstacleMap(patches, self.fence, self.companion.estimate.reach_m, self.obstacles.margin_m, keeps_in)

    @model_validator(mode="after")
    def _takeoff_first_land_last(self) -> Self:
        names = [item.name for item in self.items]
        if names[0] != "takeoff":
            raise ValueError(f"items: the first item must be takeoff, not {names[0]}")
        if names[-1] not in ("land", "return"):
            raise ValueError(f"items: the last item must be land or return, not {names[-1]}")
        for step in items.program(self.items):
            number = step.label.partition(" ")[0]
            if step.name in ("takeoff", "land", "return") and number not in ("1", f"{len(names)}"):
                where = "first" if step.name == "takeoff" else "last"
                raise ValueError(f"items: item {number} is {step.name}, which may only come {where}")
            speed_m_s = items.speed_m_s(step.action) or 0.0
            limit_m_s = self.limits.max_speed_m_s
            if speed_m_s > limit_m_s:
                flies = f"item {number} ({step.name}) flies at {speed_m_s:g} m/s"
                raise ValueError(f"items: {flies}, above limits.max_speed_m_s = {limit_m_s:g}")
        return self

    @model_validator(mode="after")
    def _trajectories_inside_fence(self) -> Self:
        steps_to_fly(self)  # raises ValueError, too
        seen: set[tuple[int, Vector3]] = set()
        for leg in _legs(self):
            # On the way up from the ground only the end can be wrong. A repeat's laps mostly go the same ways.
            if leg.trajectory is None or (id(leg.step.action), leg.start_ned_m) in seen:
                continue
            seen.add((id(leg.step.action), leg.start_ned_m))
            number = leg.step.label.partition(" ")[0]
            complaint = self.fence.complaint(leg.end_ned_m)
            if complaint is not None:
                raise ValueError(f"items: the position of item {number} ({leg.step.name}) {complaint}")
            if not isinstance(leg.step.action, items.TakeoffItem):
                complaint = _trajectory_complaint(self.fence, leg.trajectory)
            if complaint is not None:
                raise ValueError(f"items: on its way item {number} ({leg.step.name}) {complaint}")
        return self


# A point on the boundary, computed, may lie outside by a rounding error.
_ROUNDING_M = 1e-6
# The second and two that it takes to be sure and to disarm come on top.
LANDING_EXTRA_S = 3.0


@dataclass(frozen=True, slots=True)
class Leg:
    """One step in mission coordinates. `lasts_s` is None for a wait without a known end.

    `trajectory`: of no length where the vehicle stays; None where what is known beforehand leaves no way.
    `is_detour`: the way leads round it.
    """

    step: items.Step
    start_ned_m: Vector3
    trajectory: Trajectory | None
    lasts_s: float | None
    is_detour: bool

    @property
    def end_ned_m(self) -> Vector3:
        return self.start_ned_m if self.trajectory is None else self.trajectory.target_m


def itinerary(mission: Mission) -> tuple[Leg, ...]:
    """The mission when nothing is hit, round what is known beforehand."""
    return tuple(_legs(mission, mission.obstacles.patches()))


def steps_to_fly(mission: Mission) -> tuple[items.Step, ...]:
    """The program, or what of it an interrupted flight has left: up, to where its step begins, and on from there.

    Raises ValueError for a step that there is not.
    """
    steps = items.program(mission.items)
    if mission.resume is None:
        return steps
    at = mission.resume.at_step
    if at >= len(steps):
        raise ValueError(f"resume.at_step: the mission has {len(steps)} steps, counted from 0; there is no {at}")
    begin = tuple(_legs(mission))[at]
    headings = [yaw for step in steps[:at] if isinstance(yaw := getattr(step.action, "yaw_deg", None), float | int)]
    there = items.GoToItem(position_ned_m=begin.start_ned_m, yaw_deg=headings[-1] if headings else None)
    back = items.Step(at, begin.step.label, items.MissionItem(go_to=there), there)
    set_speeds = [replace(step, index=at) for step in steps[:at] if isinstance(step.action, items.SetSpeedItem)]
    return (steps[0], *set_speeds, back, *steps[at:])


def _legs(mission: Mission, patches: tuple[Patch, ...] = ()) -> Iterator[Leg]:
    place: Vector3 = (0.0, 0.0, 0.0)
    known = mission.known(patches, keeps_in=False)
    flight = mission.companion.flight
    speeds = SpeedLimits.of(flight, mission.limits.max_speed_m_s)
    for step in items.program(mission.items):
        action = step.action
        lasts_s: float | None = 0.0
        planned = Planned(stay(place))
        match action:
            case items.TakeoffItem():
                planned = Planned(climb(place, action.height_m, flight, mission.limits.max_speed_m_s))
            case items.HoldItem():
                lasts_s = action.duration_s
            case items.WaitForItem():
                known_s = [until_s for until_s in (action.flight_time_s, step.item.timeout_s) if until_s is not None]
                lasts_s = min(known_s, default=None)
            case items.SetSpeedItem():
                speeds = speeds.changed_to(action)
            case items.SetYawItem():
                lasts_s = 180.0 / action.rate_deg_s
            case items.ReturnItem():
                planned = home_around(place, action, speeds, known)
                lasts_s = _landing_s(place if planned.trajectory is None else planned.trajectory.target_m)
            case items.LandItem():
                lasts_s = _landing_s(place)
            case items.GoToItem() | items.VelocityItem() | items.PathItem() | items.OrbitItem():
                planned = trajectory_around(action, place, speeds, known)
                if isinstance(action.yaw_deg, float | int) and planned.trajectory is not None:
                    # It turns on its way, and after it.
                    lasts_s = max(0.0, 180.0 / defaults.TURNING_DEG_S - planned.trajectory.duration_s)
        if lasts_s is not None and planned.trajectory is not None:
            lasts_s += planned.trajectory.duration_s
        leg = Leg(step, place, planned.trajectory, lasts_s, planned.is_detour)
        yield leg
        place = leg.end_ned_m


def _landing_s(place: Vector3) -> float:
    return -place[2] / defaults.LANDING_M_S + LANDING_EXTRA_S


def _trajectory_complaint(fence: Fence, trajectory: Trajectory) -> str | None:
    if isinstance(trajectory, Chain):
        return next((complaint for part in trajectory.parts if (complaint := _trajectory_complaint(fence, part))), None)
    if isinstance(trajectory, LineProfile):
        # Between two heights that are allowed, and two places in a round fence, a line is allowed too.
        start, end = trajectory.start_m[:2], trajectory.target_m[:2]
        leaves = fence.shortened(start, end)
        is_out = math.dist(leaves, end) > _ROUNDING_M
        name = "radius_m" if fence.polygon_ne_m is None else "polygon_ne_m"
        return f"leaves fence.{name} at [{leaves[0]:.2f}, {leaves[1]:.2f}]" if is_out else None
    for position in looks(trajectory):
        beyond_m = max(fence.outside_by_m(position), position[2] + fence.min_height_m)
        if beyond_m > _ROUNDING_M:
            return fence.complaint(position)
    return None
