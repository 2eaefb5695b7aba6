"""What the companion's own detector makes of every IMU sample: listened to while it is flown, or flown once more.

Nothing is judged here: all numbers are the detector's state and the answers of its own functions.
"""

import math
from array import array
from collections.abc import Mapping
from dataclasses import dataclass, field, fields
from typing import Any, TypeAlias, cast

import numpy as np
import numpy.typing as npt

from companion.messages import ImuSample, MessageId, Sample
from companion.reflex.detector import Detector, DetectorState, Impact, Phase, Situation
from companion.reflex.fused import FusedState
from companion.reflex.monitor import CollisionMonitor

# Of one sample, or of many.
Numbers: TypeAlias = float | npt.NDArray[np.float64]

PHASES = tuple(Phase)
_NUMBERS = {phase: float(number) for number, phase in enumerate(PHASES)}


@dataclass(frozen=True, slots=True)
class Tested:
    """IMU samples just before their test, m/s^2. `beyond_thrust_m_s2`: f_z outside what propellers can do; negative
    inside. NaN where the detector does not say.
    """

    time_boot_us: Numbers
    phase: Numbers  # its place in PHASES
    side_m_s2: Numbers
    side_threshold_m_s2: Numbers
    beyond_thrust_m_s2: Numbers
    beyond_threshold_m_s2: Numbers

    @property
    def ratio(self) -> Numbers:
        """The larger of both over its threshold: a sample shows a contact from 1 on. NaN where nothing is known."""
        side, beyond = self.side_m_s2 / self.side_threshold_m_s2, self.beyond_thrust_m_s2 / self.beyond_threshold_m_s2
        return np.fmax(side, beyond)


@dataclass(frozen=True, slots=True)
class Shown:
    """What the detector went by when it fired: the sample, if it was one, and whether a hand was thinkable."""

    tested: Tested | None
    may_be_hand: bool


_COLUMNS = len(fields(Tested))


@dataclass(slots=True)
class Listener:
    """Grows with the recording, by six numbers a sample. `shown` by the boot time of the impact's sample."""

    numbers: "array[float]" = field(default_factory=lambda: array("d"))
    shown: dict[int, Shown] = field(default_factory=dict)

    @property
    def tested(self) -> Tested:
        """All samples, in the order heard."""
        return Tested(*np.array(self.numbers).reshape(-1, _COLUMNS).T)

    def one_tested(self, row: int) -> Tested:
        return Tested(*self.numbers[_COLUMNS * row : _COLUMNS * (row + 1)])

    def listen(self, monitor: CollisionMonitor) -> None:
        """To this watch, from now on."""
        listened_to = _ListenedTo(monitor.detector, getattr(monitor.config, monitor.config.detector), self)
        monitor.detector = cast(Detector[Any], listened_to)


class _ListenedTo:
    """A detector with a listener."""

    losses: Mapping[MessageId, str]

    def __init__(self, detector: Detector[Any], config: Any, listener: Listener) -> None:
        self._detector, self._config, self._listener = detector, config, listener
        self.name, self.losses = detector.name, detector.losses

    def initial(self) -> DetectorState:
        state: DetectorState = self._detector.initial()
        return state

    def step(self, state: DetectorState, sample: Sample, situation: Situation) -> tuple[DetectorState, Impact | None]:
        tested, is_soft = None, False
        if isinstance(sample, ImuSample):
            tested = _tested(state, sample, self._config)
            self._listener.numbers.extend(tested)
            is_soft = isinstance(state, FusedState) and state.may_be_hand(sample.time_boot_us)
        state, impact = self._detector.step(state, sample, situation)
        if impact is not None:
            one = None if tested is None else Tested(*tested)
            self._listener.shown[impact.sample_time_boot_us] = Shown(one, is_soft)
        return state, impact


def _tested(state: DetectorState, sample: ImuSample, config: Any) -> tuple[float, ...]:
    """Its row of numbers."""
    now_us, phase = sample.time_boot_us, _NUMBERS[state.phase]
    if not isinstance(state, FusedState):
        threshold_m_s2 = state.threshold_m_s2
        return now_us, phase, math.nan, threshold_m_s2, math.nan, threshold_m_s2
    force = sample.specific_force_frd_m_s2
    threshold_m_s2 = state.side_threshold_m_s2(config, sample.angular_velocity_frd_rad_s)
    side_m_s2, thresholds, _ = state.side_force(config, force)
    return (
        now_us,
        phase,
        side_m_s2,
        thresholds * threshold_m_s2,
        max(force[2], -force[2] - state.thrust.most_m_s2),
        state.vertical_threshold_m_s2(config),
    )
