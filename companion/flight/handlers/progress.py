"""State mission: one step after the other; holding: a pause after a recovery; returning: home. All watch for hits."""

import math
from dataclasses import replace

from companion.flight import expectations
from companion.flight.context import TURNING_RAD_S, FlightContext, Handler, Inputs, StepTally, Target, Transition
from companion.flight.obstacle_map import surroundings
from companion.flight.plan import describe_item
from companion.flight.states import Trigger
from companion.messages import Vector3
from companion.mission import items
from companion.mission.item_trajectory import LEAST_TRY_M_S, first_leg, home_around, left_of, stay, trajectory_around
from companion.mission.trajectory import LineProfile, Motion, Trajectory
from companion.motion.settling import Lasting
from companion.motion.vector import ZERO, minus

# Of a time-out, a goal out of reach, damage, and of the last item; "continue" is no move.
_TRIGGERS = {"abort": Trigger.INTERRUPTED, "return": Trigger.RETURN_DUE, "land": Trigger.LAND_DUE}


class _OnTrajectory(Handler[FlightContext]):
    """A trajectory in mission coordinates, begun at a time of the trajectories' clock."""

    _trajectory: Trajectory
    _trajectory_began_us: int

    def _elapsed_s(self, flight: FlightContext) -> float:
        return (flight.trajectory_us - self._trajectory_began_us) * 1e-6

    def _turned(self, flight: FlightContext, motion: Motion, now_us: int) -> float | None:
        return flight.heading_towards()

    def target(self, flight: FlightContext, now_us: int) -> Target:
        elapsed_s = self._elapsed_s(flight)
        place, velocity, acceleration = motion = self._trajectory.at(elapsed_s)
        yaw_rad = self._turned(flight, motion, now_us)
        # Without the acceleration the vehicle falls behind as it speeds up, and then overshoots the speed.
        target = Target(flight.local_ned_m(place), yaw_rad, velocity, acceleration)
        return target if flight.has_position and elapsed_s < self._trajectory.duration_s else target.at_rest()

    def _is_there(self, flight: FlightContext) -> bool:
        most_m = flight.mission.companion.flight.acceptance_radius_m
        goal_ned_m = flight.local_ned_m(self._trajectory.target_m)
        return math.dist(flight.reflex.place_ned_m(flight.latest), goal_ned_m) <= most_m


class FlyItems(_OnTrajectory):
    """From `flight.step_index` on, until the step is land or return. Every step starts where the last setpoint was."""

    def __init__(self, flight: FlightContext, now_us: int) -> None:
        self._begin(flight, now_us)

    def _begin(self, flight: FlightContext, now_us: int) -> None:
        """Begin the present step: a trajectory (of no length for a hold) and a heading."""
        assert flight.target is not None and flight.origin_ned_m is not None, "the flight is in the air"
        if flight.tally.index != flight.step_index:
            flight.tally = StepTally(flight.step_index)
        if flight.tally.began_us is None:
            flight.tally.began_us = now_us
        step, start = flight.step, flight.mission_ned_m(flight.target.position_ned_m)
        self._action = step.action
        self._trajectory_began_us = flight.trajectory_us
        self._over_since_us: int | None = None
        self._heading = Heading(step.action, flight.yaw_rad, now_us)
        self._steady = Lasting()  # at the setpoint, or at the item's goal
        self._trajectory: Trajectory = stay(start)
        self._is_held, self._wanted_ned_m = False, flight.target.position_ned_m
        self._motion: items.Motion | None = None
        self._out_of_reach = ""
        match self._action:
            case items.TakeoffItem():
                # tried again after a hit in the climb
                self._trajectory = flight.mission.climb(start, self._action.height_m, flight.tally.pace_factor)
            case items.WaitForItem(file=file):
                flight.file_awaited = file
            case items.SetSpeedItem():
                flight.speeds = flight.speeds.changed_to(self._action)
        factor = flight.tally.pace_factor if isinstance(self._action, items.Motion | items.TakeoffItem) else 1.0
        again = "" if factor == 1.0 else f", at {factor:.0%} of the speed, {LEAST_TRY_M_S:g} m/s at least"
        text = f"item {step.label} of {len(flight.mission.items)}: {describe_item(self._action)}{again}"
        number = int(step.label.partition(" ")[0].partition(".")[0])
        flight.report(now_us, "item", text, number=number, name=step.item.name, step=step.index)
        if isinstance(self._action, items.ExpectItem):
            expectations.begin(flight, step.label, self._action, now_us)
        elif isinstance(self._action, items.Motion):
            left = None if flight.is_retry else flight.tally.left
            self._plan(flight, left or self._action, start, now_us)

    def _plan(self, flight: FlightContext, action: items.Motion, start_m: Vector3, now_us: int) -> None:
        """The item's own trajectory, or one round known obstacles."""
        self._motion, self._trajectory_began_us = action, flight.trajectory_us
        known = surroundings(flight)
        speeds = replace(flight.speeds, factor=flight.tally.pace_factor)
        speeds = speeds.against(flight.reflex.sustained_force.wind_m_s2, first_leg(action, start_m))
        planned = trajectory_around(action, start_m, speeds, known)
        if planned.trajectory is None:
            self._out_of_reach = f"{describe_item(action)}: no way round what is known"
            flight.unreachable.append(flight.step.label)
            policy = flight.mission.obstacles.on_unreachable
            text = f"item {flight.step.label} out of reach: {self._out_of_reach}; then: {policy}"
            flight.report(now_us, "unreachable", text, item=flight.step.label, then=policy)
            return
        self._trajectory = planned.trajectory
        if planned.is_detour:
            left_out = f", {planned.left_out} points left out" if planned.left_out else ""
            text = f"round what is known: {planned.trajectory.distance_m:.1f} m{left_out}"
            flight.report(now_us, "detour", text, distance_m=planned.trajectory.distance_m, left_out=planned.left_out)

    def interrupt(self, flight: FlightContext) -> None:
        """A hit ends the present trajectory: note what is left of the item."""
        if self._motion is not None:
            flight.tally.left = left_of(self._motion, self._trajectory, self._elapsed_s(flight))

    def target(self, flight: FlightContext, now_us: int) -> Target:
        """A velocity that is held back goes on from there, and from rest. It does not catch up."""
        line = self._trajectory
        if isinstance(self._motion, items.VelocityItem) and isinstance(line, LineProfile) and flight.target is not None:
            sent, was_held = flight.target.position_ned_m, self._is_held
            self._is_held = sent != self._wanted_ned_m
            if self._is_held:
                self._trajectory = line.moved(minus(sent, self._wanted_ned_m))
            elif was_held:
                left = left_of(self._motion, line, self._elapsed_s(flight))
                self._plan(flight, left, flight.mission_ned_m(sent), now_us)
        target = super().target(flight, now_us)
        self._wanted_ned_m = target.position_ned_m
        return target

    def _turned(self, flight: FlightContext, motion: Motion, now_us: int) -> float | None:
        flight.yaw_rad = self._heading.turned(flight.yaw_rad, motion[0], motion[1], now_us)
        return flight.heading_towards(self._heading.rate_rad_s)

    def step(self, flight: FlightContext, inputs: Inputs, now_us: int) -> Transition | None:
        damage, wanted = flight.motors.damage, flight.mission.on_damage
        if damage is not None and wanted != "tell":
            return Transition(_TRIGGERS[wanted], damage.text)
        while True:
            if isinstance(self._action, items.ReturnItem | items.LandItem):
                return Transition(_TRIGGERS[flight.step.item.name])
            if self._out_of_reach:
                policy = flight.mission.obstacles.on_unreachable
                if policy != "continue":
                    return Transition(_TRIGGERS[policy], self._out_of_reach)
                self._leave(flight, now_us)
                return None  # to look for a way takes time, in which no setpoint is sent
            if not self._is_done(flight, now_us):
                return self._overdue(flight, now_us)
            self._leave(flight, now_us)

    def _leave(self, flight: FlightContext, now_us: int) -> None:
        """On to the next step, from the setpoint as it was sent: one that is held back does not go on behind a wall."""
        flight.step_index += 1
        self._begin(flight, now_us)

    def _is_done(self, flight: FlightContext, now_us: int) -> bool:
        elapsed_s = self._elapsed_s(flight)
        match self._action:
            case items.SetSpeedItem() | items.ExpectItem():
                return True
            case items.HoldItem(duration_s=duration_s):
                began_us = flight.tally.began_us
                return began_us is not None and now_us - began_us >= duration_s * 1e6
            case items.WaitForItem():
                return self._has_come(self._action, flight, now_us)
            case items.VelocityItem() | items.SetYawItem():
                return elapsed_s >= self._trajectory.duration_s and self._has_turned(flight, now_us)
            case _:
                if elapsed_s < self._trajectory.duration_s or not self._has_turned(flight, now_us):
                    return False
                if self._over_since_us is None:
                    self._over_since_us = now_us
                return self._is_there(flight)

    def _has_come(self, item: items.WaitForItem, flight: FlightContext, now_us: int) -> bool:
        """What is waited for. A hit ends the step by the mission's policy, as it does every other."""
        if item.flight_time_s is not None:
            assert flight.armed_at_us is not None
            return now_us - flight.armed_at_us >= item.flight_time_s * 1e6
        if item.steady is None:
            return item.file is not None and flight.file_awaited is None
        latest, target = flight.latest, flight.target
        assert target is not None, "the flight is in the air"
        is_near = math.dist(latest.position_ned_m, target.position_ned_m) <= item.steady.within_m
        is_steady = is_near and math.hypot(*latest.velocity_ned_m_s) <= item.steady.speed_m_s
        self._steady.update(is_steady, latest.time_boot_us)
        return self._steady.lasts_us >= item.steady.for_s * 1e6

    def _has_turned(self, flight: FlightContext, now_us: int) -> bool:
        """To a fixed heading; one that follows the way is never late."""
        heading = self._heading
        if heading.is_fixed:
            flight.yaw_rad = heading.turned(flight.yaw_rad, self._trajectory.target_m, ZERO, now_us)
        return not heading.is_fixed or flight.yaw_rad == heading.fixed_rad

    def _overdue(self, flight: FlightContext, now_us: int) -> Transition | None:
        item, began_us = flight.step.item, flight.tally.began_us
        assert began_us is not None
        if item.timeout_s is not None and now_us - began_us > item.timeout_s * 1e6:
            text = f"not done within {item.timeout_s:g} s: {describe_item(self._action)}"
            flight.report(now_us, "timeout", f"item {flight.step.label} {text}; then: {item.on_timeout}")
            if item.on_timeout == "continue":
                self._leave(flight, now_us)
                return self.step(flight, Inputs(), now_us)
            return Transition(_TRIGGERS[item.on_timeout], text)
        patience_s = flight.mission.companion.flight.arrival_timeout_s
        if self._over_since_us is not None and now_us - self._over_since_us > patience_s * 1e6:
            return Transition(Trigger.INTERRUPTED, f"not arrived: {describe_item(self._action)}")
        return None


class HoldAfterRecovery(Handler[FlightContext]):
    """Stay at the recovery setpoint for the policy's time."""

    def __init__(self, flight: FlightContext, now_us: int) -> None:
        hold_s = (flight.steps[flight.tally.index].item.on_collision or flight.mission.on_collision).hold_s
        self._until_us = now_us + round(hold_s * 1e6)
        self._target = flight.target
        flight.report(now_us, "hold", f"holding for {hold_s:g} s", hold_s=hold_s)

    def target(self, flight: FlightContext, now_us: int) -> Target | None:
        return self._target and replace(self._target, yaw_rad=flight.heading_towards())

    def step(self, flight: FlightContext, inputs: Inputs, now_us: int) -> Transition | None:
        return Transition(Trigger.HOLD_ENDED) if now_us >= self._until_us else None


# Slower than this in m/s, or nearer in m, there is no direction that noise in the last digits could not have made.
_LEAST_LENGTH = 0.05


class Heading:
    """A heading that turns to the item's. Radians clockwise from north; None: the vehicle chooses."""

    def __init__(self, action: items.Action, yaw_rad: float | None, now_us: int) -> None:
        asked, self._at_us = getattr(action, "yaw_deg", None), now_us
        self.rate_rad_s = math.radians(action.rate_deg_s) if isinstance(action, items.SetYawItem) else TURNING_RAD_S
        self.fixed_rad = math.radians(asked) if isinstance(asked, float | int) else yaw_rad
        self.is_fixed = not isinstance(asked, str)
        self._centre_m = action.centre_ned_m if isinstance(action, items.OrbitItem) and asked == "centre" else None

    def turned(self, yaw_rad: float | None, position_m: Vector3, velocity_m_s: Vector3, now_us: int) -> float | None:
        """The heading turned on until now, in the shorter direction."""
        wanted = self.fixed_rad
        if not self.is_fixed:
            north, east, _ = velocity_m_s if self._centre_m is None else minus(self._centre_m, position_m)
            wanted = math.atan2(east, north) if math.hypot(north, east) > _LEAST_LENGTH else yaw_rad
        step, self._at_us = self.rate_rad_s * ((now_us - self._at_us) * 1e-6), now_us
        if wanted is None or yaw_rad is None:
            return wanted
        turn = math.remainder(wanted - yaw_rad, math.tau)
        return wanted if abs(turn) <= step else yaw_rad + math.copysign(step, turn)


class FlyHome(_OnTrajectory):
    """Up where that is asked for, then straight; planned again after each recovery on the way."""

    def __init__(self, flight: FlightContext, now_us: int) -> None:
        assert flight.target is not None, "the flight is in the air"
        self._trajectory_began_us = flight.trajectory_us
        flight.going_home = True
        start = flight.mission_ned_m(flight.target.position_ned_m)
        speeds = flight.speeds.against(flight.reflex.sustained_force.wind_m_s2, (-start[0], -start[1], 0.0))
        last = flight.steps[-1].action
        asked = last if isinstance(last, items.ReturnItem) else items.ReturnItem()
        planned = home_around(start, asked, speeds, surroundings(flight))
        self._is_cut_off = planned.trajectory is None
        self._trajectory: Trajectory = planned.trajectory or stay(start)
        if self._is_cut_off:
            flight.unreachable.append("home")
            flight.report(now_us, "unreachable", "home out of reach: no way round what is known; landing here")
            return
        round_it = " round what is known" if planned.is_detour else ""
        text = f"returning over {self._trajectory.distance_m:.1f} m{round_it}"
        flight.report(now_us, "return", text, distance_m=self._trajectory.distance_m)

    def step(self, flight: FlightContext, inputs: Inputs, now_us: int) -> Transition | None:
        if self._is_cut_off or (flight.motors.damage is not None and flight.mission.on_damage == "land"):
            return Transition(Trigger.LAND_DUE)
        overdue_s = self._elapsed_s(flight) - self._trajectory.duration_s
        if overdue_s < 0.0:
            return None
        if self._is_there(flight):
            return Transition(Trigger.HOME_REACHED)
        if overdue_s > flight.mission.companion.flight.arrival_timeout_s:
            return Transition(Trigger.INTERRUPTED, "not arrived at home")
        return None
