"""Runs the guard's table: looks for triggers, moves between states, makes each state's activity."""

import math
from dataclasses import dataclass
from typing import TypeAlias

from companion.flight.after_hit import note_before
from companion.flight.context import Inputs, Transition
from companion.flight.handlers.crash import Crashed, crashed
from companion.flight.handlers.ending import LINK_RESTORED, Released, silent_link, silent_position, taken_by
from companion.flight.handlers.recovering import record_collision
from companion.flight.machine import StateMachine
from companion.flight.states import State as FlightState
from companion.guard.context import GuardContext
from companion.guard.holding import GiveBack, Recovering, StandDown, TakeOver
from companion.guard.onward import lead_into, stop
from companion.guard.states import HOLDING, MAY_CRASH, TABLE, State, Trigger
from companion.guard.watching import THROTTLE, GuardConnect, StandBy, Watching, goes_down
from companion.messages import Asked, Sticks
from companion.reflex.detection.detector import ImpactKind
from companion.reflex.recovery.collision import recoveries_from

# What is told of a move that has a story.
_KINDS = {
    Trigger.CONTROL_LOST: "let_go",
    Trigger.NOT_CONFIRMED: "refused",
    Trigger.POSITION_SILENT: "link",
    Trigger.LEADS_BACK: "take_over",
    Trigger.WORTH_GUARDING: "watching",
    Trigger.NOT_TO_GUARD: "watching",
    Trigger.ENABLED: "enabled",
    Trigger.STREAMS_GONE: "link",
    Trigger.STOPPED: "stopped",
    Trigger.REFUSED: "ended",
}
STICKS = "the pilot moved the sticks"
# After these the vehicle is given back to hold whatever is configured.
_TO_HOLD = (Trigger.STOPPED, Trigger.NOT_CONFIRMED, Trigger.POSITION_SILENT)

# What is done in a state; one object is made each time the state is entered (see flight.machine).
Handler: TypeAlias = (
    GuardConnect | StandBy | Watching | TakeOver | Recovering | GiveBack | StandDown | Crashed | Released
)


@dataclass
class GuardMachine(StateMachine):
    """The present state and what is being done in it."""

    program = "guard"
    table = TABLE
    giving_away = (State.GIVING_BACK,)
    flight: GuardContext
    handler: Handler
    state: State = State.CONNECTING
    judged: Asked | None = None  # the program's setpoint that was last looked at

    @property
    def holds(self) -> bool:
        return self.state in HOLDING or (isinstance(self.handler, StandDown) and self.handler.hands_over)

    @property
    def finished(self) -> bool:
        return self.state is State.ENDED

    def step(self, inputs: Inputs, now_us: int) -> bool:
        before = self.handler
        if (asked := self._from_outside(inputs, now_us)) is not None:
            self._take(asked, now_us)
        if self.state in MAY_CRASH:
            meant = self.state not in HOLDING and goes_down(self.flight, now_us)
            if (crash := crashed(self.flight, meant, now_us)) is not None:
                self._take(crash, now_us)
        for estimate in inputs.impacts:
            if estimate.impact.kind is ImpactKind.CRASH and self.state not in HOLDING:
                continue  # a wreck is not taken over
            if self._is_beside_program():
                self.flight.left_alone += 1
                text = f"hit at {math.hypot(*estimate.velocity_ned_m_s):.2f} m/s left to the program that flies"
                self.flight.report(now_us, "left_alone", text, impact_velocity_ned_m_s=estimate.velocity_ned_m_s)
            elif Trigger.HIT in TABLE[self.state]:
                is_first = self.state is State.WATCHING
                if is_first:
                    self._remember_mode()
                note_before(self.flight, FlightState.MISSION if is_first else FlightState.RECOVERING)
                record_collision(self.flight, estimate, now_us)
                self._take(Transition(Trigger.HIT), now_us)
        if (transition := self._led_back() or self.handler.step(self.flight, inputs, now_us)) is not None:
            self._take_all(transition, now_us)
        return self.handler is not before

    def _give_away(self, text: str, now_us: int) -> None:
        self._take(Transition(Trigger.STOPPED, text), now_us)

    def _release(self, text: str) -> None:
        self.state, self.handler, self.flight.reason = State.ENDED, Released(), text

    def _is_beside_program(self) -> bool:
        """A program on another link goes on sending, in whatever mode; two streams would fight for the vehicle."""
        guard, is_watching = self.flight, self.state is State.WATCHING
        flies = is_watching and guard.vehicle.flies_setpoints and not guard.keeps_others_out
        return flies or (guard.program_elsewhere and (is_watching or self.state is State.GIVING_BACK))

    def _led_back(self) -> Transition | None:
        """A program that was given back to, and would hit the same again."""
        guard, asked = self.flight, self.flight.asked
        was_given = guard.config.then == "previous" and guard.hits and guard.vehicle.flies_setpoints
        if self.state is not State.WATCHING or not was_given or asked is None or asked is self.judged:
            return None
        self.judged = asked
        if not lead_into(guard, asked):
            return None
        self._remember_mode()
        guard.target = stop(guard)
        return Transition(Trigger.LEADS_BACK, "taking over: the program's setpoints lead into what was hit")

    def _remember_mode(self) -> None:
        guard = self.flight
        guard.previous_mode = guard.expected_mode = guard.vehicle.custom_mode
        guard.is_to_hold, guard.target = False, None
        guard.yaw_rad = guard.vehicle.heading_rad

    def _from_outside(self, inputs: Inputs, now_us: int) -> Transition | None:
        """What ends a state whatever is being done in it; the pilot's before all others, but for a disarm."""
        guard = self.flight
        guard.was_silent |= guard.is_silent(now_us)
        if guard.vehicle.armed is False and Trigger.DISARMED in TABLE[self.state]:
            return Transition(Trigger.DISARMED, "disarmed")
        if self.state in HOLDING:
            lost = self._taken_by_another(inputs) or silent_link(guard, now_us)
            if lost is not None:
                return Transition(Trigger.CONTROL_LOST, f"{lost}; the guard lets go and stands down")
        if inputs.refusal is not None:
            return Transition(Trigger.REFUSED, inputs.refusal)
        if (stopped := inputs.stop_reason or guard.fault) and Trigger.STOPPED in TABLE[self.state]:
            return Transition(Trigger.STOPPED, stopped)
        if self.state not in HOLDING:
            return self._link_restored(now_us)
        silent = silent_position(guard)
        return None if silent is None else Transition(Trigger.POSITION_SILENT, silent)

    def _taken_by_another(self, inputs: Inputs) -> str | None:
        guard = self.flight
        override, offboard = guard.vehicle.autopilot.stick_override, guard.vehicle.autopilot.setpoints
        if guard.sticks is not None and any(has_moved(guard.sticks, now, override) for now in inputs.sticks):
            return STICKS
        if self.state is State.GIVING_BACK and guard.vehicle.flies_setpoints:
            # Late: it was asked for, and given up.
            guard.expected_mode = offboard
        requested = guard.command_client.requested_mode
        if isinstance(self.handler, GiveBack):
            requested = self.handler.wish
        holder = taken_by(guard, requested)
        if holder is None:
            return None
        who = "a failsafe of the vehicle" if holder == "failsafe" else "the pilot or a program"
        return f"{who} took over in {guard.vehicle.mode_name}"

    def _link_restored(self, now_us: int) -> Transition | None:
        """What was restarted stands, or is being met; what flies has not forgotten what it was asked for."""
        guard = self.flight
        may_be_restarted = self.state is State.CONNECTING or guard.vehicle.armed is False
        if not may_be_restarted or guard.is_silent(now_us) or not guard.was_silent:
            return None
        return Transition(Trigger.STREAMS_GONE, LINK_RESTORED)

    def _begin(self, previous: State, transition: Transition, now_us: int) -> Handler:
        guard, trigger = self.flight, Trigger[transition.trigger.name]
        if transition.text:
            guard.report(now_us, _KINDS.get(trigger, "guard"), transition.text)
        guard.is_to_hold |= trigger in _TO_HOLD
        if self.state not in HOLDING:
            guard.command_client.cancel()
            guard.expected_mode = None
            if guard.collisions:
                guard.collisions[-1].is_over = True
        match self.state:
            case State.CONNECTING:
                guard.reflex.restart(now_us)
                guard.vehicle.attitude_parameters.clear()
                return GuardConnect(isinstance(self.handler, GuardConnect) and self.handler.is_first)
            case State.STANDING_BY:
                return StandBy()
            case State.WATCHING:
                return Watching()
            case State.TAKING_OVER:
                mode = "" if guard.previous_mode is None else guard.vehicle.autopilot.mode_name(guard.previous_mode)
                guard.report(now_us, "take_over", f"taking over from {mode}", mode=mode)
                return TakeOver(guard, now_us)
            case State.RECOVERING:
                return Recovering(guard)
            case State.GIVING_BACK:
                limit, hits = guard.config.max_hits, recoveries_from(guard.hits)
                if hits >= limit and not guard.is_to_hold:
                    guard.is_to_hold = True
                    if guard.config.then == "previous":
                        guard.report(now_us, "not_back", f"not given back: recovery {hits} of at most {limit}")
                return GiveBack(guard, now_us)
            case State.STOOD_DOWN:
                return StandDown(guard, transition.text.startswith(STICKS), now_us)
            case State.CRASHED:
                return Crashed(guard)
            case State.ENDED:
                guard.reason = transition.text
                return Released()


def has_moved(before: Sticks, now: Sticks, override: float) -> bool:
    """Have the pilot's sticks been moved, as far as the autopilot itself takes for a takeover? By PX4's default that
    ends AUTO modes and not OFFBOARD.

    A stick pushed to a new place counts; one let go does not: a pilot startled by a hit opens the hand. The throttle's
    middle is PX4's too; one that has no spring lies anywhere, and only its way from there counts.
    """
    return any(
        abs(deflection - was) > override and (place == THROTTLE or abs(deflection) > override)
        for place, (was, deflection) in enumerate(zip(before.deflections, now.deflections, strict=True))
    )
