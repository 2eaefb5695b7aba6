"""A velocity jump: a step in the vehicle's velocity that the accelerometer did not show.

Between two velocities the vehicle's estimate changes as the integrated accelerometer does (see `motion.strapdown`).
A contact between two received samples, or in a lost one, changes the estimate only.
"""

import math
from collections.abc import Iterable, Sequence
from dataclasses import dataclass, field
from itertools import pairwise

from companion.messages import Vector3
from companion.motion.config import MEMORY
from companion.motion.delay import Delay
from companion.motion.strapdown import VelocityFix
from companion.motion.vector import ZERO, along, plus
from companion.reflex import config as reflex


@dataclass(slots=True)
class VelocityJump:
    """Changed only by its methods. Times: vehicle's boot clock; vectors local NED."""

    averaging_us: int
    since_us: int = 0  # velocities before this time are not compared
    delay: Delay = field(default_factory=Delay)
    variance_m2_s2: float = 0.0
    known: int = 0
    newest: tuple[Vector3, Vector3] = (ZERO, ZERO)
    """The newest step without correction for the delay, and the change of the acceleration."""
    compared_us: Sequence[int] = ()  # times of the velocities that make it, the newest last

    def step_m_s(self, fixes: Sequence[VelocityFix]) -> Vector3 | None:
        """Difference of the newest velocity from the recent ones and the accelerometer, m/s; None if not comparable."""
        if len(fixes) < reflex.COMPARED + 2:
            return None
        recent = [fixes[place] for place in range(-reflex.COMPARED - 2, 0)]
        times = [fix.time_boot_us for fix in recent]
        if recent[-1].velocity_ned_m_s == recent[-2].velocity_ned_m_s:
            # Equal to the last digit: the estimator is not running, and restarts after this.
            self.since_us = times[-1]
        apart_us = [b - a for a, b in pairwise(times)]
        if times[0] < self.since_us or min(apart_us) <= 0 or max(apart_us) > reflex.LONGEST_STEP_US:
            return None
        step = _newest_less_mean(fix.less_sum_m_s for fix in recent[1:])
        # Mean accelerations between velocities, without vibration.
        pairs = zip(pairwise(recent), apart_us, strict=True)
        change = _newest_less_mean(_rate(b.sum_ned_m_s, a.sum_ned_m_s, 1e-6 * us) for (a, b), us in pairs)
        self.newest, self.compared_us = (step, change), times[1:]
        return plus(step, self.delay.found_s(self.variance_m2_s2)[0], change)

    def learn(self, step: Vector3) -> None:
        """Learn delay and standard deviation from the newest step, limited to what is no hit."""
        self.delay.learn(*self.newest)
        square = along(step, step) / 3.0
        self.known = min(self.known + 1, MEMORY)
        self.variance_m2_s2 += (square - self.variance_m2_s2) / self.known

    def least_m_s(self, config: reflex.FusedConfig, caution: float, shaking_m_s2: float, apart_us: int) -> float:
        """The step, m/s, that is a hit; infinite before the first step.

        It is `noise_factor` spreads, and more after few steps, by Student's t (its quantile, expanded in 1 / degrees of
        freedom). Each has three axes, and shares velocities with those around it: four are worth as much as one. It is
        larger by `caution` where the estimate may jump without a hit, and by vibration between the samples (standard
        deviation `shaking_m_s2`), of whose newest interval of `apart_us` an averaging window covers a part.
        """
        if not self.known:
            return math.inf
        spreads, spread_m_s = config.noise_factor, reflex.EXCESS * math.sqrt(self.variance_m2_s2)
        noise_m_s = spreads * spread_m_s * (1.0 + (spreads * spreads + 1.0) / (3.0 * self.known))
        unseen_share = max(0.0, 1.0 - self.averaging_us / max(apart_us, 1))
        unseen_m_s = shaking_m_s2 * (reflex.SHAKEN_S * unseen_share + reflex.STAMP_S)
        return caution * max(config.velocity_step_m_s, noise_m_s) + unseen_m_s


def _rate(a: Vector3, b: Vector3, seconds: float) -> Vector3:
    return ((a[0] - b[0]) / seconds, (a[1] - b[1]) / seconds, (a[2] - b[2]) / seconds)


def _newest_less_mean(vectors: Iterable[Vector3]) -> Vector3:
    """The last vector less the mean of those before it."""
    x, y, z = (newest - sum(before) / reflex.COMPARED for *before, newest in zip(*vectors, strict=True))
    return (x, y, z)
