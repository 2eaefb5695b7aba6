"""What the companion's own detector makes of every sample: listened to while it is flown, or flown once more.

Nothing is judged or computed here: all numbers are the innovations that the detector publishes.
"""

import math
from array import array
from collections.abc import Mapping
from dataclasses import dataclass, field, fields
from typing import Any, TypeAlias, cast

import numpy as np
import numpy.typing as npt

from companion.messages import ImuSample, LocalPosition, MessageId, Odometry, Sample
from companion.reflex.detector import Detector, DetectorState, Evidence, Impact, Phase, Situation
from companion.reflex.fused import FusedState
from companion.reflex.monitor import CollisionMonitor

# Of one sample, or of many.
Numbers: TypeAlias = float | npt.NDArray[np.float64]

PHASES = tuple(Phase)
_NUMBERS = {phase: float(number) for number, phase in enumerate(PHASES)}


@dataclass(frozen=True, slots=True)
class Tested:
    """IMU samples, m/s^2, with the phase before their test. `beyond_thrust_m_s2`: f_z outside what propellers can do;
    negative inside. NaN where the detector does not say.
    """

    time_boot_us: Numbers
    phase: Numbers  # its place in PHASES
    side_m_s2: Numbers
    side_threshold_m_s2: Numbers
    beyond_thrust_m_s2: Numbers
    beyond_threshold_m_s2: Numbers

    @property
    def side_ratio(self) -> Numbers:
        return self.side_m_s2 / self.side_threshold_m_s2

    @property
    def beyond_ratio(self) -> Numbers:
        return self.beyond_thrust_m_s2 / self.beyond_threshold_m_s2

    @property
    def ratio(self) -> Numbers:
        """The larger of both: a sample shows a contact from 1 on. NaN where nothing is known."""
        return np.fmax(self.side_ratio, self.beyond_ratio)


@dataclass(frozen=True, slots=True)
class TestedVelocity:
    """Velocity jumps, m/s, with the phase before their test."""

    time_boot_us: Numbers
    phase: Numbers  # its place in PHASES
    jump_m_s: Numbers
    jump_threshold_m_s: Numbers

    @property
    def ratio(self) -> Numbers:
        """A velocity shows a contact from 1 on."""
        return self.jump_m_s / self.jump_threshold_m_s


@dataclass(frozen=True, slots=True)
class Shown:
    """What the detector went by when it fired: the sample, or the velocity, and whether a hand was thinkable."""

    tested: Tested | TestedVelocity
    may_be_hand: bool


_COLUMNS, _VELOCITY_COLUMNS = len(fields(Tested)), len(fields(TestedVelocity))


@dataclass(slots=True)
class Listener:
    """Grows with the recording, by six numbers a sample and four a velocity. `shown`: by the boot time of an impact."""

    numbers: "array[float]" = field(default_factory=lambda: array("d"))
    velocity_numbers: "array[float]" = field(default_factory=lambda: array("d"))
    shown: dict[int, Shown] = field(default_factory=dict)

    @property
    def tested(self) -> Tested:
        """All samples, in the order heard."""
        return Tested(*np.array(self.numbers).reshape(-1, _COLUMNS).T)

    @property
    def tested_velocity(self) -> TestedVelocity:
        """All velocities that could be compared, in the order heard."""
        return TestedVelocity(*np.array(self.velocity_numbers).reshape(-1, _VELOCITY_COLUMNS).T)

    def one_tested(self, row: int) -> Tested:
        return Tested(*_row(self.numbers, row, _COLUMNS))

    def one_velocity(self, row: int) -> TestedVelocity:
        return TestedVelocity(*_row(self.velocity_numbers, row, _VELOCITY_COLUMNS))

    def listen(self, monitor: CollisionMonitor) -> None:
        """To this watch, from now on."""
        monitor.detector = cast(Detector[Any], _ListenedTo(monitor.detector, self))


def _row(numbers: "array[float]", row: int, columns: int) -> "array[float]":
    begin = columns * row % len(numbers)
    return numbers[begin : begin + columns]


class _ListenedTo:
    """A detector with a listener."""

    losses: Mapping[MessageId, str]

    def __init__(self, detector: Detector[Any], listener: Listener) -> None:
        self._detector, self._listener = detector, listener
        self.name, self.losses = detector.name, detector.losses

    def initial(self) -> DetectorState:
        state: DetectorState = self._detector.initial()
        return state

    def step(self, state: DetectorState, sample: Sample, situation: Situation) -> tuple[DetectorState, Impact | None]:
        phase = _NUMBERS[state.phase]
        state, impact = self._detector.step(state, sample, situation)
        if isinstance(sample, ImuSample):
            self._listener.numbers.extend((sample.time_boot_us, phase, *_forces(state)))
        elif isinstance(sample, LocalPosition | Odometry) and isinstance(state, FusedState):
            jump = state.velocity
            if math.isfinite(jump.limit):
                self._listener.velocity_numbers.extend((sample.time_boot_us, phase, jump.value, jump.limit))
        if impact is not None:
            self._listener.shown[impact.sample_time_boot_us] = self._shown(state, impact)
        return state, impact

    def _shown(self, state: DetectorState, impact: Impact) -> Shown:
        if impact.evidence is Evidence.VELOCITY_JUMP:
            return Shown(self._listener.one_velocity(-1), False)
        is_soft = isinstance(state, FusedState) and state.may_be_hand(impact.sample_time_boot_us)
        return Shown(self._listener.one_tested(-1), is_soft)


def _forces(state: DetectorState) -> tuple[float, ...]:
    """Innovations and limits of the newest sample."""
    if not isinstance(state, FusedState):
        return math.nan, state.threshold_m_s2, math.nan, state.threshold_m_s2
    return state.side.value, state.side.limit, state.vertical.value, state.vertical.limit
