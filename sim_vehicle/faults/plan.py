"""All faults of a flight but the wire's: before each interval they write what disturbs it."""

from collections.abc import Sequence
from typing import Protocol

import numpy as np

from sim_vehicle.airframe import Airframe
from sim_vehicle.faults.body import Hands, Load, Motors, Pushes
from sim_vehicle.faults.estimate import Estimate
from sim_vehicle.faults.sensor import InertialSensor, Shaking
from sim_vehicle.faults.spec import (
    AidingLoss,
    BatterySag,
    EstimatorAfterClipping,
    EstimatorReset,
    Fault,
    FreeFall,
    Gust,
    HandCatch,
    ImuBias,
    ImuStuck,
    Moment,
    MotorFailure,
    PayloadDrop,
    Push,
    Turbulence,
    Vibration,
)
from sim_vehicle.faults.wind import Air
from sim_vehicle.physics.layout import Disturbance, State
from sim_vehicle.truth import FaultSpan
from sim_vehicle.world import Vector3

# So that faults draw their own numbers: a flight with a fault that does nothing is the flight without it.
_OWN_SEED = 0xFA17


class Act(Protocol):
    """One group of faults that disturb the same things."""

    def act(self, time_s: float, state: State, disturbance: Disturbance) -> None:
        """Write what holds for the interval that begins at ``time_s``."""


class Faults:
    """The faults of one flight and their state. The same seed gives the same faults."""

    def __init__(self, faults: Sequence[Fault], airframe: Airframe, wind_ned_m_s: Vector3, seed: int) -> None:
        rng = np.random.default_rng((seed, _OWN_SEED))
        step_s = 1e-6 * airframe.imu.integration_interval_us
        raw = airframe.imu.integration_interval_us // airframe.imu.raw_interval_us
        self._faults = faults
        self._shaking = Shaking([fault for fault in faults if isinstance(fault, Vibration)])
        self._rng = rng
        winds = [fault for fault in faults if isinstance(fault, Gust | Turbulence)]
        motors = [fault for fault in faults if isinstance(fault, MotorFailure | FreeFall | BatterySag)]
        drops = [fault for fault in faults if isinstance(fault, PayloadDrop)]
        pushes = [fault for fault in faults if isinstance(fault, Push)]
        catches = [fault for fault in faults if isinstance(fault, HandCatch)]
        sensor = [fault for fault in faults if isinstance(fault, ImuBias | ImuStuck)]
        shaken = [fault for fault in faults if isinstance(fault, Vibration)]
        estimate = [
            fault for fault in faults if isinstance(fault, EstimatorReset | EstimatorAfterClipping | AidingLoss)
        ]
        self._motors = Motors(motors)
        self._estimate = Estimate(estimate, airframe.estimate.kind == "markov", step_s, rng)
        groups: tuple[tuple[Sequence[Fault], Act], ...] = (
            (winds, Air(winds, wind_ned_m_s, step_s, rng)),
            (motors, self._motors),
            (drops, Load(drops)),
            (pushes, Pushes(pushes)),
            (catches, Hands(catches)),
            (sensor, InertialSensor(sensor, raw)),
            (shaken, self._shaking),
            (estimate, self._estimate),
        )
        self._acts = tuple(act for members, act in groups if members)
        self._ahead = sorted((time_s, index) for index, fault in enumerate(faults) for time_s in _turns_s(fault))
        self._spans: dict[int, int] = {}
        self.spans: list[FaultSpan] = []

    @property
    def reset_counter(self) -> int:
        """How often faults have made the estimate jump."""
        return self._estimate.reset_counter

    @property
    def voltage_share(self) -> float:
        """What is left of the supply's voltage."""
        return self._motors.voltage_share

    def begin(self, state: State) -> None:
        """Write what is different from the start on."""
        self._shaking.scatter(state, self._rng)

    def before(self, state: State, disturbance: Disturbance) -> None:
        """Write what holds for the interval that begins now, and note what has begun and ended."""
        time_us = int(state.time_us)
        time_s = time_us / 1e6
        while self._ahead and self._ahead[0][0] <= time_s:
            self._note(self._ahead.pop(0)[1], time_us)
        for act in self._acts:
            act.act(time_s, state, disturbance)

    def is_lost(self, sensor: str, time_s: float) -> bool:
        """Whether an aiding sensor is lost at a time."""
        return any(
            isinstance(fault, AidingLoss) and fault.sensor == sensor and fault.window_s[0] <= time_s < fault.window_s[1]
            for fault in self._faults
        )

    def _note(self, index: int, time_us: int) -> None:
        fault = self._faults[index]
        if index in self._spans:
            began = self.spans[self._spans[index]]
            self.spans[self._spans[index]] = FaultSpan(began.kind, began.began_at_boot_us, time_us, began.details)
            return
        self._spans[index] = len(self.spans)
        ended_us = time_us if isinstance(fault, Moment) else None
        details = fault.model_dump(mode="json", exclude={"kind", "at_s", "between_s"}, exclude_none=True)
        self.spans.append(FaultSpan(fault.kind, time_us, ended_us, details))


def _turns_s(fault: Fault) -> tuple[float, ...]:
    """When a fault begins and, if it does, ends."""
    return fault.window_s[:1] if isinstance(fault, Moment) else fault.window_s


def with_losses(airframe: Airframe, faults: Sequence[Fault]) -> Airframe:
    """The airframe whose own filter goes without the sensors that faults take away, while they do."""
    losses = [fault for fault in faults if isinstance(fault, AidingLoss) and fault.sensor != "gps"]
    if not losses:
        return airframe
    sensors = airframe.sensors
    for loss in losses:
        aid = getattr(sensors, loss.sensor)
        planned = aid.model_copy(update={"lost_between_s": (*aid.lost_between_s, loss.window_s)})
        sensors = sensors.model_copy(update={loss.sensor: planned})
    return airframe.model_copy(update={"sensors": sensors})
