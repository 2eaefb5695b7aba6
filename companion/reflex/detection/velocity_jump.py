"""A velocity jump: a step in the vehicle's velocity that the accelerometer did not show.

Between two velocities the vehicle's estimate changes as the integrated accelerometer does (see `motion.strapdown`). A
contact between two received samples, or in a lost one, changes the estimate only. A force beside the centre makes the
body rates jump, too. A rate jump alone is no evidence: a failed motor turns the vehicle as well.
"""

import math
from collections.abc import Iterable, Sequence
from dataclasses import dataclass, field
from itertools import pairwise

from companion.messages import Vector3
from companion.motion.config import LONGEST_GAP_US, YAW_SHARE
from companion.motion.delay import Delay
from companion.motion.strapdown import VelocityFix
from companion.motion.vector import ZERO, along, minus, plus
from companion.reflex.config import (
    COMPARED,
    LONGEST_STEP_US,
    MEMORY,
    NO_MOTORS_RAD_S2,
    RISE,
    SHAKEN_S,
    STAMP_S,
    TURNED_SHARE,
    TURNED_US,
    FusedConfig,
)


@dataclass(slots=True)
class VelocityJump:
    """Changed only by its methods. Times: vehicle's boot clock; vectors local NED."""

    averaging_us: int
    rates_frd_rad_s: Vector3 = ZERO
    rate_step_frd_rad_s: Vector3 = ZERO
    rate_step_over_us: int = 0
    rate_step_until_us: int = 0
    since_us: int = 0
    """Velocities before this time are not compared."""
    delay: Delay = field(default_factory=Delay)
    variance_m2_s2: float = 0.0
    known: int = 0
    unseen_share: float = 0.0
    """Share of the newest interval between samples that no averaging window covers."""
    newest: tuple[Vector3, Vector3] = (ZERO, ZERO)
    """The newest step without correction for the delay, and the change of the acceleration."""

    def imu(self, before_us: int, time_us: int, rates_frd_rad_s: Vector3) -> None:
        """Take one sample; the one before it was at `before_us`."""
        elapsed_us = time_us - before_us
        if 0 < elapsed_us < LONGEST_GAP_US:
            self.unseen_share = max(0.0, 1.0 - self.averaging_us / elapsed_us)
            step = math.dist(rates_frd_rad_s, self.rates_frd_rad_s)
            if step > math.hypot(*self.rate_step_frd_rad_s) or time_us - self.rate_step_until_us > TURNED_US:
                self.rate_step_frd_rad_s = minus(rates_frd_rad_s, self.rates_frd_rad_s)
                self.rate_step_over_us, self.rate_step_until_us = elapsed_us, time_us
        self.rates_frd_rad_s = rates_frd_rad_s

    def step_m_s(self, fixes: Sequence[VelocityFix]) -> Vector3 | None:
        """Difference of the newest velocity from the recent ones and the accelerometer, m/s; None if not comparable."""
        if len(fixes) < COMPARED + 2:
            return None
        recent = [fixes[place] for place in range(-COMPARED - 2, 0)]
        times = [fix.time_boot_us for fix in recent]
        if recent[-1].velocity_ned_m_s == recent[-2].velocity_ned_m_s:
            # Equal to the last digit: the estimator is not running, and restarts after this.
            self.since_us = times[-1]
        apart_us = [b - a for a, b in pairwise(times)]
        if times[0] < self.since_us or min(apart_us) <= 0 or max(apart_us) > LONGEST_STEP_US:
            return None
        step = _newest_less_mean(fix.less_sum_m_s for fix in recent[1:])
        # Mean accelerations between velocities, without vibration.
        pairs = zip(pairwise(recent), apart_us, strict=True)
        change = _newest_less_mean(_rate(b.sum_ned_m_s, a.sum_ned_m_s, 1e-6 * us) for (a, b), us in pairs)
        self.newest = (step, change)
        late_s = self.delay.delay_s(self.variance_m2_s2)
        return plus(step, late_s, change)

    def compared(self, fixes: Sequence[VelocityFix]) -> Sequence[VelocityFix]:
        """The velocities that make the newest step, the newest last."""
        return [fixes[place] for place in range(-COMPARED - 1, 0)]

    def learn(self, step: Vector3) -> None:
        """Learn delay and standard deviation from the newest step, limited to what is no hit.

        An estimate that jumps repeatedly gets a larger standard deviation. It rises fast and falls slowly (see
        `free_flight`).
        """
        self.delay.learn(*self.newest)
        square = along(step, step) / 3.0
        self.known = min(self.known + 1, MEMORY)
        change = square - self.variance_m2_s2
        self.variance_m2_s2 += change / (min(self.known, RISE) if change > 0.0 else self.known)

    def least_m_s(self, config: FusedConfig, time_us: int, caution: float, shaking_m_s2: float) -> float:
        """The step, m/s, that is a hit; infinite before the first step.

        Noise exceeds it as rarely as `noise_factor` standard deviations, by Student's t (its quantile, expanded in
        1 / degrees of freedom): a standard deviation from few steps is uncertain. Each has three axes, and shares
        velocities with those around it: four are worth as much as one. It is larger by `caution` where the estimate may
        jump without a hit, and by vibration between the samples (standard deviation `shaking_m_s2`). Beside a rate jump
        less is enough: the test ratios of one impulse add up.
        """
        if not self.known:
            return math.inf
        spreads = config.noise_factor
        noise_m_s = spreads * math.sqrt(self.variance_m2_s2) * (1.0 + (spreads * spreads + 1.0) / (3.0 * self.known))
        unseen_m_s = shaking_m_s2 * (SHAKEN_S * self.unseen_share + STAMP_S)
        least_m_s = caution * max(config.velocity_step_m_s, noise_m_s) + unseen_m_s
        (p, q, r), since_us = self.rate_step_frd_rad_s, time_us - self.rate_step_until_us
        most_rad_s = config.rate_step_rad_s + NO_MOTORS_RAD_S2 * 1e-6 * self.rate_step_over_us
        turned = math.hypot(p, q, r / YAW_SHARE) / most_rad_s if since_us < TURNED_US else 0.0
        return least_m_s * math.sqrt(1.0 - TURNED_SHARE * min(turned, 1.0) ** 2)


def _rate(a: Vector3, b: Vector3, seconds: float) -> Vector3:
    return ((a[0] - b[0]) / seconds, (a[1] - b[1]) / seconds, (a[2] - b[2]) / seconds)


def _newest_less_mean(vectors: Iterable[Vector3]) -> Vector3:
    """The last vector less the mean of those before it."""
    x, y, z = (newest - sum(before) / COMPARED for *before, newest in zip(*vectors, strict=True))
    return (x, y, z)
