"""The mission file as a model, and its ways worked out beforehand: where each step begins, how it goes, how long.

Coordinates: NED, relative to the arming position, aligned north.
"""

import math
from collections.abc import Iterator
from dataclasses import dataclass, replace
from typing import Annotated, Literal, Self

from pydantic import Field, model_validator

from companion.autopilot.known import defaults
from companion.fence import Fence
from companion.memory.stored import ObstaclesConfig
from companion.memory.surroundings import ObstacleMap
from companion.messages import Vector3
from companion.mission import items
from companion.mission.config import CompanionConfig
from companion.mission.item_trajectory import Planned, SpeedLimits, home_around, slowed_m_s, stay, trajectory_around
from companion.mission.items import MissionItem
from companion.mission.policy import AbortWhen, OnCollision, Resume, SetpointLimits
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
    on_damage: Literal["tell", "land", "return"] = "tell"
    """After a hit that has hurt a propeller or a motor; told in any case. From the recovery's end on."""
    on_crash: Literal["tell", "disarm"] = "disarm"
    """When the vehicle lies on the ground after a crash, which is reported in any case. Never in the air."""
    on_interrupt: Literal["hold", "land"] = "hold"
    """What the vehicle is told to do when the flight ends early."""
    companion: CompanionConfig = CompanionConfig()
    resume: Resume | None = None
    sim: dict[str, object] | None = None
    """The simulated world (see `sim_vehicle.scene.Scene`)."""

    @property
    def known(self) -> ObstacleMap:
        """What is known of the surroundings beforehand."""
        reach_m, margin_m = self.companion.estimate.reach_m, self.obstacles.margin_m
        return ObstacleMap(self.obstacles.known, self.fence, reach_m, margin_m)

    @property
    def speeds(self) -> SpeedLimits:
        """With which it begins."""
        flight = self.companion.flight
        speed_m_s = min(flight.cruise_speed_m_s, self.limits.max_speed_m_s)
        return SpeedLimits(speed_m_s, flight.cruise_acceleration_m_s2, speeding_up_m_s2=flight.speeding_up_m_s2)

    def climb(self, start_ned_m: Vector3, height_m: float, factor: float = 1.0) -> LineProfile:
        """Straight up, with that factor of the speed."""
        flight, top_ned_m = self.companion.flight, (start_ned_m[0], start_ned_m[1], -height_m)
        speed_m_s = slowed_m_s(min(flight.takeoff_speed_m_s, self.limits.max_speed_m_s), factor)
        return LineProfile(start_ned_m, top_ned_m, speed_m_s, flight.takeoff_acceleration_m_s2)

    @model_validator(mode="after")
    def _can_be_flown(self) -> Self:
        names, seen = [item.name for item in self.items], set[tuple[int, Vector3]]()
        if names[0] != "takeoff":
            raise ValueError(f"items: the first item must be takeoff, not {names[0]}")
        if names[-1] not in ("land", "return"):
            raise ValueError(f"items: the last item must be land or return, not {names[-1]}")
        for leg in itinerary(self, is_as_written=True):
            # A repeat's laps mostly go the same ways.
            complaint = None if (id(leg.step.action), leg.start_ned_m) in seen else self._complaint(leg)
            if complaint is not None:
                raise ValueError(f"items: {complaint}")
            seen.add((id(leg.step.action), leg.start_ned_m))
        steps_to_fly(self)  # raises ValueError, too
        return self

    def _complaint(self, leg: "Leg") -> str | None:
        """What is wrong with a step as it is written, or None."""
        name, number, limit_m_s = leg.step.item.name, leg.step.label.partition(" ")[0], self.limits.max_speed_m_s
        if name in ("takeoff", "land", "return") and number not in ("1", f"{len(self.items)}"):
            return f"item {number} is {name}, which may only come {'first' if name == 'takeoff' else 'last'}"
        speed_m_s = getattr(leg.step.action, "speed_m_s", None) or 0.0
        if speed_m_s > limit_m_s:
            return f"item {number} ({name}) flies at {speed_m_s:g} m/s, above limits.max_speed_m_s = {limit_m_s:g}"
        assert leg.trajectory is not None, "nothing is in its way"
        if (complaint := self.fence.complaint(leg.trajectory.target_m)) is not None:
            return f"the position of item {number} ({name}) {complaint}"
        # On the way up from the ground only the end can be wrong.
        complaint = None if name == "takeoff" else _trajectory_complaint(self.fence, leg.trajectory)
        return None if complaint is None else f"on its way item {number} ({name}) {complaint}"


# Setpoints this far apart in time are looked at for the fence: 4 cm at 2 m/s, as they are sent.
_LOOK_EVERY_S = 0.02
_MOST_LOOKS = 20_000
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
    begin = list(itinerary(mission, is_as_written=True))[at]
    headings = [yaw for step in steps[:at] if isinstance(yaw := getattr(step.action, "yaw_deg", None), float | int)]
    there = items.GoToItem(position_ned_m=begin.start_ned_m, yaw_deg=headings[-1] if headings else None)
    back = items.Step(at, begin.step.label, items.MissionItem(go_to=there), there)
    set_speeds = [replace(step, index=at) for step in steps[:at] if isinstance(step.action, items.SetSpeedItem)]
    return (steps[0], *set_speeds, back, *steps[at:])


def itinerary(mission: Mission, is_as_written: bool = False) -> Iterator[Leg]:
    """The mission when nothing is hit, round what is known beforehand, or without that as it is written."""
    place: Vector3 = (0.0, 0.0, 0.0)
    known = replace(mission.known, patches=(), keeps_in=False) if is_as_written else mission.known
    speeds, until_now_s = mission.speeds, 0.0
    for step in items.program(mission.items):
        action, planned = step.action, Planned(stay(place))
        lasts_s: float | None = 0.0
        match action:
            case items.TakeoffItem():
                planned = Planned(mission.climb(place, action.height_m))
            case items.HoldItem():
                lasts_s = action.duration_s
            case items.WaitForItem():
                flight_s = None if action.flight_time_s is None else max(0.0, action.flight_time_s - until_now_s)
                known_s = [until_s for until_s in (flight_s, step.item.timeout_s) if until_s is not None]
                lasts_s = min(known_s, default=None)
            case items.SetSpeedItem():
                speeds = speeds.changed_to(action)
            case items.SetYawItem():
                lasts_s = 180.0 / action.rate_deg_s
            case items.ReturnItem():
                planned = home_around(place, action, speeds, known)
            case items.GoToItem() | items.VelocityItem() | items.PathItem() | items.OrbitItem():
                planned = trajectory_around(action, place, speeds, known)
                if isinstance(action.yaw_deg, float | int) and planned.trajectory is not None:
                    # It turns on its way, and after it.
                    lasts_s = max(0.0, 180.0 / defaults.TURNING_DEG_S - planned.trajectory.duration_s)
        flown = planned.trajectory or stay(place)
        if isinstance(action, items.ReturnItem | items.LandItem):
            lasts_s = -flown.target_m[2] / defaults.LANDING_M_S + LANDING_EXTRA_S
        lasts_s = None if lasts_s is None else lasts_s + flown.duration_s
        until_now_s += lasts_s or 0.0
        yield Leg(step, place, planned.trajectory, lasts_s, planned.is_detour)
        place = flown.target_m


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
    count = min(_MOST_LOOKS, math.ceil(trajectory.duration_s / _LOOK_EVERY_S))
    places = (trajectory.at(trajectory.duration_s * number / count)[0] for number in range(count))
    beyond = (place for place in places if max(fence.outside_by_m(place), place[2] + fence.min_height_m) > _ROUNDING_M)
    return next(map(fence.complaint, beyond), None)
