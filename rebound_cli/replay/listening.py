"""What the companion's own detector makes of every sample: listened to while it is flown, or flown once more.

Nothing is judged or computed here: all numbers are the innovations that the detector publishes.
"""

import math
from array import array
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from functools import reduce
from typing import Any, TypeAlias, cast

import numpy as np
import numpy.typing as npt

from companion.messages import ImuSample, LocalPosition, Odometry, Sample
from companion.reflex.detection.detector import Detector, DetectorState, Evidence, Impact, Motion, Phase, Situation
from companion.reflex.detection.fused import FusedState
from companion.reflex.detection.monitor import CollisionMonitor

# Of one sample, or of many.
Numbers: TypeAlias = float | npt.NDArray[np.float64]

PHASES = tuple(Phase)
_NUMBERS = {phase: float(number) for number, phase in enumerate(PHASES)}

# What is tested of an IMU sample: f_x and f_y, and f_z outside what propellers can do, negative inside, m/s^2; and the
# rates' jump, rad/s of yaw. And of a velocity: its jump, m/s.
FORCES, JUMPS = ("side", "beyond", "turn"), ("jump",)


@dataclass(frozen=True, slots=True)
class Tested:
    """Samples or velocities, with the phase before their test. NaN where the detector does not say."""

    time_boot_us: Numbers
    phase: Numbers  # its place in PHASES
    signs: Mapping[str, tuple[Numbers, Numbers]]  # each innovation and its limit

    def ratio_of(self, sign: str) -> Numbers:
        value, limit = self.signs[sign]
        return value / limit

    @property
    def ratio(self) -> Numbers:
        """The largest: one shows a contact from 1 on. NaN where nothing is known."""
        ratios: Numbers = reduce(np.fmax, map(self.ratio_of, self.signs))
        return ratios

    @property
    def is_armed(self) -> npt.NDArray[np.bool_]:
        return np.equal(self.phase, PHASES.index(Phase.ARMED))


@dataclass(frozen=True, slots=True)
class Rows:
    """Grows with the recording, in the order heard."""

    signs: Sequence[str]
    numbers: "array[float]" = field(default_factory=lambda: array("d"))

    def all(self) -> Tested:
        return self._tested(np.array(self.numbers).reshape(-1, 2 + 2 * len(self.signs)).T)

    def one(self, row: int) -> Tested:
        columns = 2 + 2 * len(self.signs)
        begin = columns * row % len(self.numbers)
        return self._tested(self.numbers[begin : begin + columns])

    def _tested(self, columns: Iterable[Any]) -> Tested:
        time_boot_us, phase, *tested = columns
        innovations = zip(tested[::2], tested[1::2], strict=True)
        return Tested(time_boot_us, phase, dict(zip(self.signs, innovations, strict=True)))


@dataclass(frozen=True, slots=True)
class Listener:
    """`shown`: by the boot time of an impact, what the detector went by when it fired, the sample or the velocity, and
    whether a hand was thinkable.
    """

    forces: Rows = field(default_factory=lambda: Rows(FORCES))
    velocities: Rows = field(default_factory=lambda: Rows(JUMPS))
    shown: dict[int, tuple[Tested, bool]] = field(default_factory=dict)

    def listen(self, monitor: CollisionMonitor) -> None:
        """To this watch, from now on."""
        monitor.detector = cast(Detector, _ListenedTo(monitor.detector, self))


class _ListenedTo:
    def __init__(self, detector: Detector, listener: Listener) -> None:
        self._detector, self._listener = detector, listener
        self.name, self.losses = detector.name, detector.losses

    def step(self, state: DetectorState, sample: Sample, situation: Situation, motion: Motion) -> Impact | None:
        phase = _NUMBERS[state.phase]
        impact = self._detector.step(state, sample, situation, motion)
        if isinstance(sample, ImuSample):
            self._listener.forces.numbers.extend((sample.time_boot_us, phase, *_forces(state)))
        elif isinstance(sample, LocalPosition | Odometry) and isinstance(state, FusedState):
            jump = state.velocity
            if math.isfinite(jump.limit):
                self._listener.velocities.numbers.extend((sample.time_boot_us, phase, jump.value, jump.limit))
        if impact is not None:
            self._listener.shown[impact.sample_time_boot_us] = self._shown(state, impact)
        return impact

    def _shown(self, state: DetectorState, impact: Impact) -> tuple[Tested, bool]:
        if impact.evidence is Evidence.VELOCITY_JUMP:
            return self._listener.velocities.one(-1), False
        is_soft = isinstance(state, FusedState) and state.may_be_hand(impact.sample_time_boot_us)
        return self._listener.forces.one(-1), is_soft


def _forces(s: DetectorState) -> tuple[float, ...]:
    """Innovations and limits of the newest sample."""
    if not isinstance(s, FusedState):
        return math.nan, s.threshold_m_s2, math.nan, s.threshold_m_s2, math.nan, math.nan
    return s.side.value, s.side.limit, s.vertical.value, s.vertical.limit, s.turn.value, s.turn.limit
