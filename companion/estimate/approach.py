"""v_c: the velocity just before a contact, from the vehicle's velocities and the integrated accelerometer.

The integral u of the accelerometer (see `strapdown`) has the changes of the velocity, the vehicle's estimate v its
value, late by the delay d. Their difference is nearly constant; it drifts by the accelerometer's bias b:

    v_k - u(t_k) + d a(t_k) = c + b (t_k - t_c) + noise,      v_c = c + u(t_c)

c and b are found by least squares with a prior on b, from velocities before the contact alone: after a stiff contact
PX4's estimate is not valid. Without the accelerometer, as in the paper, u and a are zero and b is the acceleration.
"""

import math
from collections.abc import Sequence

from companion.estimate.config import EstimateConfig
from companion.messages import LocalPosition, Vector3
from companion.motion.delay import DELAY_S
from companion.motion.history import STAMP_RESOLUTION_US
from companion.motion.inertial import VelocityFix, less_sum

# Standard deviation of the drift, m/s^2: 0.05 m/s^2 of bias and 3 mrad of g on each axis, with some reserve.
BIAS_M_S2 = 0.08
# Without the accelerometer: the acceleration is within the limits of a vehicle, about 0.3 g, and a straight line
# follows its changes in this time. Errors last as long, so older velocities would hardly help.
LIMITS_M_S2, ALONE_US = 3.0, 250_000
# Accelerometer and velocities contradict each other where they differ by this many standard deviations (RMS): an
# attitude or an accelerometer is wrong. One of 236 hits of drawn vehicles comes to this.
CONTRADICTING = 2.0


def velocity_at(
    fixes: Sequence[VelocityFix], contact_boot_us: int, sum_ned_m_s: Vector3, config: EstimateConfig
) -> tuple[Vector3, float] | None:
    """v_c at a contact where the integral is ``sum_ned_m_s``, and its standard deviation on an axis, m/s.

    None without earlier velocities, or where accelerometer and velocities contradict each other.
    """
    points = []
    for fix in fixes:
        (x, y, z), (a, b, c) = less_sum(fix), fix.acceleration_ned_m_s2
        points.append((fix.time_boot_us, (x + DELAY_S * a, y + DELAY_S * b, z + DELAY_S * c)))
    found = _at_contact(points, contact_boot_us, BIAS_M_S2, config)
    if found is None or found[2] > CONTRADICTING * config.velocity_noise_m_s:
        return None
    (x, y, z), (n, e, d) = found[0], sum_ned_m_s
    return (x + n, y + e, z + d), found[1]


def velocity_alone(
    samples: Sequence[LocalPosition], contact_boot_us: int, config: EstimateConfig
) -> tuple[Vector3, float] | None:
    """v_c and its standard deviation without the accelerometer."""
    points = [(sample.time_boot_us, sample.velocity_ned_m_s) for sample in samples]
    found = _at_contact(points, contact_boot_us, LIMITS_M_S2, config)
    return None if found is None else found[:2]


def _at_contact(
    points: Sequence[tuple[int, Vector3]], contact_boot_us: int, drift_m_s2: float, config: EstimateConfig
) -> tuple[Vector3, float, float] | None:
    """The value at the contact, its standard deviation on an axis, and the RMS of what is left, m/s.

    Points that may be after the contact are ignored. An error with correlation time tau repeats in 2 tau / spacing of
    them: their variance is increased by that.
    """
    end_us = contact_boot_us - STAMP_RESOLUTION_US
    known = [point for point in points if point[0] <= end_us]
    if not known:
        return None
    times_s = [1e-6 * (time_us - contact_boot_us) for time_us, _ in known]
    count, lasted_s = len(known), times_s[-1] - times_s[0]
    colour = max(1.0, 2.0 * config.velocity_correlation_s * (count - 1) / lasted_s) if lasted_s > 0.0 else 1.0
    weight = 1.0 / (config.velocity_noise_m_s**2 * colour)
    first = weight * math.fsum(times_s)
    second = weight * math.fsum([t * t for t in times_s]) + 1.0 / drift_m_s2**2
    size = weight * count * second - first * first
    found, left2 = [], 0.0
    for values in zip(*[value for _, value in known], strict=True):
        pairs = list(zip(times_s, values, strict=True))
        total, moment = weight * math.fsum(values), weight * math.fsum([t * value for t, value in pairs])
        start, drift = (second * total - first * moment) / size, (weight * count * moment - first * total) / size
        left2 += math.fsum([(value - start - drift * t) ** 2 for t, value in pairs])
        found.append(start)
    n, e, d = found
    return (n, e, d), math.sqrt(second / size), math.sqrt(left2 / (3 * count))


def position_at(latest: LocalPosition, contact_boot_us: int, velocity_ned_m_s: Vector3) -> Vector3:
    """x(t_c), local NED, m: the last position before the contact, carried on to it at v_c."""
    (n, e, d), (u, v, w) = latest.position_ned_m, velocity_ned_m_s
    ahead_s = 1e-6 * (contact_boot_us - latest.time_boot_us)
    return (n + ahead_s * u, e + ahead_s * v, d + ahead_s * w)
