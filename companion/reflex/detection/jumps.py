"""Jumps: what a contact leaves of which the samples hold a part at most.

A contact beside the centre turns the vehicle: body rates change sooner than motors can change them, and stay changed.
Motors turn it about the thrust by their drag alone, which is weak, and faster across it. One broken sample is never the
middle one of three; motors brake a true one by so much at most.

A contact between two received samples, or in a lost one, changes the vehicle's velocity, and not the integrated
accelerometer (see `motion.strapdown`): they differ by a step.
"""

import math
from collections.abc import Iterable, Sequence
from dataclasses import dataclass, field
from itertools import pairwise

from companion.messages import Vector3
from companion.motion.config import DELAY_S, LATEST_S, LONGEST_GAP_US, MEMORY_STEPS, MOTORS_RAD_S2
from companion.motion.slope import Slope
from companion.motion.strapdown import VelocityFix
from companion.motion.vector import ZERO, along, minus, plus
from companion.reflex import config as reflex
from companion.reflex.detection.detector import Innovation


@dataclass(slots=True)
class RateJump(Innovation):
    """The middle one of the last three rates beside their mean before, rad/s of yaw. Changed only by `imu`.

    Times: vehicle's boot clock.
    """

    newest_rad_s: Vector3 = ZERO
    step_rad_s: Vector3 = ZERO
    over_us: int = 0
    mean_rad_s: Vector3 = ZERO
    variance_rad2_s2: float = 0.0
    turns_rad_s2: float = 0.0  # angular acceleration of roll and pitch, over about RATE_MEMORY_US

    def imu(self, before_us: int, time_us: int, rates_frd_rad_s: Vector3, config: reflex.FusedConfig) -> None:
        """Take one sample; the one before it was at `before_us`."""
        (x, y, z), (a, b, c), (p, q, r) = self.newest_rad_s, self.step_rad_s, rates_frd_rad_s
        p, q = reflex.ACROSS_THRUST * p, reflex.ACROSS_THRUST * q
        # After a gap or a reboot it has the weight of the longest interval.
        was_us = self.over_us if 0 < self.over_us < LONGEST_GAP_US else LONGEST_GAP_US
        self.newest_rad_s, self.over_us = (p, q, r), time_us - before_us
        self.step_rad_s = i, j, k = p - x, q - y, r - z
        on = a * i + b * j + c * k
        # The one between is the middle one, unless the newest step goes back: behind where the last began, or less far.
        if on < 0.0:
            if on + a * a + b * b + c * c >= 0.0:
                a, b, c = -i, -j, -k
            # A gap lets no broken sample count.
            braked_us = min(max(self.over_us, 0), reflex.RATE_MEMORY_US)
            braked_rad_s = MOTORS_RAD_S2 * reflex.ACROSS_THRUST * 1e-6 * braked_us
            share = max(0.0, 1.0 - braked_rad_s / math.sqrt(a * a + b * b + c * c))
            x, y, z = x - share * a, y - share * b, z - share * c
        (m, n, o), share, least = self.mean_rad_s, was_us / reflex.RATE_MEMORY_US, config.rate_step_rad_s
        i, j, k = x - m, y - n, z - o
        if share >= 1.0:
            self.mean_rad_s, least = (x, y, z), least * share
        else:
            self.mean_rad_s = (m + share * i, n + share * j, o + share * k)
        m, n, _ = self.mean_rad_s
        self.turns_rad_s2 = 1e6 * math.hypot(p - m, q - n) / (reflex.ACROSS_THRUST * reflex.RATE_MEMORY_US)
        spreads_rad_s = reflex.EXCESS * config.noise_factor * math.sqrt(self.variance_rad2_s2)
        size = self.value = math.hypot(i, j, k)
        limit = self.limit = least if least > spreads_rad_s else spreads_rad_s
        learnt = size if size < limit else limit
        self.variance_rad2_s2 += was_us / (1e6 * reflex.MEMORY_S + was_us) * (learnt * learnt - self.variance_rad2_s2)


@dataclass(slots=True)
class VelocityJump:
    """Changed only by its methods. Times: vehicle's boot clock; vectors local NED."""

    since_us: int = 0  # velocities before this time are not compared
    delay: Slope = field(default_factory=lambda: Slope(DELAY_S, DELAY_S, 0.0, LATEST_S))
    variance_m2_s2: float = 0.0
    known: int = 0
    told: Slope = field(default_factory=lambda: Slope(0.0, 1.0, 0.0, 1.0))
    """1 of a vehicle that tells the velocity of its centre, as where the accelerometer is it has been told; else 0, as
    PX4's default EKF2_IMU_POS_X, _Y, _Z have it."""
    newest: tuple[Vector3, Vector3, Vector3] = (ZERO, ZERO, ZERO)
    """The newest step as it is, the changes of the acceleration and of how fast the accelerometer turns."""
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
        flown = ((minus(b.sum_ned_m_s, a.sum_ned_m_s), 1e-6 * us) for (a, b), us in pairs)
        change = _newest_less_mean((n / over_s, e / over_s, d / over_s) for (n, e, d), over_s in flown)
        turn = _newest_less_mean(fix.turns_ned_m_s for fix in recent[1:])
        self.newest, self.compared_us = (step, change, turn), times[1:]
        return self._less(turn, change)

    def learn(self, step: Vector3) -> None:
        """Learn delay and standard deviation from the newest step, limited to what is no hit."""
        _, change, turn = self.newest
        self.delay.learn(self._less(turn, ZERO), change)
        self.told.learn(self._less(ZERO, change), turn)
        square = along(step, step) / 3.0
        self.known = min(self.known + 1, MEMORY_STEPS)
        self.variance_m2_s2 += (square - self.variance_m2_s2) / self.known

    def _less(self, turn: Vector3, change: Vector3) -> Vector3:
        """The newest step less what these explain of it."""
        delay_s, told = (slope.found(self.variance_m2_s2)[0] for slope in (self.delay, self.told))
        return plus(plus(self.newest[0], told, turn), delay_s, change)

    @property
    def error_m_s(self) -> float:
        """Standard deviation of the newest step by that of what explains it."""
        _, change, turn = self.newest
        delay_s, told = (slope.found(self.variance_m2_s2)[1] for slope in (self.delay, self.told))
        return math.hypot(told * math.hypot(*turn), delay_s * math.hypot(*change))

    def least_m_s(self, config: reflex.FusedConfig, caution: float) -> float:
        """The step, m/s, that is a hit; infinite before the first step.

        It is `noise_factor` spreads, and more after few steps, by Student's t (its quantile, expanded in 1 / degrees of
        freedom). Each has three axes, and shares velocities with those around it: four are worth as much as one. It is
        larger by `caution` where the estimate may jump without a hit.
        """
        if not self.known:
            return math.inf
        spreads, spread_m_s = config.noise_factor, reflex.EXCESS * math.sqrt(self.variance_m2_s2)
        noise_m_s = spreads * spread_m_s * (1.0 + (spreads * spreads + 1.0) / (3.0 * self.known))
        return caution * max(config.velocity_step_m_s, noise_m_s)


def _newest_less_mean(vectors: Iterable[Vector3]) -> Vector3:
    """The last vector less the mean of those before it."""
    x, y, z = (newest - sum(before) / reflex.COMPARED for *before, newest in zip(*vectors, strict=True))
    return (x, y, z)
