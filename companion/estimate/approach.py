"""v_c: the velocity just before a contact, from velocities with their real stamps and the accelerometer between them.

The accelerometer's sum u (see `strapdown`) knows how the velocity changes, the vehicle's estimate where it is: the
difference c = v - u is nearly constant, and what it drifts by is the accelerometer's bias. A Kalman filter
follows c, its slope and the estimate's delay, state [c (3), slope (3), delay]:

    v_k = c + u(t_k) - delay * a(t_k) + noise,      v_c = c + u(t_c)

Only velocities from before the contact are used: after a stiff one PX4's estimate cannot be trusted. Without the
accelerometer, as the paper does it, u is zero, c the velocity itself and its slope the acceleration.
"""

import math
from collections.abc import Sequence
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
# The sum's own noise: 0.25 m/s^2 in samples of 5 ms, each of which stands for 50 ms at the slowest useful rate.
SUM_DENSITY_M2_S3 = 0.25**2 * 0.05


class Slope(NamedTuple):
    """What c's slope is, m/s^2: its spread at first and its walk per square root of a second; how far apart velocities
    are taken, us; and the largest mean NIS of one on an axis."""

    spread_m_s2: float
    walk: float
    spacing_us: int
    most_nis: float


# What a calibrated accelerometer and a good attitude leave: 0.05 m/s^2 of bias and 3 mrad of g on each axis, the latter
# coming and going within seconds; with some reserve. Velocities closer together tell the same error again. The NIS is
# 0.1 for the simulated vehicle (errors that last change little from one to the next), 1.0 for one with three times its
# noise. Beyond, attitude or accelerometer do not belong to the velocities.
BIAS = Slope(0.08, 0.05, 100_000, 1.5)
# Of the acceleration nothing is known at first but the vehicle's limits, about 0.3 g; that of half a second ago says
# nothing about now, and 25 velocities are enough.
LIMITS_M_S2, ALONE_US = 3.0, 500_000


def velocity_alone(
    samples: Sequence[LocalPosition], contact_boot_us: int, config: EstimateConfig
) -> tuple[Vector3, float] | None:
    """The same without the accelerometer; samples that may have been taken after the contact are ignored."""
    start_us, end_us = contact_boot_us - ALONE_US, contact_boot_us - STAMP_RESOLUTION_US
    times = [(s.time_boot_us, s.velocity_ned_m_s) for s in samples if start_us <= s.time_boot_us <= end_us]
    acceleration = Slope(LIMITS_M_S2, math.sqrt(config.jerk_density_m2_s5), 0, math.inf)
    return velocity_at([VelocityFix(t, v, ZERO, ZERO) for t, v in times], contact_boot_us, ZERO, config, acceleration)


def velocity_at(
    fixes: Sequence[VelocityFix],
    contact_boot_us: int,
    sum_ned_m_s: Vector3,
    config: EstimateConfig,
    slope: Slope = BIAS,
) -> tuple[Vector3, float] | None:
    """v_c at a contact where the sum is ``sum_ned_m_s``, and its standard deviation on an axis, m/s.

    ``fixes`` are in the order of time and from before the contact, without a jump of the estimate between them. None
    when there are none, or when accelerometer and velocities contradict each other.
    """
    batch = _thinned(fixes, slope.spacing_us)
    if not batch:
        return None
    # An error that lasts for a time tau shows 2 tau / spacing times in a row: so much more weight it must not get.
    colour = max(1.0, 2e6 * config.velocity_correlation_s / slope.spacing_us) if slope.spacing_us else 1.0
    noise = np.eye(3) * (config.velocity_noise_m_s**2 * colour)
    kalman = _filter(batch[0], noise, slope)
    time_us, surprise = batch[0].time_boot_us, 0.0
    for fix in batch[1:]:
        _predict(kalman, (fix.time_boot_us - time_us) * 1e-6, slope)
        surprise += _update(kalman, fix, noise)
        time_us = fix.time_boot_us
    if surprise > slope.most_nis * 3 * max(len(batch) - 1, 1):
        return None
    _predict(kalman, (contact_boot_us - time_us) * 1e-6, slope)
    n, e, d = (float(kalman.x[axis]) + sum_ned_m_s[axis] for axis in range(3))
    return (n, e, d), float(np.sqrt(max(kalman.P[0, 0], kalman.P[1, 1], kalman.P[2, 2])))


def position_at(samples: Sequence[LocalPosition], contact_boot_us: int, velocity_ned_m_s: Vector3) -> Vector3:
    """x(t_c), local NED, m: the mean of the last positions before the contact, each carried on to it at v_c."""
    recent = [s for s in samples if contact_boot_us - s.time_boot_us <= POSITIONS_US] or samples[-1:]
    ahead_s = sum(contact_boot_us - s.time_boot_us for s in recent) * 1e-6 / len(recent)
    n, e, d = (
        sum(s.position_ned_m[axis] for s in recent) / len(recent) + ahead_s * velocity_ned_m_s[axis]
        for axis in range(3)
    )
    return (n, e, d)


def _thinned(fixes: Sequence[VelocityFix], spacing_us: int) -> list[VelocityFix]:
    """The newest, and before it what is far enough apart; oldest first."""
    kept: list[VelocityFix] = []
    for fix in reversed(fixes):
        if not kept or kept[-1].time_boot_us - fix.time_boot_us >= spacing_us:
            kept.append(fix)
    return kept[::-1]


def _offset(fix: VelocityFix) -> Floats:
    return np.array(less_sum(fix))


def _filter(first: VelocityFix, noise: Floats, slope: Slope) -> KalmanFilter:
    a = np.array(first.acceleration_ned_m_s2)
    x = np.concatenate([_offset(first) + DELAY_S * a, np.zeros(3), [DELAY_S]])
    unknown = np.diag([0.0] * 3 + [slope.spread_m_s2**2] * 3 + [DELAY_SPREAD_S**2])
    return KalmanFilter(x, np.pad(noise, (0, 4)) + unknown)


def _predict(kalman: KalmanFilter, dt_s: float, slope: Slope) -> None:
    transition = np.eye(7)
    transition[0, 3] = transition[1, 4] = transition[2, 5] = dt_s
    walk = slope.walk**2 * dt_s
    kalman.predict(F=transition, Q=np.diag([SUM_DENSITY_M2_S3 * dt_s] * 3 + [walk] * 3 + [0.0]))


def _update(kalman: KalmanFilter, fix: VelocityFix, noise: Floats) -> float:
    measures = np.eye(3, 7)
    measures[:, 6] = np.negative(fix.acceleration_ned_m_s2)
    return kalman.update(_offset(fix), measures, noise)
