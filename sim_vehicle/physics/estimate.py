"""What the vehicle knows of itself: position and velocity late and noisy, attitude nearly true."""

import math
from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from sim_vehicle.airframe import Airframe
from sim_vehicle.physics.jit import njit
from sim_vehicle.physics.layout import Disturbance, PlantState
from sim_vehicle.physics.rotation import matrix_from_quaternion, turn

Floats = npt.NDArray[np.float64]
Ints = npt.NDArray[np.int64]

# Low-pass on the slope of the estimated velocity, the D of eq. 6: the noise of an optical-flow velocity
# differentiated at 100 Hz would otherwise tilt the vehicle by degrees.
SLOPE_TIME_CONSTANT_S = 0.05
# A hit that finds the corrections of another still going on waits for none of its own.
CORRECTED_AFTER_S = 1.5
# Less than this hidden in an interval disturbs nobody: a propeller that makes the sensor clip now and then.
LEAST_HIDDEN_M_S = 0.02


class EstimateErrors(NamedTuple):
    """First-order Gauss-Markov errors and the ring of past bodies that makes the delay."""

    error: Floats  # (9,) position m, velocity m/s, attitude rad (body axes)
    keep: Floats  # (9,) share of an error that is left after one interval
    drive: Floats  # (9,) standard deviation of what is added in one interval
    past: Floats  # (delay in intervals + 1, 13); without rows the estimate comes from elsewhere
    hidden_ned_m_s: Floats  # (rows of past, 3): what clipping hid in each of those intervals
    cursor: Ints  # (1,)
    velocity_before: Floats  # (3,) the estimate's, one interval ago
    missed: Floats  # (6,) position m, velocity m/s, NED: what the estimate is off by since clipping hid a hit from it
    since_missed_s: Floats  # (1,) since clipping began to hide something
    rotation: Floats  # (3, 3) working memory
    clipping: Floats  # (4,) interval s, late s, frequency rad/s, damping; frequency 0: nothing is missed


def estimate_errors(airframe: Airframe, body: Floats, rng: np.random.Generator) -> EstimateErrors:
    """Errors in their stationary state, so that the first second is as noisy as the last."""
    estimate = airframe.estimate
    interval_s = 1e-6 * airframe.imu.integration_interval_us
    sigma = np.repeat([estimate.position_noise_m, estimate.velocity_noise_m_s, estimate.attitude_noise_rad], 3)
    correlation_s = np.repeat(
        [estimate.position_correlation_s, estimate.velocity_correlation_s, estimate.attitude_correlation_s], 3
    )
    keep = np.exp(-interval_s / correlation_s)
    slots = round(estimate.delay_s / interval_s) + 1 if estimate.kind == "markov" else 0
    found = estimate.clipping
    clipping = (found.late_s, found.frequency_rad_s, found.damping) if found else (0.0, 0.0, 0.0)
    return EstimateErrors(
        error=sigma * rng.standard_normal(9),
        keep=keep,
        drive=sigma * np.sqrt(1 - keep**2),
        past=np.tile(body, (slots, 1)),
        hidden_ned_m_s=np.zeros((slots, 3)),
        cursor=np.zeros(1, np.int64),
        velocity_before=np.zeros(3),
        missed=np.zeros(6),
        since_missed_s=np.full(1, CORRECTED_AFTER_S),
        rotation=np.empty((3, 3)),
        clipping=np.array([interval_s, *clipping]),
    )


@njit
def update_estimate(state: PlantState, errors: EstimateErrors, noise: Floats, disturbance: Disturbance) -> None:
    """Renew ``state.estimate`` at the end of an interval; ``noise`` is (9,), standard normal."""
    slots = errors.past.shape[0]
    if slots == 0:
        return
    errors.past[errors.cursor[0]] = state.body
    note_what_is_clipped(state, errors)
    errors.cursor[0] = (errors.cursor[0] + 1) % slots
    delayed = errors.past[errors.cursor[0]]
    for i in range(3):
        errors.velocity_before[i] = state.estimate[3 + i]
    for i in range(9):
        errors.error[i] = errors.keep[i] * errors.error[i] + errors.drive[i] * noise[i]
    miss_what_was_clipped(errors)
    for i in range(6):
        state.estimate[i] = delayed[i] + errors.error[i] + errors.missed[i] + disturbance.estimate_jump[i]
    for i in range(3):
        state.frame_offset_ned_m[i] = errors.error[i] + errors.missed[i] + disturbance.estimate_jump[i]
    turn(state.body, errors.error[6], errors.error[7], errors.error[8], state.estimate)


@njit
def note_what_is_clipped(state: PlantState, errors: EstimateErrors) -> None:
    """Write what clipping hid in this interval beside the body; it shows as late as everything else does."""
    hidden, off = errors.hidden_ned_m_s[errors.cursor[0]], state.clipped_off_m_s
    hidden[:] = 0.0
    if errors.clipping[2] > 0.0 and abs(off[0]) + abs(off[1]) + abs(off[2]) >= LEAST_HIDDEN_M_S:
        matrix_from_quaternion(state.body, errors.rotation)
        for i in range(3):
            for j in range(3):
                hidden[i] += errors.rotation[i, j] * off[j]


@njit
def miss_what_was_clipped(errors: EstimateErrors) -> None:
    """What clipping hides of a hit is missing in the velocity, until other sensors have put velocity and place right.

    An estimator of second order that is corrected by the error of its position, some time after the hit.
    """
    step_s, late_s, frequency, damping = errors.clipping
    missed, hidden = errors.missed, errors.hidden_ned_m_s[errors.cursor[0]]
    errors.since_missed_s[0] += step_s
    is_hidden = hidden[0] != 0.0 or hidden[1] != 0.0 or hidden[2] != 0.0
    if is_hidden and errors.since_missed_s[0] > CORRECTED_AFTER_S:
        errors.since_missed_s[0] = 0.0
    for i in range(3):
        missed[3 + i] -= hidden[i]
        missed[i] += step_s * missed[3 + i]
        if errors.since_missed_s[0] > late_s:
            off_m = missed[i]
            missed[i] -= step_s * 2.0 * damping * frequency * off_m
            missed[3 + i] -= step_s * frequency * frequency * off_m


@njit
def update_slope(state: PlantState, errors: EstimateErrors, step_s: float) -> None:
    """Low-pass the slope of the estimated velocity over one interval."""
    if errors.past.shape[0] == 0:
        return
    share = 1.0 - math.exp(-step_s / SLOPE_TIME_CONSTANT_S)
    for i in range(3):
        slope = (state.estimate[3 + i] - errors.velocity_before[i]) / step_s
        state.acceleration_ned_m_s2[i] += share * (slope - state.acceleration_ned_m_s2[i])
