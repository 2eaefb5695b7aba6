"""Detector `lateral`: specific force that the thrust cannot explain, because it is perpendicular to it.

By the paper's eq. 1 a free quadrotor's accelerometer shows thrust along body z, and on x and y only drag and
noise. A wall pushes sideways. The first sample whose sideways force departs from its running mean (the drag) by
the threshold or more is a hit.

Not of an article: this project's own, so that the paper's studies have a detector on the accelerometer alone. Checked
against nobody's program.
"""

import math
from collections.abc import Mapping
from dataclasses import dataclass
from typing import ClassVar

from bench.baselines.noise import NoiseFloor
from companion.messages import ImuSample, MessageId, Sample, Vector3
from companion.reflex.detector import DetectorState, Impact, Phase, Situation
from companion.strict_model import Positive, StrictModel
from rebound_cli.logs.shaking import MEMORY_US


class LateralConfig(StrictModel):
    """Settings of the detector `lateral`."""

    # Above the noise of a quiet vehicle: the simulated HIGHRES_IMU's 0.25 m/s^2 RMS per axis stays below 1.5 at
    # six sigma, and drag changes by less than 1.1 within the mean's memory. Below the signal: eq. 2 begins with
    # b_s * v_c = 30 m/s^2 at 1 m/s, of which a 4 ms mean that saw the last millisecond shows 7.5.
    threshold_m_s2: Positive = 4.0
    # A vehicle that shakes more gets a higher threshold: this many times the spread it shows in its own flight.
    # Of samples with a normal spread not one in 10^8 is beyond six; four public PX4 logs of healthy flights, with
    # spreads of 1.2 to 4 m/s^2, stay below five but for one sample.
    noise_factor: Positive = 6.0
    # A contact lasts 20 to 120 ms with the force present all through; this long without it, it is over.
    rearm_quiet_s: Positive = 0.04


NOTHING_LEARNT = NoiseFloor()


@dataclass(slots=True)
class LateralState(DetectorState):
    """Adds what the detector has learnt of the vehicle's own shaking."""

    noise: NoiseFloor = NOTHING_LEARNT


class LateralDetector:
    """See the module's text. Specific forces in FRD, m/s^2; times in the vehicle's boot clock."""

    name = "lateral"
    losses: ClassVar[Mapping[MessageId, str]] = {}

    def __init__(self, config: LateralConfig, averaging_interval_us: int) -> None:
        self._config = config
        self._rearm_quiet_us = round(config.rearm_quiet_s * 1e6)
        self._averaging_interval_us = averaging_interval_us

    def initial(self) -> LateralState:
        return LateralState(threshold_m_s2=self._config.threshold_m_s2)

    def step(self, state: LateralState, sample: Sample, situation: Situation) -> tuple[LateralState, Impact | None]:
        if not isinstance(sample, ImuSample):
            return state, None
        f_x, f_y, _ = sample.specific_force_frd_m_s2
        if situation.off_reason is not None:
            return self._off(state, sample.time_boot_us, situation.off_reason, f_x, f_y), None
        x, y = f_x - state.noise.mean_x_m_s2, f_y - state.noise.mean_y_m_s2
        departure_m_s2 = math.hypot(x, y)
        if departure_m_s2 < state.threshold_m_s2:
            return self._quiet(state, sample.time_boot_us, f_x, f_y), None
        return self._loud(state, sample.time_boot_us, (x, y, 0.0), departure_m_s2)

    def _off(self, state: LateralState, now_us: int, off_reason: str, f_x: float, f_y: float) -> LateralState:
        """Not wanted, but learning: the spread must be known when the detector is switched on."""
        noise, threshold_m_s2 = self._learnt(state, now_us, f_x, f_y)
        return LateralState(Phase.OFF, off_reason, now_us, threshold_m_s2=threshold_m_s2, noise=noise)

    def _quiet(self, state: LateralState, now_us: int, f_x: float, f_y: float) -> LateralState:
        noise, threshold_m_s2 = self._learnt(state, now_us, f_x, f_y)
        phase, last_loud_us = state.phase, state.last_loud_boot_us
        if phase is Phase.OFF:
            phase, last_loud_us = Phase.QUIET, now_us
        elif phase is not Phase.ARMED and now_us - last_loud_us >= self._rearm_quiet_us:
            phase = Phase.ARMED
        return LateralState(phase, "", now_us, last_loud_us, state.peak_specific_force_m_s2, threshold_m_s2, noise)

    def _learnt(self, state: LateralState, now_us: int, f_x: float, f_y: float) -> tuple[NoiseFloor, float]:
        """The noise floor with this sample, and the threshold that follows from it."""
        # A gap says nothing about what was in it: a sample after one weighs as one sample.
        elapsed_us = min(max(now_us - state.last_sample_boot_us, 0), MEMORY_US // 10)
        noise = state.noise.learn(f_x, f_y, elapsed_us)
        return noise, max(self._config.threshold_m_s2, self._config.noise_factor * noise.spread_m_s2)

    def _loud(
        self, state: LateralState, now_us: int, force_frd_m_s2: Vector3, departure_m_s2: float
    ) -> tuple[LateralState, Impact | None]:
        if state.phase is Phase.ARMED:
            free_until_us = min(now_us - self._averaging_interval_us, state.last_sample_boot_us)
            impact = Impact(now_us, free_until_us, force_frd_m_s2)
            return self._in_contact(state, now_us, departure_m_s2), impact
        if state.phase is Phase.CONTACT:
            return self._in_contact(state, now_us, max(departure_m_s2, state.peak_specific_force_m_s2)), None
        # Switched on in the middle of a shake: it is learnt too, or a threshold that is too low would never rise.
        x, y, _ = force_frd_m_s2
        noise, threshold_m_s2 = self._learnt(state, now_us, x + state.noise.mean_x_m_s2, y + state.noise.mean_y_m_s2)
        return LateralState(Phase.QUIET, "", now_us, now_us, threshold_m_s2=threshold_m_s2, noise=noise), None

    @staticmethod
    def _in_contact(state: LateralState, now_us: int, peak_m_s2: float) -> LateralState:
        return LateralState(Phase.CONTACT, "", now_us, now_us, peak_m_s2, state.threshold_m_s2, state.noise)
