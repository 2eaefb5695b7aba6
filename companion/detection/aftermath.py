"""What a contact leaves behind: a step in the velocity that the accelerometer did not show.

Between two velocities the vehicle's own estimate must change as the accelerometer says (see `motion.strapdown`). A
contact that fell between the samples the wire carries, or into a lost one, makes the estimate jump and not the sum.
The body's rates jump with it, for a push beside the centre turns; on their own they prove nothing, because a motor
that fails turns the vehicle too.
"""

import math
from collections.abc import Sequence
from dataclasses import dataclass, field

from companion.messages import Vector3
from companion.motion.delay import Delay
from companion.motion.strapdown import LONGEST_DELAY_US, ZERO, Strapdown

# The velocities before the newest that it is compared with: enough to halve their noise, few enough to be recent.
COMPARED = 3
# Velocities further apart leave more to a sum of samples that sees a quarter of the time, and to a filter's own
# corrections: at 10 Hz healthy vehicles' steps reach 0.3 m/s (four public logs). 30 Hz with a packet lost is inside.
LONGEST_STEP_US = 75_000
# A spread of fewer steps than this is a guess: two thirds of a second at 30 Hz.
TRUSTED = 20
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
# A step of the rates marks the gap that the contact fell into for this long: the velocity's interval and its delay.
RATE_STEP_KEPT_US = 120_000


@dataclass(slots=True)
class Aftermath:
    """Changed only by its methods. Times: vehicle's boot clock; vectors local NED."""

    averaging_us: int
    strapdown: Strapdown = field(default_factory=Strapdown)
    previous_imu_us: int = 0
    newest_rate_step_rad_s: float = 0.0
    rate_step_rad_s: float = 0.0
    rate_step_from_us: int = 0
    rate_step_until_us: int = 0
    velocity_ned_m_s: Vector3 | None = None
    residuals: list[tuple[int, Vector3, Vector3, Vector3]] = field(default_factory=list)
    """Time, velocity less sum, mean acceleration since the one before, sum."""
    delay: Delay = field(default_factory=Delay)
    variance_m2_s2: float = 0.0
    known: int = 0
    unseen_share: float = 0.0
    """Of the time, by the samples' distances and the length of their windows."""
    newest: tuple[Vector3, Vector3] = (ZERO, ZERO)
    """Of the newest step: velocity less sum with its delay in it, and the change of the acceleration."""
    unlearnt: tuple[Vector3, Vector3, Vector3] | None = None

    def imu(self, time_us: int, f: Vector3, w: Vector3) -> None:
        """Take one sample, body FRD."""
        strapdown = self.strapdown
        before_us = strapdown.time_boot_us
        p_0, q_0, r_0 = strapdown.rates_frd_rad_s
        if strapdown.imu(time_us, f, w):
            p, q, r = w[0] - p_0, w[1] - q_0, w[2] - r_0
            unseen_us = time_us - before_us - self.averaging_us
            unseen = unseen_us / (time_us - before_us) if unseen_us > 0 else 0.0
            self.unseen_share += UNSEEN_SHARE * (unseen - self.unseen_share)
            step = self.newest_rate_step_rad_s = math.sqrt(p * p + q * q + r * r)
            if step > self.rate_step_rad_s or time_us - self.rate_step_until_us > RATE_STEP_KEPT_US:
                self.rate_step_rad_s = step
                self.rate_step_from_us, self.rate_step_until_us = before_us, time_us
        else:
            self.newest_rate_step_rad_s = 0.0
            self.forget()
        self.previous_imu_us = before_us

    def forget(self) -> None:
        """The sum has a hole, a contact in it, or the estimator was reset: what was before is no measure."""
        self.residuals.clear()

    def step_m_s(self, time_us: int, velocity_ned_m_s: Vector3) -> Vector3 | None:
        """Take one velocity: how far it is from what the recent ones and the accelerometer lead to, or None."""
        residuals = self.residuals
        stands_still = velocity_ned_m_s == self.velocity_ned_m_s
        self.velocity_ned_m_s = velocity_ned_m_s
        if stands_still:
            # To the last digit: nothing is estimated now, and what comes after is a new beginning.
            residuals.clear()
            return None
        if residuals and not 0 < time_us - residuals[-1][0] <= LONGEST_STEP_US:
            residuals.clear()
        u = self.strapdown.sum_at(time_us)
        if u is None:
            return None
        residual, acceleration = _less(velocity_ned_m_s, u), self._accelerated(time_us, u)
        found = None
        if len(residuals) == COMPARED:
            _, before, led, _ = zip(*residuals, strict=True)
            step, change = _less(residual, _mean(before)), _less(acceleration, _mean(led))
            late_s = self.delay.delay_s(self.variance_m2_s2)
            found = (step[0] + late_s * change[0], step[1] + late_s * change[1], step[2] + late_s * change[2])
            self.newest = (step, change)
            del residuals[0]
        residuals.append((time_us, residual, acceleration, u))
        return found

    def _accelerated(self, time_us: int, sum_ned_m_s: Vector3) -> Vector3:
        """In the mean since the velocity before; what shakes is gone from it."""
        if not self.residuals:
            return self.strapdown.acceleration_ned_m_s2
        before_us, _, _, before = self.residuals[-1]
        per_s = 1e6 / (time_us - before_us)
        n, e, d = _less(sum_ned_m_s, before)
        return (per_s * n, per_s * e, per_s * d)

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
        return math.sqrt(self.variance_m2_s2) if self.known >= TRUSTED else math.inf

    def unseen_m_s(self, shaking_m_s2: float, thrust_change_m_s2: float) -> float:
        """What vibration of this spread may add to the velocity without the samples showing it, and by how much a
        velocity that lags is behind when the thrust has just changed by so much, as in free fall."""
        return shaking_m_s2 * (SHAKEN_S * self.unseen_share + STAMP_S) + LAG_S * thrust_change_m_s2

    def rate_step_near(self, velocity_us: int) -> float:
        """The largest step of the rates from sample to sample that a jump at ``velocity_us`` may belong to."""
        return self.rate_step_rad_s if velocity_us - self.rate_step_until_us < RATE_STEP_KEPT_US else 0.0

    def contact_gap_us(self, velocity_us: int, least_rad_s: float) -> int:
        """Latest time at which the vehicle was certainly free before the step seen at ``velocity_us``."""
        if self.rate_step_near(velocity_us) >= least_rad_s:
            return self.rate_step_from_us
        before = self.residuals[-2][0] if len(self.residuals) > 1 else velocity_us
        return before - LONGEST_DELAY_US


def _less(a: Vector3, b: Vector3) -> Vector3:
    return (a[0] - b[0], a[1] - b[1], a[2] - b[2])


def _mean(vectors: Sequence[Vector3]) -> Vector3:
    (a, b, c), (d, e, f), (x, y, z) = vectors
    return ((a + d + x) / COMPARED, (b + e + y) / COMPARED, (c + f + z) / COMPARED)
