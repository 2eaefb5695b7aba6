"""The core of a flight: what of a step is its own, and what is done in which state (see flight.core)."""

from collections.abc import Callable, Mapping, Sequence
from enum import Enum
from typing import Any

from companion.flight import expectations
from companion.flight.after_hit import decide, lands_anyway, note_before
from companion.flight.context import FlightContext, Handler, Inputs, Target, Transition
from companion.flight.core import Core
from companion.flight.handlers.connecting import Connect, Ready
from companion.flight.handlers.crash import Crashed, crashed
from companion.flight.handlers.ending import FOLLOWING, ON_THE_GROUND, HandOver, Released, early_end
from companion.flight.handlers.progress import FlyHome, FlyItems, HoldAfterRecovery
from companion.flight.handlers.recovering import RecoverInOffboard, record_collision
from companion.flight.handlers.takeoff_and_landing import Land, TakeOff
from companion.flight.obstacle_map import remember
from companion.flight.states import FINAL_STATES, IN_THE_AIR, TABLE, State, Trigger
from companion.flight.vehicle_update import situation_of
from companion.messages import Sample
from companion.mission.model import Mission
from companion.reflex.detection.detector import Situation

# What is done in each state; for the ends DONE and ABORTED see `FlightCore._enter`.
HANDLERS: Mapping[State, Callable[[Any, int], Handler[Any]]] = {
    State.CONNECT: Connect,
    State.READY: Ready,
    State.TAKEOFF: TakeOff,
    State.MISSION: FlyItems,
    State.RECOVERING: RecoverInOffboard,
    State.HOLDING: HoldAfterRecovery,
    State.RETURNING: FlyHome,
    State.LANDING: Land,
    State.CRASHED: Crashed,
}
# What leads from a recovery back to each state; a climb goes on as the mission's first item.
_WAY_BACK: dict[State, Enum] = {State.TAKEOFF: Trigger.RECOVERED_TO_RETRY}
_WAY_BACK |= {state: trigger for trigger, state in TABLE[State.RECOVERING].items()}


class FlightCore(Core[FlightContext]):
    program = "companion"
    table = TABLE
    handlers = HANDLERS
    stopping = Trigger.INTERRUPTED
    failed = State.ABORTED
    state: State = State.CONNECT
    _away_us: int | None = None  # since when the vehicle has not followed, as far as that is dealt with

    def __init__(self, mission: Mission) -> None:
        super().__init__(FlightContext(mission))

    def situation(self) -> Situation:
        off_state = None if self.state in IN_THE_AIR else self.state.value
        return situation_of(self.flight, off_state, self.state is State.LANDING, is_held=True)

    def next_deadline_us(self) -> int:
        return super().next_deadline_us() if self.stop_reason is None else self.now_us

    def _act(self, samples: Sequence[Sample], inputs: Inputs, now_us: int) -> None:
        flight = self.flight
        # A stop is taken up once.
        self.stop_reason = None
        if self.state not in FINAL_STATES and (end := early_end(flight, self.state, inputs, now_us)) is not None:
            self._take(end, now_us)
        if flight.foreign_mode_since_us != self._away_us and flight.has_position and self.state in FOLLOWING:
            self._away_us = flight.foreign_mode_since_us
            if self._away_us is not None:
                # On from where the vehicle is: it has stopped, and would chase its setpoint.
                if isinstance(self.handler, FlyItems):
                    self.handler.interrupt(flight)
                flight.target = Target(flight.latest.position_ned_m, flight.yaw_rad)
                self.handler = self.handlers[self.state](flight, now_us)
        if self.state in IN_THE_AIR and (crash := crashed(flight, self.state is State.LANDING, now_us)) is not None:
            self._take(crash, now_us)
        for estimate in inputs.impacts:
            if self.state in IN_THE_AIR and not lands_anyway(flight):
                if isinstance(self.handler, FlyItems):
                    self.handler.interrupt(flight)
                note_before(flight, None if self.state is State.RECOVERING else Transition(_WAY_BACK[self.state]))
                record_collision(flight, estimate, now_us)
                decide(flight, self.state, now_us)
                self._take(Transition(Trigger.COLLISION), now_us)
        if (transition := self.handler.step(flight, inputs, now_us)) is not None:
            self._take_all(transition, now_us)
        # A hit may be taken back until its recovery is over.
        if flight.expectations and self.state is not State.RECOVERING:
            expectations.review(flight, now_us)

    def _enter(self, previous: State, transition: Transition, now_us: int) -> Handler[Any]:
        flight = self.flight
        if previous is State.RECOVERING:
            # Of a hit that has just come nothing is known yet but its first sample.
            remember(flight, len(flight.collisions) - (self.state is State.RECOVERING), now_us)
        if self.state is State.DONE:
            return self._done(now_us)
        if self.state is State.ABORTED:
            return self._aborted(previous, transition, now_us)
        if self.state is State.CONNECT:
            # A plan that has been shown is made anew, and agreed to anew.
            flight.plan_confirmed &= previous is not State.READY
        if previous is State.TAKEOFF and self.state is State.MISSION:
            flight.step_index = 1
        return self.handlers[self.state](flight, now_us)

    def _done(self, now_us: int) -> Handler[Any]:
        flight = self.flight
        expectations.review(flight, now_us, is_over=True)
        failure = expectations.failure(flight)
        left = "" if flight.step.item.name in ("land", "return") else f"; not flown from item {flight.step.label} on"
        flight.outcome = "completed" if failure is None else "failed"
        flight.reason = failure or f"landed and disarmed{left}"
        count = len(flight.collisions)
        hits = {0: "no hit", 1: "1 hit"}.get(count, f"{count} hits")
        text = f"done: landed and disarmed, {hits}{left}"
        flight.report(now_us, "done", text, outcome=flight.outcome, reason=flight.reason)
        return Released(flight, now_us)

    def _aborted(self, previous: State, transition: Transition, now_us: int) -> Handler[Any]:
        flight = self.flight
        flight.outcome = "failed" if transition.trigger is Trigger.REFUSED or flight.fault else "aborted"
        flight.reason = transition.text
        expectations.review(flight, now_us, is_over=True)
        text = f"{flight.outcome}: {transition.text}"
        flight.report(
            now_us, "aborted", text, outcome=flight.outcome, reason=flight.reason, next_step=flight.step.index
        )
        is_left = transition.is_left or previous in (*ON_THE_GROUND, State.CRASHED)
        return Released(flight, now_us) if is_left else HandOver(flight, now_us)
