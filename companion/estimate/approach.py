"""v_c: the velocity just before a contact, from the vehicle's velocities and the integrated accelerometer.

The integral u of the accelerometer (see `strapdown`) has the changes of the velocity, the vehicle's estimate v its
value, late by the delay d. Their difference is nearly constant; it drifts by the accelerometer's bias b:

    v_k - u(t_k) + d a(t_k) = c + b (t_k - t_c) + noise,      v_c = c + u(t_c)

c and b are found by least squares with a prior on b, from velocities before the contact alone: after a stiff contact
PX4's estimate is not valid. Without the accelerometer, as in the paper, u and a are zero and b is the acceleration.
"""

import math
from collections.abc import Iterable, Sequence

from companion.estimate.config import EstimateConfig
from companion.messages import LocalPosition, Vector3
from companion.motion.delay import DELAY_S
from companion.motion.history import STAMP_RESOLUTION_US
from companion.motion.inertial import VelocityFix, less_sum

# Five positions at 50 Hz; at 2 m/s^2 the vehicle is 1 cm off a straight line in that time.
POSITIONS_US = 100_000
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
    start_us = contact_boot_us - ALONE_US
    points = ((s.time_boot_us, s.velocity_ned_m_s) for s in samples if s.time_boot_us >= start_us)
    found = _at_contact(points, contact_boot_us, LIMITS_M_S2, config)
    return None if found is None else found[:2]


def _at_contact(
    points: Iterable[tuple[int, Vector3]], contact_boot_us: int, drift_m_s2: float, config: EstimateConfig
) -> tuple[Vector3, float, float] | None:
    """The value at the contact, its standard deviation on an axis, and the RMS of what is left, m/s.

    Points that may be after the contact are ignored. An error with correlation time tau repeats in 2 tau / spacing of
    them: their variance is increased by that.
    """
    end_us = contact_boot_us - STAMP_RESOLUTION_US
    known = [(1e-6 * (time_us - contact_boot_us), value) for time_us, value in points if time_us <= end_us]
    if not known:
        return None
    count, lasted_s = len(known), known[-1][0] - known[0][0]
    colour = max(1.0, 2.0 * config.velocity_correlation_s * (count - 1) / lasted_s) if lasted_s > 0.0 else 1.0
    weight = 1.0 / (config.velocity_noise_m_s**2 * colour)
    first = weight * math.fsum(t for t, _ in known)
    second = weight * math.fsum(t * t for t, _ in known) + 1.0 / drift_m_s2**2
    size = weight * count * second - first * first
    values, left2 = [], 0.0
    for axis in range(3):
        total = weight * math.fsum(value[axis] for _, value in known)
        moment = weight * math.fsum(t * value[axis] for t, value in known)
        start, drift = (second * total - first * moment) / size, (weight * count * moment - first * total) / size
        left2 += math.fsum((value[axis] - start - drift * t) ** 2 for t, value in known)
        values.append(start)
    n, e, d = values
    return (n, e, d), math.sqrt(second / size), math.sqrt(left2 / (3 * count))


def position_at(samples: Sequence[LocalPosition], contact_boot_us: int, velocity_ned_m_s: Vector3) -> Vector3:
    """x(t_c), local NED, m: the mean of the last positions before the contact, each carried on to it at v_c."""
    recent = [s for s in samples if contact_boot_us - s.time_boot_us <= POSITIONS_US] or samples[-1:]
    ahead_s = sum(contact_boot_us - s.time_boot_us for s in recent) * 1e-6 / len(recent)
    n, e, d = (
        sum(s.position_ned_m[axis] for s in recent) / len(recent) + ahead_s * velocity_ned_m_s[axis]
        for axis in range(3)
    )
    return (n, e, d)
