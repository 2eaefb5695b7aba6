"""A step in the vehicle's velocity that the accelerometer did not show.

Between two velocities the vehicle's own estimate must change as the accelerometer says (see `motion.inertial`). A
contact that fell between the samples the wire carries, or into a lost one, makes the estimate jump and not the sum. The
body's rates jump with it, for a push beside the centre turns; on their own they prove nothing, because a motor
that fails turns the vehicle too.
"""

import math
from collections.abc import Sequence
from dataclasses import dataclass, field
from itertools import pairwise

from companion.messages import Vector3
from companion.motion.delay import Delay
from companion.motion.inertial import VelocityFix, less_sum
from companion.motion.strapdown import LONGEST_DELAY_US, LONGEST_GAP_US, MOTORS_RAD_S2, ZERO

# The velocities before the newest that it is compared with: enough to halve their noise, few enough to be recent.
COMPARED = 3
# Velocities further apart leave more to a sum of samples that sees a quarter of the time, and to a filter's own
# corrections: at 10 Hz healthy vehicles' steps reach 0.3 m/s (four public logs). 30 Hz with a packet lost is inside.
LONGEST_STEP_US = 75_000
# 10 Hz with the jitter of a log; further apart they are no measure.
LONGEST_SLOW_STEP_US = 130_000
# A spread of fewer steps than this is a guess: two thirds of a second at 30 Hz.
LEAST_STEPS = 20
# Steps that the spread remembers, and that a rising one does: 3 s and a third of a second at 30 Hz.
MEMORY, RISE = 100, 10
# Of each sample in the share of the time that is not seen: ten samples are half a second at the slowest useful rate.
UNSEEN_SHARE = 0.1
# Vibration that falls between the samples is missing in their sum. A rotor's that beats with the stream, 87 Hz with
# samples 8 and 12 ms apart, has one sign there for tenths of a second: its amplitude (1.4 of both axes' true spreads,
# and the floor reads half too much), over what is not seen of the 0.1 s that the velocities compared are apart, with
# some reserve; and, with every sample seen, over what a velocity's stamp of a millisecond and a lost sample leave open.
SHAKEN_S, STAMP_S = 0.15, 0.008
# An output predictor's lag.
LAG_S = 0.02
# Four times what motors do, so that a nimbler vehicle's flips are none. A rigid vehicle that meets a leaning wall at
# 2 m/s steps by 15 rad/s and more.
NO_MOTORS_RAD_S2 = 4.0 * MOTORS_RAD_S2
# A step of the rates marks the gap that the contact fell into for this long: the velocity's interval and its delay.
RATE_STEP_KEPT_US = 120_000


@dataclass(slots=True)
class VelocityJump:
    """Changed only by its methods. Times: vehicle's boot clock; vectors local NED."""

    averaging_us: int
    rates_frd_rad_s: Vector3 = ZERO
    newest_rate_step_rad_s: float = 0.0
    rate_step_rad_s: float = 0.0
    rate_step_from_us: int = 0
    rate_step_until_us: int = 0
    is_slow: bool = False
    """Whether velocities come further apart than `LONGEST_STEP_US`."""
    since_us: int = 0
    """Velocities before this are no measure."""
    before_us: int = 0
    """Of the velocity before the newest."""
    delay: Delay = field(default_factory=Delay)
    variance_m2_s2: float = 0.0
    known: int = 0
    unseen_share: float = 0.0
    """Of the time, by the samples' distances and the length of their windows."""
    newest: tuple[Vector3, Vector3] = (ZERO, ZERO)
    """Of the newest step: velocity less sum with its delay in it, and the change of the acceleration."""
    unlearnt: tuple[Vector3, Vector3, Vector3] | None = None

    def imu(self, before_us: int, time_us: int, rates_frd_rad_s: Vector3) -> None:
        """Take one sample; the one before it was at `before_us`."""
        elapsed_us, self.newest_rate_step_rad_s = time_us - before_us, 0.0
        if 0 < elapsed_us < LONGEST_GAP_US:
            unseen = max(0.0, 1.0 - self.averaging_us / elapsed_us)
            self.unseen_share += UNSEEN_SHARE * (unseen - self.unseen_share)
            step = self.newest_rate_step_rad_s = math.dist(rates_frd_rad_s, self.rates_frd_rad_s)
            if step > self.rate_step_rad_s or time_us - self.rate_step_until_us > RATE_STEP_KEPT_US:
                self.rate_step_rad_s = step
                self.rate_step_from_us, self.rate_step_until_us = before_us, time_us
        self.rates_frd_rad_s = rates_frd_rad_s

    def step_m_s(self, fixes: Sequence[VelocityFix]) -> Vector3 | None:
        """How far the newest velocity is from what the recent ones and the accelerometer lead to, or None."""
        if len(fixes) < COMPARED + 2:
            return None
        recent = [fixes[place] for place in range(-COMPARED - 2, 0)]
        times = [fix.time_boot_us for fix in recent]
        self.before_us = times[-2]
        if recent[-1].velocity_ned_m_s == recent[-2].velocity_ned_m_s:
            # To the last digit: nothing is estimated now, and what comes after is a new beginning.
            self.since_us = times[-1]
        apart_us = [b - a for a, b in pairwise(times)]
        if times[0] < self.since_us or min(apart_us) <= 0 or max(apart_us) > LONGEST_SLOW_STEP_US:
            return None
        self.is_slow = max(apart_us) > LONGEST_STEP_US
        *before, residual = (less_sum(fix) for fix in recent[1:])
        # In the mean since the velocity before: what shakes is gone from it.
        *led, acceleration = (
            _over(_less(b.sum_ned_m_s, a.sum_ned_m_s), 1e-6 * us)
            for (a, b), us in zip(pairwise(recent), apart_us, strict=True)
        )
        step, change = _less(residual, _mean(before)), _less(acceleration, _mean(led))
        self.newest = (step, change)
        late_s = self.delay.delay_s(self.variance_m2_s2)
        return (step[0] + late_s * change[0], step[1] + late_s * change[1], step[2] + late_s * change[2])

    def learn(self, step: Vector3) -> None:
        """Take in the step before this one; the newest must not hide its own successor.

        Hits are learnt, too: a vehicle whose estimate jumps again and again gets a spread that knows it. It rises fast
        and falls slowly (see `floor`).
        """
        unlearnt, self.unlearnt = self.unlearnt, (step, *self.newest)
        if unlearnt is None:
            return
        learnt, late, change_m_s2 = unlearnt
        self.delay.learn(late, change_m_s2)
        square = (learnt[0] * learnt[0] + learnt[1] * learnt[1] + learnt[2] * learnt[2]) / 3.0
        self.known = min(self.known + 1, MEMORY)
        change = square - self.variance_m2_s2
        self.variance_m2_s2 += change / (min(self.known, RISE) if change > 0.0 else self.known)

    @property
    def spread_m_s(self) -> float:
        """Of a quiet vehicle's steps, each axis; without bound until enough are known."""
        return math.sqrt(self.variance_m2_s2) if self.known >= LEAST_STEPS else math.inf

    def unseen_m_s(self, shaking_m_s2: float, thrust_change_m_s2: float) -> float:
        """What vibration of this spread may add to the velocity without the samples showing it, and by how much a
        velocity that lags is behind when the thrust has just changed by so much, as in free fall."""
        return shaking_m_s2 * (SHAKEN_S * self.unseen_share + STAMP_S) + LAG_S * thrust_change_m_s2

    def rate_step_near(self, velocity_us: int) -> float:
        """The largest step of the rates from sample to sample that a jump at ``velocity_us`` may belong to."""
        return self.rate_step_rad_s if velocity_us - self.rate_step_until_us < RATE_STEP_KEPT_US else 0.0

    def no_motor_turns(self, velocity_us: int, least_rad_s: float) -> bool:
        """Whether that step is, beyond so much, more than motors make from one sample to the next."""
        over_s = 1e-6 * (self.rate_step_until_us - self.rate_step_from_us)
        return self.rate_step_near(velocity_us) >= least_rad_s + NO_MOTORS_RAD_S2 * over_s

    def free_until_us(self, velocity_us: int, least_rad_s: float) -> int:
        """Latest time at which the vehicle was certainly free before the step seen at ``velocity_us``."""
        if self.rate_step_near(velocity_us) >= least_rad_s:
            return self.rate_step_from_us
        return self.before_us - LONGEST_DELAY_US


def _less(a: Vector3, b: Vector3) -> Vector3:
    return (a[0] - b[0], a[1] - b[1], a[2] - b[2])


def _over(a: Vector3, seconds: float) -> Vector3:
    return (a[0] / seconds, a[1] / seconds, a[2] / seconds)


def _mean(vectors: Sequence[Vector3]) -> Vector3:
    (a, b, c), (d, e, f), (x, y, z) = vectors
    return ((a + d + x) / COMPARED, (b + e + y) / COMPARED, (c + f + z) / COMPARED)
