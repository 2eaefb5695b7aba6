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

    def __init__(self, faults: Sequence[Fault], airframe: Airframe, wind_ned_m_s: Vector3, seed: int) -> None:
        rng = np.random.default_rng((seed, _OWN_SEED))
        step_s = 1e-6 * airframe.imu.integration_interval_us
        raw = airframe.imu.integration_interval_us // airframe.imu.raw_interval_us
        self._rng, self._rotors = rng, airframe.rotor_count
        self._shaking, self._motors = Shaking(airframe.rotor_count), Motors()
        self._estimate = Estimate(airframe.estimate.kind == "markov", step_s, rng)
        # Which group takes which faults, in the order in which they write.
        self._groups: tuple[tuple[tuple[type[Any], ...], Any], ...] = (
            ((spec.Gust, spec.Turbulence), Air(wind_ned_m_s, step_s, rng)),
            ((spec.MotorFailure, spec.FreeFall, spec.BatterySag), self._motors),
            ((spec.PayloadDrop,), Load()),
            ((spec.Push,), Pushes()),
            ((spec.ImuBias, spec.ImuStuck), InertialSensor(raw)),
            ((spec.Vibration,), self._shaking),
            ((spec.EstimatorReset, spec.EstimatorAfterClipping, spec.AidingLoss), self._estimate),
        )
        self._acts: list[Callable[[float, PlantState, Disturbance], None]] = []
        self._faults: list[Fault] = []
        self._turns_at_s = math.inf
        """When the next of them begins or ends."""
        self._span_of: dict[int, int] = {}
        self.spans: list[FaultSpan] = []
        for fault in faults:
            self.add(fault)

    def add(self, fault: Fault) -> None:
        """Add a fault. It acts in its own window of the boot clock. Raises FaultError for a motor that is not there."""
        spec.check_motor(fault, self._rotors)
        self._faults.append(fault)
        self._turns_at_s = min(self._turns_at_s, fault.window_s[0])
        for kinds, group in self._groups:
            if isinstance(fault, kinds):
                group.add(fault)
        # A group that never had a fault has nothing to write.
        self._acts = [group.act for _, group in self._groups if group.had_any]

    def remove(self, fault: Fault, time_us: int) -> None:
        """The very fault that was added is over, or never comes."""
        self._faults = [kept for kept in self._faults if kept is not fault]
        self._end(fault, time_us)
        # Another may get the number that Python knew it by.
        self._span_of.pop(id(fault), None)
        for kinds, group in self._groups:
            if isinstance(fault, kinds):
                group.remove(fault)

    @property
    def reset_counter(self) -> int:
        """How often faults have made the estimate jump."""
        return self._estimate.reset_counter

    @property
    def voltage_share(self) -> float:
        """What is left of the supply's voltage."""
        return self._motors.voltage_share

    def begin(self, state: PlantState) -> None:
        """Write what is different from the start on."""
        self._shaking.scatter(state, self._rng)

    def before(self, state: PlantState, disturbance: Disturbance) -> None:
        """Write what holds for the interval that begins now, and note what has begun and ended."""
        time_us = int(state.time_us)
        time_s = time_us / 1e6
        if time_s >= self._turns_at_s:
            self._note(time_s, time_us)
        for act in self._acts:
            act(time_s, state, disturbance)

    def gps_is_lost(self, time_s: float) -> bool:
        """At that time."""
        return any(isinstance(fault, spec.AidingLoss) for fault in self._estimate.acting(time_s))

    def _note(self, time_s: float, time_us: int) -> None:
        for fault in self._faults:
            start_s, end_s = fault.window_s
            if start_s <= time_s and id(fault) not in self._span_of:
                self._span_of[id(fault)] = len(self.spans)
                details = fault.model_dump(mode="json", exclude={"kind", "at_s", "between_s"}, exclude_none=True)
                self.spans.append(FaultSpan(fault.kind, time_us, None, details))
            if end_s <= time_s or (start_s <= time_s and isinstance(fault, spec.Moment)):
                self._end(fault, time_us)
        ahead = (turn_s for fault in self._faults for turn_s in fault.window_s if turn_s > time_s)
        self._turns_at_s = min(ahead, default=math.inf)

    def _end(self, fault: Fault, time_us: int) -> None:
        index = self._span_of.get(id(fault))
        if index is not None and self.spans[index].ended_at_boot_us is None:
            self.spans[index] = replace(self.spans[index], ended_at_boot_us=time_us)
