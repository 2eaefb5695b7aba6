"""The inertial sensor: raw samples with noise, bias and vibration, clipped one by one, then summed for the mean."""

import math

from sim_vehicle.physics.jit import inlined, njit
from sim_vehicle.physics.layout import GRAVITY_M_S2, Constants, Disturbance, PlantState, Scratch
from sim_vehicle.quantities import Floats


@inlined
def add_raw_sample(
    state: PlantState, scratch: Scratch, noise: Floats, raw: int, constants: Constants, disturbance: Disturbance
) -> None:
    """Add one raw sample (mean specific force over the raw interval, body FRD) to the interval's sums.

    Each axis is clipped at the sensor's range *before* the averaging, as in PX4's `vehicle_imu`: a hit
    of 600 m/s2 for a fifth of the interval shows as 31 m/s2, not as 120.
    """
    raw_s = 1e-6 * constants.raw_interval_us
    rotation, velocity_before = scratch.rotation, scratch.velocity_before
    x = (state.body[3] - velocity_before[0]) / raw_s
    y = (state.body[4] - velocity_before[1]) / raw_s
    z = (state.body[5] - velocity_before[2]) / raw_s - GRAVITY_M_S2
    turned = beside_the_centre_m_s2(constants.imu_frd_m, state.body, scratch.rates_before, raw_s)
    limit = constants.accelerometer_range_m_s2
    shaken = scratch.shaken
    if disturbance.shakes == 1:
        shake(state, raw_s, constants, disturbance, shaken)
    for i in range(3):
        true = rotation[0, i] * x + rotation[1, i] * y + rotation[2, i] * z + turned[i]
        seen = (
            true
            + constants.accelerometer_bias_frd_m_s2[i]
            + disturbance.accelerometer_bias_frd_m_s2[i]
            + constants.accelerometer_raw_noise_m_s2 * noise[6 * raw + i]
            + shaken[i]
        )
        if disturbance.stuck[i] == 1:
            seen = disturbance.stuck_at[i]
        clipped = min(max(seen, -limit), limit)
        if abs(seen) >= limit:
            state.clip_counts[i] += 1
            state.clipped_off_m_s[i] += raw_s * (seen - clipped)
        state.specific_force_sum[i] += clipped
        rate = (
            state.body[10 + i]
            + constants.gyroscope_bias_frd_rad_s[i]
            + disturbance.gyroscope_bias_frd_rad_s[i]
            + constants.gyroscope_raw_noise_rad_s * noise[6 * raw + 3 + i]
            + shaken[3 + i]
        )
        state.rate_sum[i] += disturbance.stuck_at[3 + i] if disturbance.stuck[3 + i] == 1 else rate


@inlined
def beside_the_centre_m_s2(place: Floats, body: Floats, before: Floats, raw_s: float) -> tuple[float, float, float]:
    """By how much more a place (FRD, m) of a body is accelerated than its centre; ``before``: rates ``raw_s`` ago."""
    x, y, z, p, q, r = place[0], place[1], place[2], body[10], body[11], body[12]
    a, b, c = (p - before[0]) / raw_s, (q - before[1]) / raw_s, (r - before[2]) / raw_s
    along, square = p * x + q * y + r * z, p * p + q * q + r * r
    return (
        b * z - c * y + p * along - square * x,
        c * x - a * z + q * along - square * y,
        a * y - b * x + r * along - square * z,
    )


@njit
def shake(state: PlantState, raw_s: float, constants: Constants, disturbance: Disturbance, shaken: Floats) -> None:
    """Turn the rotors on and write the vibration that they make on the raw axes into ``shaken`` (6,), m/s2 and rad/s.

    An unbalanced rotor's force grows with the square of its speed, as thrust does. It acts once a turn across the
    rotors' axes, and twice a turn along them (two blades that do not track).
    """
    shaken[:] = 0.0
    hover_n = constants.mass_kg * GRAVITY_M_S2 / constants.rotors
    for motor in range(constants.rotors):
        strength = max(state.motor_thrust_n[motor], 0.0) / hover_n
        phase = state.rotor_phase[motor] + 2 * math.pi * disturbance.shake_hz * math.sqrt(strength) * raw_s
        state.rotor_phase[motor] = phase % (2 * math.pi)
        once, ahead, twice = math.cos(phase), math.sin(phase), math.sin(2 * phase)
        # A sine's peak is the root of two times its RMS.
        acceleration = math.sqrt(2.0) * strength * disturbance.shake_m_s2[motor]
        turning = math.sqrt(2.0) * strength * disturbance.shake_rad_s[motor]
        shaken[0] += acceleration * once
        shaken[1] += acceleration * ahead
        shaken[2] += acceleration * twice
        shaken[3] += turning * ahead
        shaken[4] += turning * once
        shaken[5] += turning * twice
