"""What the companion's own detector makes of every IMU sample: listened to while a recording goes through it again.

Nothing is judged here: all numbers are the detector's state and the answers of its own functions.
"""

import math
from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any, cast

from companion.detection.force_signs import side_threshold_m_s2, vertical_threshold_m_s2
from companion.detection.fused_state import FusedState
from companion.detection.interface import Detector, DetectorState, Impact, Phase, Situation
from companion.messages import ImuSample, MessageId, Sample
from companion.reflex.monitor import CollisionMonitor


@dataclass(frozen=True, slots=True)
class Tested:
    """One IMU sample just before its test, m/s^2. `beyond_thrust_m_s2`: f_z outside what propellers can do; negative
    inside. NaN where the detector does not say.
    """

    time_boot_us: int
    phase: Phase
    side_m_s2: float
    side_threshold_m_s2: float
    beyond_thrust_m_s2: float
    beyond_threshold_m_s2: float

    @property
    def ratio(self) -> float:
        """The larger of both over its threshold: a sample shows a contact from 1 on. NaN where nothing is known."""
        side, beyond = self.side_m_s2 / self.side_threshold_m_s2, self.beyond_thrust_m_s2 / self.beyond_threshold_m_s2
        return max(side, beyond)


@dataclass(frozen=True, slots=True)
class Shown:
    """What the detector went by when it fired: the sample, if it was one, and whether a hand was thinkable."""

    tested: Tested | None
    may_be_hand: bool


@dataclass(slots=True)
class Listener:
    """Grows with the recording. `shown` by the boot time of the impact's sample."""

    tested: list[Tested] = field(default_factory=list)
    shown: dict[int, Shown] = field(default_factory=dict)

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
        tested, may_be_hand = None, False
        if isinstance(sample, ImuSample):
            tested = _tested(state, sample, self._config)
            self._listener.tested.append(tested)
            may_be_hand = isinstance(state, FusedState) and state.soft.may_be_hand(sample.time_boot_us)
        state, impact = self._detector.step(state, sample, situation)
        if impact is not None:
            self._listener.shown[impact.sample_time_boot_us] = Shown(tested, may_be_hand)
        return state, impact


def _tested(state: DetectorState, sample: ImuSample, config: Any) -> Tested:
    if not isinstance(state, FusedState):
        threshold_m_s2 = state.threshold_m_s2
        return Tested(sample.time_boot_us, state.phase, math.nan, threshold_m_s2, math.nan, threshold_m_s2)
    f_x, f_y, f_z = sample.specific_force_frd_m_s2
    return Tested(
        sample.time_boot_us,
        state.phase,
        math.hypot(f_x - state.floor.x, f_y - state.floor.y),
        side_threshold_m_s2(state, config, sample.angular_velocity_frd_rad_s),
        max(f_z, -f_z - state.thrust.most_m_s2(sample.time_boot_us)),
        vertical_threshold_m_s2(state, config),
    )
