"""Runs the state table: looks for triggers, moves between states, makes each state's activity."""

import traceback
from abc import ABC, abstractmethod
from collections.abc import Mapping
from dataclasses import dataclass
from enum import Enum
from typing import Any, ClassVar, TypeAlias

from companion.flight import expectations
from companion.flight.after_hit import decide, lands_anyway, note_before
from companion.flight.context import FlightContext, Inputs, Target, Transition
from companion.flight.handlers.connecting import Connect, Ready
from companion.flight.handlers.crash import Crashed, crashed
from companion.flight.handlers.ending import FOLLOWING, ON_THE_GROUND, HandOver, Released, early_end
from companion.flight.handlers.progress import FlyHome, FlyItems, HoldAfterRecovery
from companion.flight.handlers.recovering import Recover, record_collision
from companion.flight.handlers.takeoff_and_landing import Land, TakeBack, TakeOff
from companion.flight.obstacle_map import remember
from companion.flight.states import FINAL_STATES, IN_THE_AIR, TABLE, State, Trigger
from companion.mission.items import TakeoffItem


class StateMachine(ABC):
    """What a flight's and a guard's have in common. The same inputs always give the same moves."""

    program: ClassVar[str]
    table: ClassVar[Mapping[Any, Mapping[Any, Any]]]
    giving_away: ClassVar[tuple[Enum, ...]]
    """States in which the vehicle is given away already."""
    flight: FlightContext
    state: Enum
    handler: Any

    @property
    @abstractmethod
    def finished(self) -> bool:
        """Nothing is left to send."""

    @property
    def holds(self) -> bool:
        """Whether the vehicle flies, or is about to fly, by this program's setpoints; of a flight all are its own."""
        return True

    @abstractmethod
    def _begin(self, previous: Any, transition: Transition, now_us: int) -> Any:
        """What is done in the present state, which was entered by that transition."""

    @abstractmethod
    def _give_away(self, text: str, now_us: int) -> None:
        """Begin to give the vehicle away."""

    @abstractmethod
    def _release(self, text: str) -> None:
        """Even giving away fails: silence lets the vehicle's own failsafe act."""

    def fail(self, error: Exception, now_us: int) -> bool:
        """This program is at fault: give the vehicle away while that can still be done, and say what happened.

        Whether that is a move.
        """
        flight, before = self.flight, self.handler
        place = traceback.extract_tb(error.__traceback__)[-1]
        text = f"fault of the {self.program}, please report it: {type(error).__name__} in {place.name}: {error}"
        flight.report(now_us, "fault", text, traceback="".join(traceback.format_exception(error)))
        if flight.fault or self.state in self.giving_away:
            self._release(text)
        flight.fault = text
        try:
            self._give_away(text, now_us)
        except Exception as second:
            trace = "".join(traceback.format_exception(second))
            flight.report(now_us, "fault", f"and again: {second}", traceback=trace)
            self._release(text)
        return self.handler is not before

    def _take(self, transition: Transition | None, now_us: int) -> bool:
        """Whether it moves on. A trigger counts by its name: a guard takes a flight's, too."""
        if transition is None:
            return False
        ways = {trigger.name: state for trigger, state in self.table[self.state].items()}
        if transition.trigger.name not in ways:
            return False
        previous, self.state = self.state, ways[transition.trigger.name]
        self.handler = self._begin(previous, transition, now_us)
        return True

    def _take_all(self, transition: Transition | None, now_us: int) -> None:
        """That one and all that follow from it in this step."""
        while self._take(transition, now_us):
            # The answers and positions of this step belong to the state that asked for them.
            transition = self.handler.step(self.flight, Inputs(), now_us)


# What is done in a state; one object is made each time the state is entered. `step` does what is due and returns a
# transition when the state is over; `target` is the setpoint for now, None while none must be sent.
Handler: TypeAlias = (
    Connect | Ready | TakeOff | FlyItems | Recover | HoldAfterRecovery | FlyHome | Land | Crashed | Released | HandOver
)


@dataclass
class Machine(StateMachine):
    """The present state and what is being done in it."""

    program = "companion"
    table = TABLE
    giving_away = FINAL_STATES
    flight: FlightContext
    handler: Handler
    state: State = State.CONNECT
    away_us: int | None = None  # since when the vehicle has not followed, as far as that is dealt with

    @property
    def finished(self) -> bool:
        return isinstance(self.handler, Released | HandOver) and self.handler.finished

    def step(self, inputs: Inputs, now_us: int) -> bool:
        """Take all moves that are due; whether there were any."""
        flight, before = self.flight, self.handler
        if self.state not in FINAL_STATES and (end := early_end(flight, self.state, inputs, now_us)) is not None:
            self._take(end, now_us)
        if flight.foreign_mode_since_us != self.away_us and flight.has_position and self.state in FOLLOWING:
            self.away_us = flight.foreign_mode_since_us
            if self.away_us is not None:
                self._begin_here(now_us)
        if self.state in IN_THE_AIR and (crash := crashed(flight, self.state is State.LANDING, now_us)) is not None:
            self._take(crash, now_us)
        for estimate in inputs.impacts:
            if self.state in IN_THE_AIR and not lands_anyway(flight):
                if isinstance(self.handler, FlyItems):
                    self.handler.interrupt(flight)
                note_before(flight, self.state)
                record_collision(flight, estimate, now_us)
                decide(flight, self.state, now_us)
                self._take(Transition(Trigger.COLLISION), now_us)
        if (transition := self.handler.step(flight, inputs, now_us)) is not None:
            self._take_all(transition, now_us)
        # A hit may be taken back until its recovery is over.
        if flight.expectations and self.state is not State.RECOVERING:
            expectations.review(flight, now_us)
        return self.handler is not before

    def _begin_here(self, now_us: int) -> None:
        """Go on from where the vehicle is: it has stopped, and would chase its setpoint."""
        flight = self.flight
        if isinstance(self.handler, FlyItems):
            self.handler.interrupt(flight)
        flight.target = Target(flight.latest.position_ned_m, flight.yaw_rad)
        self.handler = self._begin(self.state, Transition(Trigger.LINK_RESTORED), now_us)

    def _give_away(self, text: str, now_us: int) -> None:
        self._take(Transition(Trigger.INTERRUPTED, text), now_us)

    def _release(self, text: str) -> None:
        self.handler = Released()
        if self.state not in FINAL_STATES or self.flight.outcome is None:
            self.state, self.flight.outcome, self.flight.reason = State.ABORTED, "failed", text

    def _begin(self, previous: State, transition: Transition, now_us: int) -> Handler:
        flight = self.flight
        if previous is State.RECOVERING:
            # Of a hit that has just come nothing is known yet but its first sample.
            remember(flight, len(flight.collisions) - (self.state is State.RECOVERING), now_us)
        match self.state:
            case State.CONNECT:
                # A plan that has been shown is made anew, and agreed to anew.
                flight.plan_confirmed &= previous is not State.READY
                flight.reflex.restart(now_us)
                flight.vehicle.attitude_parameters.clear()
                return Connect()
            case State.READY:
                return Ready(flight, now_us)
            case State.TAKEOFF:
                first = flight.steps[0].action
                assert isinstance(first, TakeoffItem), "the mission model sees to it"
                return TakeOff(flight, first, now_us)
            case State.MISSION:
                if previous is State.TAKEOFF:
                    flight.step_index = 1
                return FlyItems(flight, now_us)
            case State.RECOVERING:
                flies = flight.own_modes == (flight.vehicle.autopilot.setpoints, None)
                return Recover(flight) if flies else TakeBack(flight, now_us)
            case State.HOLDING:
                return HoldAfterRecovery(flight, now_us)
            case State.RETURNING:
                return FlyHome(flight, now_us)
            case State.LANDING:
                return Land(flight, now_us)
            case State.CRASHED:
                return Crashed(flight)
            case State.DONE:
                return self._done(now_us)
            case State.ABORTED:
                return self._aborted(previous, transition, now_us)

    def _done(self, now_us: int) -> Handler:
        flight = self.flight
        expectations.review(flight, now_us, is_over=True)
        failure = expectations.failure(flight)
        left = "" if flight.step.name in ("land", "return") else f"; not flown from item {flight.step.label} on"
        flight.outcome = "completed" if failure is None else "failed"
        flight.reason = failure or f"landed and disarmed{left}"
        count = len(flight.collisions)
        hits = {0: "no hit", 1: "1 hit"}.get(count, f"{count} hits")
        text = f"done: landed and disarmed, {hits}{left}"
        flight.report(now_us, "done", text, outcome=flight.outcome, reason=flight.reason)
        return Released()

    def _aborted(self, previous: State, transition: Transition, now_us: int) -> Handler:
        flight = self.flight
        flight.outcome = "failed" if transition.trigger is Trigger.REFUSED or flight.fault else "aborted"
        flight.reason = transition.text
        expectations.review(flight, now_us, is_over=True)
        text = f"{flight.outcome}: {transition.text}"
        flight.report(
            now_us, "aborted", text, outcome=flight.outcome, reason=flight.reason, next_step=flight.step.index
        )
        is_left = transition.is_left or previous in (*ON_THE_GROUND, State.CRASHED)
        return Released() if is_left else HandOver(flight, now_us)
