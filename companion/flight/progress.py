"""State mission: one step after the other; state holding: the pause after a recovery."""

import math
from dataclasses import replace

from companion.flight import expecting
from companion.flight.around import passed, way_around
from companion.flight.context import FlightContext, Inputs, Move, StepTally, Target
from companion.flight.course import LEAST_TRY_M_S, climb, first_leg, stay
from companion.flight.heading import Heading
from companion.flight.plan import describe_item
from companion.flight.remembering import surroundings
from companion.flight.states import Trigger
from companion.flight.trajectory import Trajectory
from companion.flight.waiting import Waiting
from companion.messages import Vector3
from companion.mission.expectations import ExpectItem
from companion.mission.items import (
    GoToItem,
    HoldItem,
    LandItem,
    Motion,
    OrbitItem,
    PathItem,
    ReturnItem,
    SetSpeedItem,
    SetYawItem,
    TakeoffItem,
    VelocityItem,
    WaitForItem,
)

# Of a time-out, and of a goal out of reach; "continue" is no move.
_TRIGGERS = {
    "abort": Trigger.INTERRUPTED,
    "return": Trigger.RETURN_DUE,
    "land": Trigger.LAND_DUE,
}


class FlyItems:
    """From `flight.step_index` on, until the step is land or return. Every step starts where the last setpoint was."""

    def __init__(self, flight: FlightContext, now_us: int) -> None:
        self._begin(flight, now_us)

    def _begin(self, flight: FlightContext, now_us: int) -> None:
        """Take up the present step: a way to go (of no length for a hold) and a heading to turn to."""
        assert flight.target is not None and flight.origin_ned_m is not None, "the flight is in the air"
        if flight.tally.index != flight.step_index or flight.tally.began_us is None:
            flight.tally = StepTally(flight.step_index, now_us)
        step, start = flight.step, flight.mission_ned_m(flight.target.position_ned_m)
        self._flight, self._action = flight, step.action
        self._started_us, self._way_began_us = now_us, flight.way_us
        self._over_since_us: int | None = None
        self._heading = Heading.of_step(step, flight.yaw_rad, now_us)
        self._waiting = Waiting(self._action, flight) if isinstance(self._action, WaitForItem) else None
        self._way: Trajectory = stay(start)
        self._out_of_reach = ""
        match self._action:
            case TakeoffItem():
                # tried again after a hit in the climb
                self._way = climb(start, self._action.height_m, flight.mission.companion.flight)
            case SetSpeedItem():
                flight.pace = flight.pace.changed_to(self._action)
        factor = flight.tally.pace_factor
        again = "" if factor == 1.0 else f", at {factor:.0%} of the speed, {LEAST_TRY_M_S:g} m/s at least"
        text = f"item {step.label} of {len(flight.mission.items)}: {describe_item(self._action)}{again}"
        number = int(step.label.partition(" ")[0].partition(".")[0])
        flight.tell(now_us, "item", text, number=number, name=step.name, step=step.index)
        if isinstance(self._action, ExpectItem):
            expecting.begin(flight, step.label, self._action, now_us)
        elif isinstance(self._action, GoToItem | VelocityItem | PathItem | OrbitItem):
            self._plan(self._action, start, now_us)

    def _plan(self, action: Motion, start_m: Vector3, now_us: int) -> None:
        """The item's own way, or one round what is known; what is left of a path that was interrupted."""
        flight = self._flight
        behind = flight.tally.points_passed if flight.after_recovery.trigger is Trigger.RECOVERED_TO_DETOUR else 0
        if isinstance(action, PathItem) and 0 < behind < len(action.points_ned_m):
            action = action.model_copy(update={"points_ned_m": action.points_ned_m[behind:]})
        known = surroundings(flight)
        pace = replace(flight.pace, factor=flight.tally.pace_factor)
        planned = way_around(action, start_m, pace.against(flight.leaning.wind_m_s2, first_leg(action, start_m)), known)
        if planned.way is None:
            self._out_of_reach = f"{describe_item(action)}: no way round what is known"
            flight.unreachable.append(flight.step.label)
            policy = flight.mission.obstacles.on_unreachable
            text = f"item {flight.step.label} out of reach: {self._out_of_reach}; then: {policy}"
            flight.tell(now_us, "unreachable", text, item=flight.step.label, then=policy)
            return
        self._way = planned.way
        if planned.is_detour:
            left_out = f", {planned.left_out} points left out" if planned.left_out else ""
            text = f"round what is known: {planned.way.distance_m:.1f} m{left_out}"
            flight.tell(now_us, "detour", text, distance_m=planned.way.distance_m, left_out=planned.left_out)

    def interrupt(self, now_us: int) -> None:
        """A hit ends the present way: how much of a path has been flown?"""
        if isinstance(self._action, PathItem):
            tally = self._flight.tally
            tally.points_passed = max(tally.points_passed, passed(self._action, self._way, self._on_the_way_s))

    @property
    def _on_the_way_s(self) -> float:
        return (self._flight.way_us - self._way_began_us) * 1e-6

    def target(self, now_us: int) -> Target | None:
        elapsed_s = self._on_the_way_s
        position, velocity, acceleration = self._way.at(elapsed_s)
        yaw_rad = self._heading.turn(position, velocity, now_us)
        place = self._flight.local_ned_m(position)
        if elapsed_s >= self._way.duration_s:
            return Target(place, yaw_rad)
        # Without the acceleration the vehicle falls behind the way as it speeds up and then overruns the speed.
        return self._flight.under_way(place, yaw_rad, velocity, acceleration)

    def step(self, flight: FlightContext, inputs: Inputs, now_us: int) -> Move | None:
        while True:
            if isinstance(self._action, ReturnItem):
                flight.returning_as = self._action
                return Move(Trigger.RETURN_DUE)
            if isinstance(self._action, LandItem):
                return Move(Trigger.LAND_DUE)
            if self._out_of_reach:
                trigger = _TRIGGERS.get(flight.mission.obstacles.on_unreachable)
                if trigger is not None:
                    return Move(trigger, self._out_of_reach, hand_over=trigger is Trigger.INTERRUPTED)
            elif not self._is_done(flight, now_us):
                return self._overdue(flight, now_us)
            self._leave(flight, now_us)

    def _leave(self, flight: FlightContext, now_us: int) -> None:
        """On to the next step, from the setpoint of this moment."""
        flight.target = self.target(now_us)
        flight.yaw_rad = self._heading.yaw_rad
        flight.step_index += 1
        self._begin(flight, now_us)

    def _is_done(self, flight: FlightContext, now_us: int) -> bool:
        elapsed_s = self._on_the_way_s
        match self._action:
            case SetSpeedItem() | ExpectItem():
                return True
            case HoldItem(duration_s=duration_s):
                return now_us - self._started_us >= duration_s * 1e6
            case WaitForItem():
                assert self._waiting is not None
                return self._waiting.is_over(flight, now_us)
            case VelocityItem():
                return elapsed_s >= self._way.duration_s and self._has_turned(now_us)
            case SetYawItem():
                return self._has_turned(now_us)
            case _:
                over = elapsed_s >= self._way.duration_s and self._has_turned(now_us)
                if over and self._over_since_us is None:
                    self._over_since_us = now_us
                return over and self._arrived(flight)

    def _has_turned(self, now_us: int) -> bool:
        if self._heading.is_fixed:
            self._heading.turn(self._way.target_m, (0.0, 0.0, 0.0), now_us)
        return self._heading.is_reached

    def _arrived(self, flight: FlightContext) -> bool:
        latest = flight.vehicle.history.latest()
        goal = flight.local_ned_m(self._way.target_m)
        radius_m = flight.mission.companion.flight.acceptance_radius_m
        return latest is not None and math.dist(latest.position_ned_m, goal) <= radius_m

    def _overdue(self, flight: FlightContext, now_us: int) -> Move | None:
        item, began_us = flight.step.item, flight.tally.began_us
        assert began_us is not None
        if item.timeout_s is not None and now_us - began_us > item.timeout_s * 1e6:
            text = f"not done within {item.timeout_s:g} s: {describe_item(self._action)}"
            flight.tell(now_us, "timeout", f"item {flight.step.label} {text}; then: {item.on_timeout}")
            if item.on_timeout == "continue":
                self._leave(flight, now_us)
                return self.step(flight, Inputs(), now_us)
            trigger = _TRIGGERS[item.on_timeout]
            return Move(trigger, text, hand_over=trigger is Trigger.INTERRUPTED)
        patience_s = flight.mission.companion.flight.arrival_timeout_s
        if self._over_since_us is not None and now_us - self._over_since_us > patience_s * 1e6:
            return Move(Trigger.INTERRUPTED, f"not arrived: {describe_item(self._action)}", hand_over=True)
        return None


class HoldAfterRecovery:
    """Stay at the recovery setpoint for the policy's time."""

    def __init__(self, flight: FlightContext, now_us: int) -> None:
        hold_s = flight.after_recovery.hold_s
        self._until_us = now_us + round(hold_s * 1e6)
        self._target = flight.target
        flight.tell(now_us, "hold", f"holding for {hold_s:g} s", hold_s=hold_s)

    def target(self, now_us: int) -> Target | None:
        return self._target

    def step(self, flight: FlightContext, inputs: Inputs, now_us: int) -> Move | None:
        return Move(Trigger.HOLD_ENDED) if now_us >= self._until_us else None
