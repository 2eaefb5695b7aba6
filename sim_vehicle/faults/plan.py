"""All faults of a flight but the wire's: before each interval they write what disturbs it."""

from bisect import insort
from collections.abc import Callable, Sequence
from dataclasses import replace
from typing import Any

import numpy as np

from sim_vehicle.airframe import Airframe
from sim_vehicle.faults import spec
from sim_vehicle.faults.body import Hands, InertialSensor, Load, Motors, Pushes, Shaking
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
            ((spec.HandCatch,), Hands()),
            ((spec.ImuBias, spec.ImuStuck), InertialSensor(raw)),
            ((spec.Vibration,), self._shaking),
            ((spec.EstimatorReset, spec.EstimatorAfterClipping, spec.AidingLoss), self._estimate),
        )
        self._acts: list[Callable[[float, PlantState, Disturbance], None]] = []
        self._faults: dict[int, Fault] = {}
        self._count = 0
        self._ahead: list[tuple[float, int]] = []
        self._spans: dict[int, int] = {}
        self.spans: list[FaultSpan] = []
        for fault in faults:
            self.add(fault)

    def add(self, fault: Fault) -> None:
        """Add a fault. It acts in its own window of the boot clock. Raises FaultError for a motor that is not there."""
        spec.check_motor(fault, self._rotors)
        number, self._count = self._count, self._count + 1
        self._faults[number] = fault
        for time_s in _turns_s(fault):
            insort(self._ahead, (time_s, number))
        for kinds, group in self._groups:
            if isinstance(fault, kinds):
                group.add(fault)
        # A group that never had a fault has nothing to write.
        self._acts = [group.act for _, group in self._groups if group.had_any]

    def remove(self, fault: Fault, time_us: int) -> None:
        """The very fault that was added is over, or never comes."""
        number = next(number for number, known in self._faults.items() if known is fault)
        del self._faults[number]
        self._ahead = [(time_s, other) for time_s, other in self._ahead if other != number]
        if number in self._spans:
            self._end(self._spans[number], time_us)
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
        while self._ahead and self._ahead[0][0] <= time_s:
            self._note(self._ahead.pop(0)[1], time_us)
        for act in self._acts:
            act(time_s, state, disturbance)

    def gps_is_lost(self, time_s: float) -> bool:
        """At that time."""
        return any(
            isinstance(fault, spec.AidingLoss) and fault.window_s[0] <= time_s < fault.window_s[1]
            for fault in self._faults.values()
        )

    def _note(self, number: int, time_us: int) -> None:
        if number in self._spans:
            self._end(self._spans[number], time_us)
            return
        fault = self._faults[number]
        self._spans[number] = len(self.spans)
        ended_us = time_us if isinstance(fault, spec.Moment) else None
        details = fault.model_dump(mode="json", exclude={"kind", "at_s", "between_s"}, exclude_none=True)
        self.spans.append(FaultSpan(fault.kind, time_us, ended_us, details))

    def _end(self, index: int, time_us: int) -> None:
        if self.spans[index].ended_at_boot_us is None:
            self.spans[index] = replace(self.spans[index], ended_at_boot_us=time_us)


def _turns_s(fault: Fault) -> tuple[float, ...]:
    """When a fault begins and, if it does, ends."""
    return fault.window_s[:1] if isinstance(fault, spec.Moment) else fault.window_s
