"""The guard's core: what of a step is its own, and what is done in which state (see flight.core)."""

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from typing import Any

from companion.flight.after_hit import note_before
from companion.flight.context import Handler, Inputs, Transition
from companion.flight.core import Core
from companion.flight.handlers.crash import Crashed, crashed
from companion.flight.handlers.ending import LINK_RESTORED, Released, silent_link, silent_position, taken_by
from companion.flight.handlers.recovering import Recover, record_collision
from companion.flight.vehicle_update import situation_of
from companion.guard.config import GuardConfig
from companion.guard.context import GuardContext
from companion.guard.holding import GiveBack, StandDown, TakeOver, lead_into, stop
from companion.guard.states import HOLDING, MAY_CRASH, TABLE, State, Trigger
from companion.guard.watching import THROTTLE, GuardConnect, StandBy, Watching, goes_down, observe, why_not
from companion.messages import Asked, LandedState, Sample, Sticks, TimeSync
from companion.motion.vector import plus
from companion.reflex.detection.detector import ImpactKind, Situation
from companion.reflex.recovery.collision import CollisionReport

# What is told of a move that has a story.
_KINDS = {
    Trigger.CONTROL_LOST: "let_go",
    Trigger.NOT_CONFIRMED: "refused",
    Trigger.POSITION_SILENT: "link",
    Trigger.LEADS_BACK: "take_over",
    Trigger.WORTH_GUARDING: "watching",
    Trigger.ENABLED: "enabled",
    Trigger.STREAMS_GONE: "link",
    Trigger.STOPPED: "stopped",
    Trigger.REFUSED: "ended",
}
STICKS = "the pilot moved the sticks"
# After these the vehicle is given back to hold whatever is configured.
_TO_HOLD = (Trigger.STOPPED, Trigger.NOT_CONFIRMED, Trigger.POSITION_SILENT)
# What is done in each state; a pilot's is begun with more, see `GuardCore._enter`.
HANDLERS: Mapping[State, Callable[[Any, int], Handler[Any]]] = {
    State.CONNECTING: GuardConnect,
    State.STANDING_BY: StandBy,
    State.WATCHING: Watching,
    State.TAKING_OVER: TakeOver,
    State.RECOVERING: Recover[GuardContext],
    State.GIVING_BACK: GiveBack,
    State.CRASHED: Crashed,
    State.ENDED: Released,
}


class GuardCore(Core[GuardContext]):
    program = "guard"
    table = TABLE
    handlers = HANDLERS
    stopping = Trigger.STOPPED
    failed = State.ENDED
    state: State = State.CONNECTING
    is_enabled = False  # asked for, and not yet taken up
    _judged: Asked | None = None  # the program's setpoint that was last looked at

    def __init__(self, config: GuardConfig) -> None:
        super().__init__(GuardContext(config.as_mission(), config=config, keeps_others_out=bool(config.between)))

    @property
    def holds(self) -> bool:
        hands_over = self.state is State.STOOD_DOWN and self.handler.target(self.flight, self.now_us) is not None
        return self.state in HOLDING or hands_over

    @property
    def _setpoint_hz(self) -> float:
        return super()._setpoint_hz if self.holds else self.flight.config.lead_hz

    def situation(self) -> Situation:
        """Ground, take-off and landing look like a hit. Whoever flies may go down, while the guard does not."""
        guard, state, holds = self.flight, self.state, self.holds
        off_state = None if state is State.WATCHING or state in HOLDING else why_not(guard) or state.value
        return situation_of(guard, off_state, not holds and goes_down(guard, self.now_us), holds)

    def collisions(self) -> tuple[CollisionReport, ...]:
        """All so far, in the vehicle's present local frame."""
        shift = self.resets.shift_ned_m
        return tuple(
            replace(
                hit,
                position_ned_m=plus(hit.position_ned_m, 1.0, shift),
                recovery_setpoint_ned_m=plus(hit.recovery_setpoint_ned_m, 1.0, shift),
            )
            for hit in super().collisions()
        )

    @property
    def begins_in_flight(self) -> bool:
        """Whether a guard in between has met no vehicle before, and this one may fly by a program's setpoints."""
        guard, handler = self.flight, self.handler
        is_unfit = guard.vehicle.identity is not None and isinstance(handler, GuardConnect) and handler.is_told
        begins = self.state is State.CONNECTING and not (guard.was_met or is_unfit)
        return begins and bool(guard.config.between) and not guard.has_stood

    def _hear(self, samples: Sequence[Sample], now_us: int) -> str | None:
        if self.flight.keeps_others_out:
            # A program behind the guard answers, by its own clock: two answers are two times.
            samples = [one for one in samples if not isinstance(one, TimeSync) or one.answered_ns is not None]
        return observe(self.flight, samples, now_us)

    def _act(self, samples: Sequence[Sample], inputs: Inputs, now_us: int) -> None:
        guard = self.flight
        sticks = [sample for sample in samples if isinstance(sample, Sticks)]
        if sticks:
            # Where nobody had a stick in hand before the hit, the first of afterwards.
            guard.sticks = guard.sticks or sticks[0] if self.state in HOLDING else sticks[-1]
        inputs = inputs._replace(is_enabled=self.is_enabled)
        guard.awaits_choice &= not self.is_enabled
        self.is_enabled, held = False, self.holds
        if (move := self._from_outside(inputs, sticks, now_us)) is not None:
            self._take(move, now_us)
        if self.state in MAY_CRASH:
            meant = self.state not in HOLDING and goes_down(guard, now_us)
            if (crash := crashed(guard, meant, now_us)) is not None:
                self._take(crash, now_us)
        for estimate in inputs.impacts:
            if estimate.impact.kind is ImpactKind.CRASH and self.state not in HOLDING:
                continue  # a wreck is not taken over
            if self._is_beside_program():
                guard.left_alone += 1
                text = f"hit at {math.hypot(*estimate.velocity_ned_m_s):.2f} m/s left to the program that flies"
                guard.report(now_us, "left_alone", text, impact_velocity_ned_m_s=estimate.velocity_ned_m_s)
            elif Trigger.HIT in TABLE[self.state]:
                if self.state is State.WATCHING:
                    self._remember_mode()
                is_first = self.state in (State.WATCHING, State.GIVING_BACK)
                note_before(guard, guard.after_recovery if is_first else None)
                record_collision(guard, estimate, now_us)
                self._take(Transition(Trigger.HIT), now_us)
        self._take_all(self._led_back() or self.handler.step(guard, inputs, now_us), now_us)
        self._await_choice(held, now_us)

    def _is_beside_program(self) -> bool:
        """A program on another link goes on sending, in whatever mode; two streams would fight for the vehicle."""
        guard, is_watching = self.flight, self.state is State.WATCHING
        flies = is_watching and guard.vehicle.flies_setpoints and not guard.keeps_others_out
        return flies or (guard.program_elsewhere and (is_watching or self.state is State.GIVING_BACK))

    def _led_back(self) -> Transition | None:
        """A program that was given back to, and would hit the same again."""
        guard, asked = self.flight, self.flight.asked
        was_given = guard.config.then == "previous" and guard.hits and guard.vehicle.flies_setpoints
        if self.state is not State.WATCHING or not was_given or asked is self._judged:
            return None
        self._judged = asked
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

    def _from_outside(self, inputs: Inputs, sticks: Sequence[Sticks], now_us: int) -> Transition | None:
        """What ends a state whatever is being done in it; the pilot's before all others, but for a disarm."""
        guard = self.flight
        guard.was_silent |= guard.is_silent(now_us)
        if guard.vehicle.armed is False and Trigger.DISARMED in TABLE[self.state]:
            return Transition(Trigger.DISARMED, "disarmed")
        if self.state in HOLDING:
            lost = self._taken_by_another(sticks) or silent_link(guard, now_us)
            if lost is not None:
                return Transition(Trigger.CONTROL_LOST, f"{lost}; the guard lets go and stands down")
        if inputs.refusal is not None:
            return Transition(Trigger.REFUSED, inputs.refusal)
        gives_back = self.state is State.GIVING_BACK and guard.is_to_hold
        if (stopped := inputs.stop_reason or guard.fault) and Trigger.STOPPED in TABLE[self.state] and not gives_back:
            return Transition(Trigger.STOPPED, stopped)
        if self.state not in HOLDING:
            # What was restarted stands, or is being met; what flies has not forgotten what it was asked for.
            may_be_restarted = self.state is State.CONNECTING or guard.vehicle.armed is False
            is_back = may_be_restarted and guard.was_silent and not guard.is_silent(now_us)
            return Transition(Trigger.STREAMS_GONE, LINK_RESTORED) if is_back else None
        silent = silent_position(guard)
        return None if silent is None else Transition(Trigger.POSITION_SILENT, silent)

    def _taken_by_another(self, sticks: Sequence[Sticks]) -> str | None:
        guard = self.flight
        override, offboard = guard.vehicle.autopilot.stick_override, guard.vehicle.autopilot.setpoints
        if guard.sticks is not None and any(has_moved(guard.sticks, now, override) for now in sticks):
            return STICKS
        if self.state is State.GIVING_BACK and guard.vehicle.flies_setpoints:
            # Late: it was asked for, and given up.
            guard.expected_mode = offboard
        requested = guard.command_client.requested_mode
        if isinstance(self.handler, GiveBack):
            requested = self.handler.wish
        return taken_by(guard, requested, "the pilot or a program")

    def _enter(self, previous: State, transition: Transition, now_us: int) -> Handler[Any]:
        guard, trigger = self.flight, Trigger[transition.trigger.name]
        if transition.text:
            guard.report(now_us, _KINDS.get(trigger, "guard"), transition.text)
        guard.is_to_hold |= trigger in _TO_HOLD
        for_sticks, asked = transition.text.startswith(STICKS), guard.command_client.requested_mode
        if self.state not in HOLDING:
            if for_sticks and asked == guard.vehicle.autopilot.setpoints:
                guard.count_asked_mode()
            guard.command_client.cancel()
            guard.expected_mode = None
            if guard.collisions:
                guard.collisions[-1].is_over = True
        if self.state is State.STOOD_DOWN:
            return StandDown(guard, for_sticks, now_us)
        if self.state is State.ENDED:
            guard.reason = transition.text
        return self.handlers[self.state](guard, now_us)

    def _await_choice(self, held: bool, now_us: int) -> None:
        """Keep a program's setpoints out until somebody chooses a mode: after a restart of the guard, and where it has
        released a vehicle that flies setpoints on.

        A program that flew into something would do it again by itself, and nobody would notice a hit.
        """
        guard, vehicle, why = self.flight, self.flight.vehicle, ""
        if vehicle.armed is False or vehicle.is_mode_chosen:
            guard.awaits_choice = False
        elif held and self.state is State.STOOD_DOWN and not self.holds:
            why = "the guard has released the vehicle" if guard.keeps_others_out and vehicle.flies_setpoints else ""
        elif self.begins_in_flight and vehicle.armed and vehicle.landed is not LandedState.UNDEFINED:
            why = "begun in flight"
        if why and not guard.awaits_choice:
            guard.awaits_choice = True
            guard.report(now_us, "not_back", f"{why}: a program's setpoints are kept out until somebody chooses a mode")


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
