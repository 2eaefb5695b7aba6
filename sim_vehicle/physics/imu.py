"""The inertial sensor: raw samples with noise and bias, clipped one by one, then summed for the mean."""

import numpy as np
import numpy.typing as npt

from sim_vehicle.physics.jit import njit
from sim_vehicle.physics.layout import GRAVITY_M_S2, Constants, Scratch, State

Floats = npt.NDArray[np.float64]


@njit
def add_raw_sample(state: State, scratch: Scratch, noise: Floats, raw: int, constants: Constants) -> None:
    """Add one raw sample (mean specific force over the raw interval, body FRD) to the interval's sums.

    Each axis is clipped at the sensor's range *before* the averaging, as in PX4's `vehicle_imu`: a hit
    of 600 m/s2 for a fifth of the interval shows as 31 m/s2, not as 120.
    """
    raw_s = 1e-6 * constants.raw_interval_us
    rotation, velocity_before = scratch.rotation, scratch.velocity_before
    x = (state.body[3] - velocity_before[0]) / raw_s
    y = (state.body[4] - velocity_before[1]) / raw_s
    z = (state.body[5] - velocity_before[2]) / raw_s - GRAVITY_M_S2
    limit = constants.accelerometer_range_m_s2
    for i in range(3):
        true = rotation[0, i] * x + rotation[1, i] * y + rotation[2, i] * z
        seen = (
            true
            + constants.accelerometer_bias_frd_m_s2[i]
            + constants.accelerometer_raw_noise_m_s2 * noise[6 * raw + i]
        )
        if abs(seen) >= limit:
            state.clip_counts[i] += 1
        state.specific_force_sum[i] += min(max(seen, -limit), limit)
        state.rate_sum[i] += (
            state.body[10 + i]
            + constants.gyroscope_bias_frd_rad_s[i]
            + constants.gyroscope_raw_noise_rad_s * noise[6 * raw + 3 + i]
        )
