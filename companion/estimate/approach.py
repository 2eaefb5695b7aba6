"""v_c: the velocity just before a contact, from the vehicle's velocities and the integrated accelerometer.

The integral u of the accelerometer (see `strapdown`) has the changes of the velocity, the vehicle's estimate v its
value. Their difference c = v - u is nearly constant; it drifts by the accelerometer's bias. A Kalman filter estimates
c, its slope and the estimate's delay, state [c (3), slope (3), delay]:

    v_k = c + u(t_k) - delay * a(t_k) + noise,      v_c = c + u(t_c)

Only velocities from before the contact are used: after a stiff contact PX4's estimate is not valid. Without the
accelerometer, as in the paper, u is zero, c is the velocity and its slope the acceleration.
"""

import math
from collections import deque
from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import NamedTuple

import numpy as np

from companion.estimate.config import EstimateConfig
from companion.messages import LocalPosition, Vector3
from companion.motion.delay import DELAY_S, DELAY_SPREAD_S
from companion.motion.history import STAMP_RESOLUTION_US
from companion.motion.inertial import VelocityFix, less_sum
from companion.motion.kalman import Floats, KalmanFilter
from companion.motion.strapdown import ZERO

# Five positions at 50 Hz; at 2 m/s^2 the vehicle is 1 cm off a straight line in that time.
POSITIONS_US = 100_000
# Noise of the integral: 0.25 m/s^2 in samples of 5 ms, each of which stands for 50 ms at the slowest useful rate.
SUM_DENSITY_M2_S3 = 0.25**2 * 0.05


class Slope(NamedTuple):
    """Model of c's slope, m/s^2: initial standard deviation, random walk per square root of a second.

    `spacing_us` is the least distance of two velocities, `most_nis` the largest mean NIS on an axis.
    """

    spread_m_s2: float
    walk: float
    spacing_us: int
    most_nis: float


# Slope of a calibrated accelerometer and a good attitude: 0.05 m/s^2 of bias and 3 mrad of g on each axis, which varies
# within seconds; with some reserve. Velocities closer together have the same error. The NIS is 0.1 for the simulated
# vehicle, whose errors are correlated, and 1.0 for one with three times its noise. Beyond `most_nis` attitude or
# accelerometer contradict the velocities.
BIAS = Slope(0.08, 0.05, 100_000, 1.5)
# Without the accelerometer: the acceleration is within the limits of a vehicle, about 0.3 g. Older velocities than this
# are of no use; 25 are enough.
LIMITS_M_S2, ALONE_US = 3.0, 500_000
# Number of filters kept, the oldest from 0.4 s ago. The first velocity that shows a hit comes up to 0.17 s after it:
# velocities are at most 0.13 s apart (see `velocity_jump`) and 0.04 s late.
LOOKED_BACK = 5
# Number of velocities in the mean NIS, 5 s: the bias is estimated within seconds.
JUDGED_BY = 50


class _Known(NamedTuple):
    """The filter after a velocity: how many it has taken, and their mean NIS."""

    time_boot_us: int
    kalman: KalmanFilter
    taken: int = 0
    nis: float = 0.0


@dataclass(slots=True)
class Approach:
    """Velocities in the order of time, without a jump of the estimate or the sum between them."""

    config: EstimateConfig
    slope: Slope = BIAS
    _known: deque[_Known] = field(default_factory=lambda: deque(maxlen=LOOKED_BACK))

    def take(self, fix: VelocityFix) -> None:
        """Take a velocity, unless it is too close in time to the one before."""
        if not self._known:
            self._known.append(_Known(fix.time_boot_us, self._filter(fix)))
            return
        before = self._known[-1]
        elapsed_us = fix.time_boot_us - before.time_boot_us
        if elapsed_us < self.slope.spacing_us:
            return
        kalman = self._ahead(before.kalman, elapsed_us)
        measures = np.eye(3, 7)
        measures[:, 6] = np.negative(fix.acceleration_ned_m_s2)
        nis, taken = kalman.update(np.array(less_sum(fix)), measures, self._noise), before.taken + 1
        mean = before.nis + (nis - before.nis) / min(taken, JUDGED_BY)
        self._known.append(_Known(fix.time_boot_us, kalman, taken, mean))

    def velocity_at(self, contact_boot_us: int, sum_ned_m_s: Vector3) -> tuple[Vector3, float] | None:
        """v_c at a contact where the integral is ``sum_ned_m_s``, and its standard deviation on an axis, m/s.

        None without earlier velocities, or where accelerometer and velocities contradict each other.
        """
        end_us = contact_boot_us - STAMP_RESOLUTION_US
        before = next((known for known in reversed(self._known) if known.time_boot_us <= end_us), None)
        if before is None or before.nis > 3.0 * self.slope.most_nis:
            return None
        kalman = self._ahead(before.kalman, contact_boot_us - before.time_boot_us)
        n, e, d = (float(kalman.x[axis]) + sum_ned_m_s[axis] for axis in range(3))
        return (n, e, d), math.sqrt(max(kalman.P[axis, axis] for axis in range(3)))

    @property
    def _noise(self) -> Floats:
        """Measurement covariance. An error with correlation time tau repeats in 2 tau / spacing velocities."""
        spacing_us, lasts_us = self.slope.spacing_us, 2e6 * self.config.velocity_correlation_s
        colour = max(1.0, lasts_us / spacing_us) if spacing_us else 1.0
        return np.eye(3) * (self.config.velocity_noise_m_s**2 * colour)

    def _filter(self, first: VelocityFix) -> KalmanFilter:
        offset = np.array(less_sum(first)) + DELAY_S * np.array(first.acceleration_ned_m_s2)
        unknown = np.diag([0.0] * 3 + [self.slope.spread_m_s2**2] * 3 + [DELAY_SPREAD_S**2])
        return KalmanFilter(np.concatenate([offset, np.zeros(3), [DELAY_S]]), np.pad(self._noise, (0, 4)) + unknown)

    def _ahead(self, kalman: KalmanFilter, elapsed_us: int) -> KalmanFilter:
        """A copy of the filter, predicted to a later time."""
        dt_s = 1e-6 * elapsed_us
        transition = np.eye(7)
        transition[0, 3] = transition[1, 4] = transition[2, 5] = dt_s
        walk = self.slope.walk**2 * dt_s
        later = KalmanFilter(kalman.x, kalman.P)
        later.predict(F=transition, Q=np.diag([SUM_DENSITY_M2_S3 * dt_s] * 3 + [walk] * 3 + [0.0]))
        return later


def velocity_alone(
    samples: Sequence[LocalPosition], contact_boot_us: int, config: EstimateConfig
) -> tuple[Vector3, float] | None:
    """v_c and its standard deviation without the accelerometer; samples that may be after the contact are ignored."""
    start_us, end_us = contact_boot_us - ALONE_US, contact_boot_us - STAMP_RESOLUTION_US
    approach = Approach(config, Slope(LIMITS_M_S2, math.sqrt(config.jerk_density_m2_s5), 0, math.inf))
    for sample in samples:
        if start_us <= sample.time_boot_us <= end_us:
            approach.take(VelocityFix(sample.time_boot_us, sample.velocity_ned_m_s, ZERO, ZERO))
    return approach.velocity_at(contact_boot_us, ZERO)


def position_at(samples: Sequence[LocalPosition], contact_boot_us: int, velocity_ned_m_s: Vector3) -> Vector3:
    """x(t_c), local NED, m: the mean of the last positions before the contact, each carried on to it at v_c."""
    recent = [s for s in samples if contact_boot_us - s.time_boot_us <= POSITIONS_US] or samples[-1:]
    ahead_s = sum(contact_boot_us - s.time_boot_us for s in recent) * 1e-6 / len(recent)
    n, e, d = (
        sum(s.position_ned_m[axis] for s in recent) / len(recent) + ahead_s * velocity_ned_m_s[axis]
        for axis in range(3)
    )
    return (n, e, d)
