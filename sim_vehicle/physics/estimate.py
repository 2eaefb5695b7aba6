"""What the vehicle knows of itself: position and velocity late and noisy, attitude nearly true."""

import math
from typing import Annotated

import numpy as np

from sim_vehicle.airframe import Airframe
from sim_vehicle.physics.jit import njit
from sim_vehicle.physics.layout import BODY_SIZE, GRAVITY_M_S2, Disturbance, PlantState
from sim_vehicle.physics.record import Matrix3, Vector3, new_record
from sim_vehicle.physics.rotation import matrix_from_quaternion, turn
from sim_vehicle.quantities import Floats

# Low-pass on the slope of the estimated velocity, the D of eq. 6: the noise of an optical-flow velocity
# differentiated at 100 Hz would otherwise tilt the vehicle by degrees.
SLOPE_TIME_CONSTANT_S = 0.05
# A hit that finds the corrections of another still going on waits for none of its own.
CORRECTED_AFTER_S = 1.5
# Less than this hidden in an interval disturbs nobody: a propeller that makes the sensor clip now and then.
LEAST_HIDDEN_M_S = 0.02


# Columns of the ring that makes the delay, a row an interval: the body, and the velocity (NED) that clipping hid.
HIDDEN = BODY_SIZE
PAST_COLUMNS = BODY_SIZE + 3


class EstimateErrors:
    """First-order Gauss-Markov errors, and what clipping hides from the estimate."""

    error: Annotated[Floats, (9,)]  # position m, velocity m/s, attitude rad (body axes)
    keep: Annotated[Floats, (9,)]  # share of an error that is left after one interval
    drive: Annotated[Floats, (9,)]  # standard deviation of what is added in one interval
    cursor: int  # row of the ring that is written next
    velocity_before: Vector3  # the estimate's, one interval ago
    missed: Annotated[Floats, (9,)]  # what position m, velocity m/s, NED, are off by since a hit was hidden; and the
    # level acceleration m/s^2, NED, that is taken for one because the attitude is off
    since_missed_s: float  # since clipping began to hide something
    rotation: Matrix3  # working memory
    tilt: Vector3  # the same
    step_s: float
    imu_frd_m: Vector3  # place of the inertial sensor, from the centre of mass
    late_s: float
    frequency_rad_s: float  # 0: nothing is missed
    damping: float
    tilt_per_s: float


def estimate_errors(airframe: Airframe, body: Floats, rng: np.random.Generator) -> tuple[EstimateErrors, Floats]:
    """Errors in their stationary state, so that the first second is as noisy as the last. And the ring of past bodies
    (delay in intervals + 1, PAST_COLUMNS); without rows the estimate comes from elsewhere.
    """
    estimate = airframe.estimate
    interval_s = 1e-6 * airframe.imu.integration_interval_us
    sigma = np.repeat([estimate.position_noise_m, estimate.velocity_noise_m_s, estimate.attitude_noise_rad], 3)
    correlation_s = np.repeat(
        [estimate.position_correlation_s, estimate.velocity_correlation_s, estimate.attitude_correlation_s], 3
    )
    keep = np.exp(-interval_s / correlation_s)
    slots = round(estimate.delay_s / interval_s) + 1 if estimate.kind == "markov" else 0
    found = estimate.clipping
    clipping = found.model_dump(include={"late_s", "frequency_rad_s", "damping", "tilt_per_s"}) if found else {}
    errors = new_record(
        EstimateErrors,
        error=sigma * rng.standard_normal(9),
        keep=keep,
        drive=sigma * np.sqrt(1 - keep**2),
        since_missed_s=CORRECTED_AFTER_S,
        step_s=interval_s,
        imu_frd_m=np.array(airframe.imu.place_frd_m),
        **clipping,
    )
    return errors, np.tile([*body, 0.0, 0.0, 0.0], (slots, 1))


@njit
def update_estimate(
    state: PlantState, errors: EstimateErrors, past: Floats, noise: Floats, disturbance: Disturbance
) -> None:
    """Renew ``state.estimate`` at the end of an interval; ``noise`` ends in nine values for it, standard normal."""
    note_what_is_clipped(state, errors, past[errors.cursor])
    errors.cursor = (errors.cursor + 1) % past.shape[0]
    delayed, first = past[errors.cursor], noise.shape[0] - 9
    for i in range(3):
        errors.velocity_before[i] = state.estimate[3 + i]
    for i in range(9):
        errors.error[i] = errors.keep[i] * errors.error[i] + errors.drive[i] * noise[first + i]
    miss_what_was_clipped(errors, delayed)
    for i in range(6):
        state.estimate[i] = delayed[i] + errors.error[i] + errors.missed[i] + disturbance.estimate_jump[i]
    for i in range(3):
        state.frame_offset_ned_m[i] = errors.error[i] + errors.missed[i] + disturbance.estimate_jump[i]
    for i in range(3):
        errors.tilt[i] = errors.error[6 + i]
    if errors.missed[6] != 0.0 or errors.missed[7] != 0.0:
        # A tilt by theta, NED, turns the thrust of a hover by theta x (0, 0, -g).
        matrix_from_quaternion(state.body, errors.rotation)
        north, east = errors.missed[7] / GRAVITY_M_S2, -errors.missed[6] / GRAVITY_M_S2
        for i in range(3):
            errors.tilt[i] += errors.rotation[0, i] * north + errors.rotation[1, i] * east
    turn(state.body, errors.tilt[0], errors.tilt[1], errors.tilt[2], state.estimate)


@njit
def note_what_is_clipped(state: PlantState, errors: EstimateErrors, row: Floats) -> None:
    """Write the body, and beside it what clipping hid in this interval; it shows as late as everything else does."""
    off = state.clipped_off_m_s
    for i in range(BODY_SIZE):
        row[i] = state.body[i]
    for i in range(3):
        row[HIDDEN + i] = 0.0
    x, y, z = errors.imu_frd_m[0], errors.imu_frd_m[1], errors.imu_frd_m[2]
    if x != 0.0 or y != 0.0 or z != 0.0:
        # The velocity is that of the sensor, which the vehicle is not told is beside the centre of mass.
        matrix_from_quaternion(state.body, errors.rotation)
        p, q, r = state.body[10], state.body[11], state.body[12]
        moves = (q * z - r * y, r * x - p * z, p * y - q * x)
        for i in range(3):
            for j in range(3):
                row[3 + i] += errors.rotation[i, j] * moves[j]
    if errors.frequency_rad_s > 0.0 and abs(off[0]) + abs(off[1]) + abs(off[2]) >= LEAST_HIDDEN_M_S:
        matrix_from_quaternion(state.body, errors.rotation)
        for i in range(3):
            for j in range(3):
                row[HIDDEN + i] += errors.rotation[i, j] * off[j]


@njit
def miss_what_was_clipped(errors: EstimateErrors, delayed: Floats) -> None:
    """What clipping hides of a hit is missing in the velocity, until other sensors have put velocity and place right.

    Some time after the hit the position error corrects position, velocity and, horizontally, tilt, by constant gains.
    The correction oscillates with the given frequency and damping, and ends slowly, by tilt_per_s.
    """
    step_s, frequency, missed = errors.step_s, errors.frequency_rad_s, errors.missed
    swing, rest = 2.0 * errors.damping * frequency, errors.tilt_per_s
    errors.since_missed_s += step_s
    is_hidden = delayed[HIDDEN] != 0.0 or delayed[HIDDEN + 1] != 0.0 or delayed[HIDDEN + 2] != 0.0
    if is_hidden and errors.since_missed_s > CORRECTED_AFTER_S:
        errors.since_missed_s = 0.0
    for i in range(3):
        missed[3 + i] -= delayed[HIDDEN + i]
        missed[i] += step_s * missed[3 + i]
        if errors.since_missed_s > errors.late_s:
            off_m, slow = missed[i], rest if i < 2 else 0.0
            missed[i] -= step_s * (swing + slow) * off_m
            missed[3 + i] += step_s * (missed[6 + i] - (frequency * frequency + swing * slow) * off_m)
            missed[6 + i] -= step_s * frequency * frequency * slow * off_m


@njit
def update_slope(state: PlantState, errors: EstimateErrors, step_s: float) -> None:
    """Low-pass the slope of the estimated velocity over one interval."""
    share = 1.0 - math.exp(-step_s / SLOPE_TIME_CONSTANT_S)
    for i in range(3):
        slope = (state.estimate[3 + i] - errors.velocity_before[i]) / step_s
        state.acceleration_ned_m_s2[i] += share * (slope - state.acceleration_ned_m_s2[i])
