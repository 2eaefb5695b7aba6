"""The guard's states with its own setpoints: take over, recover, give back to what hits nothing again, stand down."""

import math

from companion.autopilot.interface import Pilot
from companion.flight.context import Handler, Inputs, Target, Transition
from companion.flight.handlers.ending import GiveAway, silent_position
from companion.flight.handlers.recovering import Recover
from companion.flight.obstacle_map import all_known
from companion.guard.context import GuardContext
from companion.guard.states import Trigger
from companion.guard.watching import OTHERS_STOPPED_US
from companion.memory.patch import LEAST_SPEED_M_S
from companion.messages import Asked, Vector3
from companion.motion.vector import ZERO, along, plus
from companion.reflex.recovery.collision import recoveries_from

# PX4 brakes by this where it is set up as docs/how-to/guard.md has it. With PX4's default it needs less room
# (reflex.config.BRAKES_M_S2).
BRAKES_M_S2 = 2.0
# A velocity that is asked for leads somewhere: as far as in the time in which PX4 takes its setpoint for lost.
GOES_ON_S = OTHERS_STOPPED_US * 1e-6

# Standard deviations of a surface's direction that a program must stay clear of to have the vehicle back: 95 %.
CERTAIN = 2.0
# PX4 answers in 10 ms; when it does not take the mode its own action for lost setpoints is the next best.
HAND_OVER_US = 500_000


class TakeOver(Recover[GuardContext]):
    """The recovery began with the first setpoint. The state lasts until the vehicle reports OFFBOARD."""

    def __init__(self, guard: GuardContext, now_us: int) -> None:
        super().__init__(guard, now_us)
        mode = "" if guard.previous_mode is None else guard.vehicle.autopilot.mode(guard.previous_mode).name
        guard.report(now_us, "take_over", f"taking over from {mode}", mode=mode)
        self._began_us, self._trajectory_began_us = now_us, guard.trajectory_us
        if guard.command_client.requested_mode != guard.vehicle.autopilot.setpoints:
            guard.count_asked_mode()
        if not guard.vehicle.flies_setpoints:
            guard.ask_for_mode(guard.vehicle.autopilot.setpoints)

    def step(self, guard: GuardContext, inputs: Inputs, now_us: int) -> Transition | None:
        is_seen = guard.vehicle.flies_setpoints
        outcome = guard.command_outcome(inputs, is_seen, now_us)
        took_ms = (now_us - self._began_us) / 1e3
        if is_seen:
            guard.expected_mode = guard.vehicle.autopilot.setpoints
            name = guard.vehicle.mode_name
            text = f"{name} already, the program's setpoints kept out" if outcome is None else f"{name} confirmed"
            guard.report(now_us, "confirmed", f"{text} after {took_ms:.0f} ms", after_ms=took_ms)
            return Transition(Trigger.CONFIRMED)
        if (settled := super().step(guard, inputs, now_us)) is not None:
            return settled
        if outcome is not None:
            return Transition(Trigger.NOT_CONFIRMED, outcome.text)
        # A late step is no refusal: the answer may not have been read yet.
        if guard.trajectory_us - self._trajectory_began_us > guard.config.confirm_within_s * 1e6:
            name = guard.vehicle.autopilot.mode(guard.vehicle.autopilot.setpoints).name
            return Transition(Trigger.NOT_CONFIRMED, f"{name} not seen within {guard.config.confirm_within_s:g} s")
        return None


class GiveBack(GiveAway[GuardContext]):
    """Ask for one mode after the other until one is seen.

    A person's own request that crosses the first on the link, within its delay of about 10 ms, cannot be seen by
    anybody. A program's own OFFBOARD needs no asking: its setpoints are let through again. When no mode is taken the
    setpoints stop, and PX4's action for lost setpoints follows.
    """

    def __init__(self, guard: GuardContext, now_us: int) -> None:
        super().__init__(guard, now_us)
        previous, limit, hits = guard.previous_mode, guard.config.max_hits, recoveries_from(guard.hits)
        if hits >= limit and not guard.is_to_hold:
            guard.is_to_hold = True
            if guard.config.then == "previous":
                guard.report(now_us, "not_back", f"not given back: recovery {hits} of at most {limit}")
        self._wishes = [guard.vehicle.autopilot.hold, guard.vehicle.autopilot.land]
        if guard.config.then == "previous" and not guard.is_to_hold and previous is not None:
            self._wishes.insert(0, previous)
        self._is_told = False
        self._is_doubted = self.wish == previous  # whether it would hit again

    def _waits(self, guard: GuardContext, now_us: int) -> bool:
        """Whether other setpoints, or sticks, are waited for. Any other mode that would hit again is given up."""
        reason = leads_into(guard, self.wish) if self._is_doubted else None
        if reason is None:
            self._is_doubted = False
            return False
        if not self._is_told:
            self._is_told = True
            guard.report(now_us, "not_back", f"not given back: {reason}")
        autopilot = guard.vehicle.autopilot
        heard_us = guard.others_setpoint_us if self.wish == autopilot.setpoints else guard.sticks_us
        streams = now_us - heard_us < OTHERS_STOPPED_US
        may_wait = autopilot.mode(self.wish).pilot is not Pilot.AUTOPILOT
        if may_wait and streams and silent_position(guard) is None:
            return True
        self._wishes.pop(0)
        self._began_us, self._is_doubted = now_us, False
        return False

    @property
    def wish(self) -> int:
        return self._wishes[0]

    def step(self, guard: GuardContext, inputs: Inputs, now_us: int) -> Transition | None:
        if self._waits(guard, now_us):
            return None
        outcome = self._ask_for(self.wish, guard, inputs, now_us)
        if outcome is None:
            return None
        if outcome.succeeded:
            took_ms = (now_us - self._began_us) / 1e3
            name = guard.vehicle.mode_name
            text = f"given back to {name} after {took_ms:.0f} ms"
            guard.report(now_us, "given_back", text, mode=name, after_ms=took_ms)
            return Transition(Trigger.GIVEN_BACK)
        self._wishes.pop(0)
        if not self._wishes:
            return Transition(Trigger.CONTROL_LOST, "the vehicle takes no mode; setpoints stopped")
        guard.ask_for_mode(self.wish)
        # The answers of this step were to the mode before.
        return self.step(guard, Inputs(), now_us)


class StandDown(Handler[GuardContext]):
    """A pilot who moved the sticks is given the position mode, as PX4's own stick override does.

    OFFBOARD would go on without a word of the pilot's otherwise. Setpoints go on until the mode is seen.
    """

    def __init__(self, guard: GuardContext, for_sticks: bool, now_us: int) -> None:
        self._until_us = now_us + HAND_OVER_US
        if for_sticks and guard.vehicle.flies_setpoints and guard.target is not None:
            self._target = guard.target.at_rest()
            guard.ask_for_mode(guard.vehicle.autopilot.sticks)

    def step(self, guard: GuardContext, inputs: Inputs, now_us: int) -> Transition | None:
        if self._target is not None:
            outcome = guard.command_outcome(inputs, not guard.vehicle.flies_setpoints, now_us)
            if outcome is not None or now_us > self._until_us:
                self._target = None
                guard.command_client.cancel()
        return Transition(Trigger.ENABLED, "enabled again") if inputs.is_enabled else None


def leads_into(guard: GuardContext, mode: int) -> str | None:
    """Why the mode would hit again; None where it would not."""
    autopilot = guard.vehicle.autopilot
    if mode == autopilot.setpoints:
        does_lead = lead_into(guard, guard.asked, CERTAIN)
        if does_lead is None:
            return "nobody knows where the program's setpoints lead: choose a mode"
        return "the program's setpoints lead into what was hit: send others, or choose a mode" if does_lead else None
    if mode == autopilot.hold or not guard.collisions:
        return None
    contact = guard.collisions[-1].contact
    if autopilot.mode(mode).pilot is not Pilot.AUTOPILOT:
        pushed = -along(_sticks_ned(guard), contact.normal_ned) > autopilot.stick_deadzone
        return "the sticks push on into what was hit: release them" if pushed else None
    if -along(contact.velocity_ned_m_s, contact.normal_ned) < LEAST_SPEED_M_S:
        return None
    name = autopilot.mode(mode).name
    return f"{name} goes on into what was hit: change it and choose it again, or choose another mode"


def _sticks_ned(guard: GuardContext) -> Vector3:
    """Where the pilot's sticks push the vehicle by its present heading: 1 is full deflection, NED."""
    heading_rad = guard.vehicle.heading_rad
    if guard.sticks_now is None or heading_rad is None:
        return ZERO
    forward, right, *_ = guard.sticks_now.deflections
    cosine, sine = math.cos(heading_rad), math.sin(heading_rad)
    return (forward * cosine - right * sine, forward * sine + right * cosine, 0.0)


def lead_into(guard: GuardContext, asked: Asked, deviations: float = 0.0) -> bool | None:
    """Whether setpoints do; None where they do not say where they lead.

    With `deviations` also where a surface would have to bend towards them by so many standard deviations.
    """
    if asked.place_ned_m is None and asked.velocity_ned_m_s is None:
        return None
    velocity = asked.velocity_ned_m_s or ZERO
    ahead_s = math.hypot(*velocity) / (2.0 * BRAKES_M_S2) + GOES_ON_S
    here = guard.mission_ned_m(guard.latest.position_ned_m)
    place = here if asked.place_ned_m is None else guard.mission_ned_m(asked.place_ned_m)
    known = all_known(guard)
    goal = plus(place, ahead_s, velocity)
    # A surface may be longer than it is known to be: who is in front of it stays there.
    leads_behind = any(
        patch.off_m(here) > 0.0
        and patch.off_m(goal) - deviations * patch.bends_m(patch.beside_m(goal)) < known.clearance_m
        for patch in known.patches
    )
    return leads_behind or known.block([here, goal])


def stop(guard: GuardContext) -> Target:
    """Where the vehicle comes to rest when it brakes now."""
    latest = guard.latest
    brakes_s = math.hypot(*latest.velocity_ned_m_s) / (2.0 * BRAKES_M_S2)
    return Target(plus(latest.position_ned_m, brakes_s, latest.velocity_ned_m_s), guard.yaw_rad)
