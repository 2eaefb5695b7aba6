"""All faults of a flight but the wire's: before each interval they write what disturbs it."""

import math
from collections.abc import Callable, Sequence
from dataclasses import replace
from typing import Any

import numpy as np

from sim_vehicle.airframe import Airframe
from sim_vehicle.faults import spec
from sim_vehicle.faults.body import InertialSensor, Load, Motors, Pushes, Shaking
from sim_vehicle.faults.estimate import Estimate
from sim_vehicle.faults.spec import Fault
from sim_vehicle.faults.wind import Air
from sim_vehicle.physics.layout import Disturbance, PlantState
from sim_vehicle.quantities import Vector3
from sim_vehicle.truth import FaultSpan

# So that faults draw their own numbers: a flight with a fault that does nothing is the flight without it.
_OWN_SEED = 0xFA17


class Faults:
    """The faults of one flight and their state. The same seed gives the same faults."""

    def __init__(
        self, faults: Sequence[Fault], airframe: Airframe, wind_ned_m_s: Vector3, seed: int, state: PlantState
    ) -> None:
        rng = np.random.default_rng((seed, _OWN_SEED))
        step_s = 1e-6 * airframe.imu.integration_interval_us
        raw = airframe.imu.integration_interval_us // airframe.imu.raw_interval_us
        self._rotors = airframe.rotor_count
        shaking, self.motors = Shaking(airframe.rotor_count), Motors()
        self.estimate = Estimate(airframe.estimate.kind == "markov", step_s, rng)
        # Which group takes which faults, in the order in which they write.
        self._groups: tuple[tuple[tuple[type[Any], ...], Any], ...] = (
            ((spec.Gust, spec.Turbulence), Air(wind_ned_m_s, step_s, rng)),
            ((spec.MotorFailure, spec.FreeFall, spec.BatterySag), self.motors),
            ((spec.PayloadDrop,), Load()),
            ((spec.Push,), Pushes()),
            ((spec.ImuBias, spec.ImuStuck), InertialSensor(raw)),
            ((spec.Vibration,), shaking),
            ((spec.EstimatorReset, spec.EstimatorAfterClipping, spec.AidingLoss), self.estimate),
        )
        self.acts: list[Callable[[float, PlantState, Disturbance], None]] = []
        """Empty while there was never a fault; then the notes, and the groups that ever had one of theirs."""
        self.known: list[Fault] = []
        """Those that act, have acted or will."""
        self._turns_at_s = math.inf
        """When the next of them begins or ends."""
        self._span_of: dict[int, int] = {}
        self.spans: list[FaultSpan] = []
        for fault in faults:
            self.add(fault)
        shaking.scatter(state, rng)

    def add(self, fault: Fault) -> None:
        """Add a fault. It acts in its own window of the boot clock. Raises FaultError for a motor that is not there."""
        spec.check_motor(fault, self._rotors)
        self.known.append(fault)
        self._turns_at_s = min(self._turns_at_s, fault.window_s[0])
        for kinds, group in self._groups:
            if isinstance(fault, kinds):
                group.add(fault)
        self.acts = [self._note, *(group.act for _, group in self._groups if group.had_any)]

    def remove(self, fault: Fault, time_us: int) -> None:
        """The very fault that was added is over, or never comes."""
        self.known = [kept for kept in self.known if kept is not fault]
        self._end(fault, time_us)
        # Another may get the number that Python knew it by.
        self._span_of.pop(id(fault), None)
        for kinds, group in self._groups:
            if isinstance(fault, kinds):
                group.remove(fault)

    def before(self, state: PlantState, disturbance: Disturbance) -> None:
        """Write what holds for the interval that begins now, and note what has begun and ended."""
        time_s = int(state.time_us) / 1e6
        for act in self.acts:
            act(time_s, state, disturbance)

    def gps_is_lost(self, time_s: float) -> bool:
        """At that time."""
        return any(isinstance(fault, spec.AidingLoss) for fault in self.estimate.acting(time_s))

    def _note(self, time_s: float, state: PlantState, disturbance: Disturbance) -> None:
        if time_s < self._turns_at_s:
            return
        time_us = int(state.time_us)
        for fault in self.known:
            start_s, end_s = fault.window_s
            if start_s <= time_s and id(fault) not in self._span_of:
                self._span_of[id(fault)] = len(self.spans)
                details = fault.model_dump(mode="json", exclude={"kind", "at_s", "between_s"}, exclude_none=True)
                self.spans.append(FaultSpan(fault.kind, time_us, None, details))
            if end_s <= time_s or (start_s <= time_s and isinstance(fault, spec.Moment)):
                self._end(fault, time_us)
        ahead = (turn_s for fault in self.known for turn_s in fault.window_s if turn_s > time_s)
        self._turns_at_s = min(ahead, default=math.inf)

    def _end(self, fault: Fault, time_us: int) -> None:
        index = self._span_of.get(id(fault))
        if index is not None and self.spans[index].ended_at_boot_us is None:
            self.spans[index] = replace(self.spans[index], ended_at_boot_us=time_us)
