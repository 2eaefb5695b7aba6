"""The guard's core: what of a step is the guard's own (see companion.core)."""

from collections.abc import Sequence
from dataclasses import replace

from companion.core import Core
from companion.flight.context import Inputs
from companion.flight.vehicle_update import situation_of
from companion.guard.config import GuardConfig
from companion.guard.context import GuardContext
from companion.guard.machine import GuardMachine
from companion.guard.states import HOLDING, State
from companion.guard.watching import GuardConnect, goes_down, observe, why_not
from companion.messages import LandedState, Sample, Sticks, TimeSync
from companion.motion.resets import Resets
from companion.motion.vector import plus
from companion.reflex.detection.detector import Situation
from companion.reflex.recovery.collision import CollisionReport


class GuardCore(Core[GuardContext, GuardMachine]):
    def __init__(self, config: GuardConfig) -> None:
        guard = GuardContext(config.as_mission(), config=config, keeps_others_out=bool(config.between))
        super().__init__(guard, GuardMachine(guard, GuardConnect()))
        self.is_enabled = False  # asked for, and not yet taken up

    @property
    def _is_active(self) -> bool:
        return self.machine.state is not State.CONNECTING

    @property
    def _setpoint_hz(self) -> float:
        return super()._setpoint_hz if self.machine.holds else self.flight.config.lead_hz

    def situation(self) -> Situation:
        """Ground, take-off and landing look like a hit. Whoever flies may go down, while the guard does not."""
        guard, state, holds = self.flight, self.machine.state, self.machine.holds
        off_state = None if state is State.WATCHING or state in HOLDING else why_not(guard) or state.value
        return situation_of(guard, off_state, not holds and goes_down(guard, self.now_us), holds)

    def _hear(self, samples: Sequence[Sample], now_us: int) -> str | None:
        if self.flight.keeps_others_out:
            # A program behind the guard answers, by its own clock: two answers are two times.
            samples = [one for one in samples if not isinstance(one, TimeSync) or one.answered_ns is not None]
        return observe(self.flight, samples, now_us)

    def _act(self, samples: Sequence[Sample], inputs: Inputs, now_us: int) -> bool:
        guard = self.flight
        sticks = [sample for sample in samples if isinstance(sample, Sticks)]
        if sticks and self.machine.state not in HOLDING:
            guard.sticks = sticks[-1]
        elif sticks and guard.sticks is None:
            # Nobody had a stick in hand before the hit.
            guard.sticks = sticks[0]
        if guard.vehicle.armed is False and self.resets.has_shifted:
            # It may restart, and count its resets from zero.
            self.resets = Resets()
        inputs = inputs._replace(sticks=sticks, is_enabled=self.is_enabled)
        guard.awaits_choice &= not self.is_enabled
        self.is_enabled, held = False, self.machine.holds
        moved = self.machine.step(inputs, now_us)
        self._await_choice(held, now_us)
        return moved

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
        guard, handler = self.flight, self.machine.handler
        is_first = isinstance(handler, GuardConnect) and handler.begins
        return is_first and bool(guard.config.between) and not guard.has_stood

    def _await_choice(self, held: bool, now_us: int) -> None:
        """A program that flew into something would do it again by itself, and nobody would notice a hit: after a
        restart of the guard, and where it has released a vehicle that flies setpoints on.
        """
        guard, vehicle = self.flight, self.flight.vehicle
        releases = held and not self.machine.holds and self.machine.state is State.STOOD_DOWN
        if vehicle.armed is False or vehicle.is_mode_chosen:
            guard.awaits_choice = False
        elif releases and guard.keeps_others_out and vehicle.flies_setpoints:
            guard.await_choice("the guard has released the vehicle", now_us)
        elif self.begins_in_flight and vehicle.armed and vehicle.landed is not LandedState.UNDEFINED:
            guard.await_choice("begun in flight", now_us)
