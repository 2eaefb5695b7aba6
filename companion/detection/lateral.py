"""Detector `lateral`: specific force that the thrust cannot explain, because it is perpendicular to it.

By the paper's eq. 1 a free quadrotor's accelerometer shows thrust along body z, and on x and y only drag and
noise. A wall pushes sideways. The first sample with hypot(f_x, f_y) at or above the threshold is a hit.
"""

import math
from dataclasses import dataclass

from companion.detection.interface import DetectorState, Impact, Phase
from companion.messages import ImuSample, Vector3
from companion.written import Positive, Written


class LateralConfig(Written):
    """Settings of the detector `lateral`."""

    # Above the noise: HIGHRES_IMU noise of 0.25 m/s^2 RMS per axis and a drag of 0.22 m/s^2 per m/s stay below
    # 2.5 m/s^2 at 5 m/s and five sigma. Below the signal: eq. 2 begins with b_s * v_c = 30 m/s^2 at 1 m/s, of
    # which a 4 ms mean that saw the last millisecond shows 7.5. Airframes that vibrate need more: healthy
    # flights of four public PX4 logs peak at 7 to 11 m/s^2.
    threshold_m_s2: Positive = 4.0
    # A contact lasts 25 to 60 ms with the force present all through; this long without it, it is over.
    rearm_quiet_s: Positive = 0.04


@dataclass(frozen=True, slots=True)
class LateralState(DetectorState):
    """Nothing beyond what every detector shows."""


class LateralDetector:
    """See the module's text. Specific forces in FRD, m/s^2; times in the vehicle's boot clock."""

    name = "lateral"

    def __init__(self, config: LateralConfig, averaging_interval_us: int) -> None:
        self._threshold_m_s2 = config.threshold_m_s2
        self._rearm_quiet_us = round(config.rearm_quiet_s * 1e6)
        self._averaging_interval_us = averaging_interval_us

    def initial(self) -> LateralState:
        return LateralState()

    def step(
        self, state: LateralState, sample: ImuSample, off_reason: str | None
    ) -> tuple[LateralState, Impact | None]:
        now_us = sample.time_boot_us
        if off_reason is not None:
            if state.phase is Phase.OFF and state.off_reason == off_reason:
                return state, None
            return LateralState(Phase.OFF, off_reason, now_us), None
        f_x, f_y, _ = sample.specific_force_frd_m_s2
        lateral_m_s2 = math.hypot(f_x, f_y)
        if lateral_m_s2 < self._threshold_m_s2:
            return self._quiet(state, now_us), None
        return self._loud(state, now_us, (f_x, f_y, 0.0), lateral_m_s2)

    def _quiet(self, state: LateralState, now_us: int) -> LateralState:
        phase = state.phase
        if phase is Phase.OFF:
            return LateralState(Phase.QUIET, "", now_us, now_us)
        if phase is not Phase.ARMED and now_us - state.last_loud_boot_us >= self._rearm_quiet_us:
            phase = Phase.ARMED
        peak_m_s2, force_sum = state.peak_specific_force_m_s2, state.force_sum_frd_m_s2
        return LateralState(phase, "", now_us, state.last_loud_boot_us, peak_m_s2, force_sum)

    def _loud(
        self, state: LateralState, now_us: int, force_frd_m_s2: Vector3, lateral_m_s2: float
    ) -> tuple[LateralState, Impact | None]:
        if state.phase is Phase.ARMED:
            free_until_us = min(now_us - self._averaging_interval_us, state.last_sample_boot_us)
            impact = Impact(now_us, free_until_us, force_frd_m_s2)
            return LateralState(Phase.CONTACT, "", now_us, now_us, lateral_m_s2, force_frd_m_s2), impact
        if state.phase is Phase.CONTACT:
            peak_m_s2 = max(lateral_m_s2, state.peak_specific_force_m_s2)
            total, force = state.force_sum_frd_m_s2, force_frd_m_s2
            force_sum = (total[0] + force[0], total[1] + force[1], total[2] + force[2])
            return LateralState(Phase.CONTACT, "", now_us, now_us, peak_m_s2, force_sum), None
        return LateralState(Phase.QUIET, "", now_us, now_us), None
