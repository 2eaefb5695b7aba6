"""Detector `lateral`: specific force that the thrust cannot explain, because it is perpendicular to it.

By the paper's eq. 1 a free quadrotor's accelerometer shows thrust along body z, and on x and y only drag and
noise. A wall pushes sideways. The first sample whose sideways force departs from its running mean (the drag) by
the threshold or more is a hit.

Not of an article: this project's own, so that the paper's studies have a detector on the accelerometer alone. Checked
against nobody's program.
"""

import math
from dataclasses import dataclass

from bench.detectors.contact import Baseline, judge
from companion.messages import ImuSample, Sample
from companion.reflex.detector import DetectorState, Impact, Phase, Situation
from rebound_cli.logs.shaking import MEMORY_US

# A vehicle that shakes more gets a higher threshold: this many times the spread it shows in its own flight.
# Of samples with a normal spread not one in 10^8 is beyond six; four public PX4 logs of healthy flights, with
# spreads of 1.2 to 4 m/s^2, stay below five but for one sample.
NOISE_FACTOR = 6.0


@dataclass(slots=True)
class LateralState(DetectorState):
    """Adds what the vehicle shakes: exponentially weighted mean (m/s^2) and variance of f_x and f_y, body FRD."""

    mean_x_m_s2: float = 0.0
    mean_y_m_s2: float = 0.0
    variance_x: float = 0.0
    variance_y: float = 0.0
    known_for_us: int = 0

    @property
    def spread_m_s2(self) -> float:
        """Standard deviation on the noisier axis."""
        return math.sqrt(max(self.variance_x, self.variance_y))

    def learn(self, f_x_m_s2: float, f_y_m_s2: float, elapsed_us: int) -> None:
        """One more sample, so long after the last; the first ones count as a plain mean."""
        self.known_for_us = min(self.known_for_us + elapsed_us, MEMORY_US)
        share = min(1.0, elapsed_us / self.known_for_us) if self.known_for_us > 0 else 1.0
        x, y = f_x_m_s2 - self.mean_x_m_s2, f_y_m_s2 - self.mean_y_m_s2
        keep = 1.0 - share
        self.mean_x_m_s2 += share * x
        self.mean_y_m_s2 += share * y
        self.variance_x = keep * (self.variance_x + share * x * x)
        self.variance_y = keep * (self.variance_y + share * y * y)


class LateralDetector(Baseline):
    """See the module's text. Specific forces in FRD, m/s^2; times in the vehicle's boot clock."""

    name, state = "lateral", LateralState

    def step(self, state: LateralState, sample: Sample, situation: Situation) -> tuple[LateralState, Impact | None]:
        if not isinstance(sample, ImuSample):
            return state, None
        now_us, (f_x, f_y, _) = sample.time_boot_us, sample.specific_force_frd_m_s2
        x, y = f_x - state.mean_x_m_s2, f_y - state.mean_y_m_s2
        size, off = math.hypot(x, y), situation.off_reason
        free_until_us = min(now_us - self._averaging_us, state.last_sample_boot_us)
        # A gap says nothing about what was in it: a sample after one weighs as one sample.
        elapsed_us = min(max(now_us - state.last_sample_boot_us, 0), MEMORY_US // 10)
        is_loud = size >= state.threshold_m_s2
        impact = judge(state, now_us, free_until_us, (x, y, 0.0), size, is_loud, off)
        # Also while it is off, for the spread must be known when it is switched on, and in a shake in which it was: a
        # threshold that is too low would never rise.
        if not is_loud or state.phase is not Phase.CONTACT:
            state.learn(f_x, f_y, elapsed_us)
            state.threshold_m_s2 = max(self._least_m_s2, NOISE_FACTOR * state.spread_m_s2)
        return state, impact
