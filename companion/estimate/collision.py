"""Collision velocity v_c and position x(t_c): what the vehicle was doing just before the contact.

A Kalman filter with a constant-acceleration model for each axis runs over the telemetry from
before the contact and is extrapolated to it. It is made only when a hit has been detected.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from companion.estimate.config import EstimateConfig
from companion.messages import LocalPosition, Vector3
from companion.motion.history import STAMP_RESOLUTION_US
from companion.motion.kalman import Floats, KalmanFilter

# The acceleration of half a second ago says nothing about now, and 25 velocities are enough.
BATCH_US = 500_000
# Before the first sample nothing is known of the acceleration but the vehicle's limits (about 0.3 g).
INITIAL_ACCELERATION_M_S2 = 3.0

_MEASURED: Floats = np.eye(6, 9)


@dataclass(frozen=True, slots=True)
class ContactMotion:
    """x(t_c) and v_c in local NED."""

    time_boot_us: int
    position_ned_m: Vector3
    velocity_ned_m_s: Vector3


def motion_before_contact(
    samples: Sequence[LocalPosition], contact_boot_us: int, config: EstimateConfig
) -> ContactMotion | None:
    """Motion at the contact, from the samples taken before it; None when there are none.

    `samples` are in the order of time. Those that may have been taken after the contact are ignored.
    """
    end_us = contact_boot_us - STAMP_RESOLUTION_US
    batch = [s for s in samples if contact_boot_us - BATCH_US <= s.time_boot_us <= end_us]
    if not batch:
        return None
    position_variance, velocity_variance = config.position_noise_m**2, config.velocity_noise_m_s**2
    noise = np.diag([position_variance] * 3 + [velocity_variance] * 3)
    kalman = _filter_at(batch[0], noise)
    time_us = batch[0].time_boot_us
    for sample in batch[1:]:
        _predict(kalman, (sample.time_boot_us - time_us) * 1e-6, config.jerk_density_m2_s5)
        kalman.update(np.array(sample.position_ned_m + sample.velocity_ned_m_s), _MEASURED, noise)
        time_us = sample.time_boot_us
    _predict(kalman, (contact_boot_us - time_us) * 1e-6, config.jerk_density_m2_s5)
    x = [float(value) for value in kalman.x]
    return ContactMotion(contact_boot_us, (x[0], x[1], x[2]), (x[3], x[4], x[5]))


def _filter_at(sample: LocalPosition, noise: Floats) -> KalmanFilter:
    """State: position, velocity, acceleration (three axes each); measured: position and velocity."""
    x = np.array(sample.position_ned_m + sample.velocity_ned_m_s + (0.0, 0.0, 0.0))
    unknown = np.diag([0.0] * 6 + [INITIAL_ACCELERATION_M_S2**2] * 3)
    return KalmanFilter(x, np.pad(noise, (0, 3)) + unknown)


def _predict(kalman: KalmanFilter, dt_s: float, jerk_density_m2_s5: float) -> None:
    """Constant acceleration disturbed by white jerk of the given density."""
    dt2 = dt_s * dt_s
    transition = np.array([[1.0, dt_s, dt2 / 2.0], [0.0, 1.0, dt_s], [0.0, 0.0, 1.0]])
    noise = jerk_density_m2_s5 * np.array(
        [
            [dt2 * dt2 * dt_s / 20.0, dt2 * dt2 / 8.0, dt2 * dt_s / 6.0],
            [dt2 * dt2 / 8.0, dt2 * dt_s / 3.0, dt2 / 2.0],
            [dt2 * dt_s / 6.0, dt2 / 2.0, dt_s],
        ]
    )
    kalman.predict(F=_on_each_axis(transition), Q=_on_each_axis(noise))


def _on_each_axis(block: Floats) -> Floats:
    return np.kron(block, np.eye(3)).astype(np.float64, copy=False)
