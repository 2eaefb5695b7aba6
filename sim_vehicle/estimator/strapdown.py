"""Inertial navigation through one sample, and the error's transition with it (kernels).

The nominal state, ``nominal``: position and velocity NED and attitude (w, x, y, z) as in `PlantState.body`; biases of
gyroscope and accelerometer, FRD; optical flow integrated since the sensor's last sample. The errors that the Kalman
filter estimates are those of the true state from it: attitude (a turn about the body's axes), velocity, position,
biases, integrated flow.
"""

import math
from typing import Annotated

import numpy as np

from sim_vehicle.physics.jit import njit
from sim_vehicle.physics.layout import GRAVITY_M_S2
from sim_vehicle.physics.record import Matrix3, Vector3
from sim_vehicle.physics.rotation import matrix_from_quaternion, normalise, turn
from sim_vehicle.quantities import Floats

# Rows of ``nominal``.
POSITION, VELOCITY, QUATERNION, GYROSCOPE_BIAS, ACCELEROMETER_BIAS, FLOW = 0, 3, 6, 10, 13, 16
NOMINAL_ROWS = 18
# Rows of the error.
D_ATTITUDE, D_VELOCITY, D_POSITION, D_GYROSCOPE, D_ACCELEROMETER, D_FLOW = 0, 3, 6, 9, 12, 15
ERROR_ROWS = 17
# Columns of an inertial sample: specific force, rates (means, FRD), raw samples clipped.
FORCE, RATES, CLIPPED = 0, 3, 6
SAMPLE_COLUMNS = 9
# Time constant of the output predictor: EKF2_TAU_VEL and EKF2_TAU_POS, their defaults.
TAU_S = 0.25

# The camera never comes closer to the ground than its feet let it; below this the flow would only divide by zero.
LEAST_DISTANCE_M = 0.05
# Nor is it of any use on its side: cos 80 deg.
LEAST_UPRIGHT = 0.17


@njit
def ground_distance(nominal: Floats, rotation: Floats) -> float:
    """Metres along the body's down axis to the flat ground at z = 0."""
    distance: float = max(-nominal[POSITION + 2], LEAST_DISTANCE_M) / max(rotation[2, 2], LEAST_UPRIGHT)
    return distance


@njit
def flow_rates(nominal: Floats, rotation: Floats, rates: Floats) -> None:
    """Write the flow about x and y (rad/s) that motion over the ground makes, turns apart."""
    distance = ground_distance(nominal, rotation)
    forward, right = 0.0, 0.0
    for i in range(3):
        forward += rotation[i, 0] * nominal[VELOCITY + i]
        right += rotation[i, 1] * nominal[VELOCITY + i]
    rates[0], rates[1] = -right / distance, forward / distance


@njit
def move(nominal: Floats, sample: Floats, step_s: float, rotation: Floats, acceleration: Floats) -> None:
    """Carry position, velocity and attitude through one sample.

    Leaves the rotation of the interval's middle and the acceleration (NED) in the arguments of that name.
    """
    half_s = 0.5 * step_s
    x = sample[RATES] - nominal[GYROSCOPE_BIAS]
    y = sample[RATES + 1] - nominal[GYROSCOPE_BIAS + 1]
    z = sample[RATES + 2] - nominal[GYROSCOPE_BIAS + 2]
    turn(nominal, half_s * x, half_s * y, half_s * z, nominal)
    matrix_from_quaternion(nominal, rotation)
    turn(nominal, half_s * x, half_s * y, half_s * z, nominal)
    for i in range(3):
        acceleration[i] = 0.0
        for j in range(3):
            acceleration[i] += rotation[i, j] * (sample[FORCE + j] - nominal[ACCELEROMETER_BIAS + j])
    acceleration[2] += GRAVITY_M_S2
    for i in range(3):
        nominal[POSITION + i] += step_s * (nominal[VELOCITY + i] + half_s * acceleration[i])
        nominal[VELOCITY + i] += step_s * acceleration[i]


@njit
def advance(nominal: Floats, sample: Floats, step_s: float, noise: Floats, transition: Floats, process: Floats) -> None:
    """Carry ``nominal`` through one sample and fill the error's transition F and process noise Q.

    ``noise``: standard deviations over one step of the angle (rad), the velocity (m/s), the two biases' walks,
    and of the velocity lost with one clipped raw sample (m/s).
    """
    rotation = np.empty((3, 3))
    middle = np.empty((3, 3))
    acceleration = np.empty(3)
    before, after = np.empty(2), np.empty(2)
    matrix_from_quaternion(nominal, rotation)
    flow_rates(nominal, rotation, before)
    move(nominal, sample, step_s, middle, acceleration)
    matrix_from_quaternion(nominal, rotation)
    flow_rates(nominal, rotation, after)
    for i in range(2):
        nominal[FLOW + i] += 0.5 * step_s * (before[i] + after[i])
    _fill_transition(nominal, sample, step_s, middle, transition)
    flow_slopes(nominal, rotation, step_s, transition[D_FLOW:])
    for i in range(2):
        transition[D_FLOW + i, D_FLOW + i] = 1.0
    _fill_process(sample, noise, middle, process)


@njit
def _fill_transition(nominal: Floats, sample: Floats, step_s: float, rotation: Floats, f: Floats) -> None:
    """F but for the flow: attitude' = -W x attitude - bias, velocity' = -R (f x attitude) - R bias."""
    wx = step_s * (sample[RATES] - nominal[GYROSCOPE_BIAS])
    wy = step_s * (sample[RATES + 1] - nominal[GYROSCOPE_BIAS + 1])
    wz = step_s * (sample[RATES + 2] - nominal[GYROSCOPE_BIAS + 2])
    f[0, 1], f[0, 2], f[1, 0], f[1, 2], f[2, 0], f[2, 1] = wz, -wy, -wz, wx, wy, -wx
    fx = sample[FORCE] - nominal[ACCELEROMETER_BIAS]
    fy = sample[FORCE + 1] - nominal[ACCELEROMETER_BIAS + 1]
    fz = sample[FORCE + 2] - nominal[ACCELEROMETER_BIAS + 2]
    for i in range(3):
        f[i, D_GYROSCOPE + i] = -step_s
        f[D_POSITION + i, D_VELOCITY + i] = step_s
        a, b, c = rotation[i, 0], rotation[i, 1], rotation[i, 2]
        f[D_VELOCITY + i, 0] = -step_s * (b * fz - c * fy)
        f[D_VELOCITY + i, 1] = -step_s * (c * fx - a * fz)
        f[D_VELOCITY + i, 2] = -step_s * (a * fy - b * fx)
        for j in range(3):
            f[D_VELOCITY + i, D_ACCELEROMETER + j] = -step_s * rotation[i, j]


@njit
def flow_slopes(nominal: Floats, rotation: Floats, scale: float, rows: Floats) -> None:
    """Write ``scale`` times the derivative of `flow_rates` by attitude, velocity and height into two ``rows``."""
    distance = ground_distance(nominal, rotation)
    body = np.zeros(3)
    for i in range(3):
        for j in range(3):
            body[i] += rotation[j, i] * nominal[VELOCITY + j]
    upright = max(rotation[2, 2], LEAST_UPRIGHT)
    # How the distance changes with a turn about x, about y, and with the height.
    by_x, by_y = distance * rotation[2, 1] / upright, -distance * rotation[2, 0] / upright
    by_down = -1.0 / upright
    share = scale / distance
    forward, right = share * body[0] / distance, share * body[1] / distance
    rows[0, 0] = -share * body[2] + right * by_x
    rows[0, 1] = right * by_y
    rows[0, 2] = share * body[0]
    rows[1, 0] = -forward * by_x
    rows[1, 1] = -share * body[2] - forward * by_y
    rows[1, 2] = share * body[1]
    for i in range(3):
        rows[0, D_VELOCITY + i] = -share * rotation[i, 1]
        rows[1, D_VELOCITY + i] = share * rotation[i, 0]
    rows[0, D_POSITION + 2] = right * by_down
    rows[1, D_POSITION + 2] = -forward * by_down


@njit
def _fill_process(sample: Floats, noise: Floats, rotation: Floats, q: Floats) -> None:
    """Q: noise on angle and velocity, walks of the biases, and on each axis what clipping may have taken."""
    along = np.empty(3)
    for i in range(3):
        lost = noise[4] * sample[CLIPPED + i]
        along[i] = noise[1] * noise[1] + lost * lost
    for i in range(3):
        q[i, i] = noise[0] * noise[0]
        q[D_GYROSCOPE + i, D_GYROSCOPE + i] = noise[2] * noise[2]
        q[D_ACCELEROMETER + i, D_ACCELEROMETER + i] = noise[3] * noise[3]
        for j in range(3):
            total = 0.0
            for k in range(3):
                total += rotation[i, k] * along[k] * rotation[j, k]
            q[D_VELOCITY + i, D_VELOCITY + j] = total


class Output:
    """What the vehicle goes by and reports: the filter's state as of now, without its jumps."""

    now: Annotated[Floats, (NOMINAL_ROWS + 3,)]  # as ``nominal``, and the last acceleration (NED)
    added: Annotated[Floats, (6,)]  # to position and velocity, since the start
    behind: Annotated[Floats, (6,)]  # sum of what they differed by
    turn: Vector3  # to add to the next sample's
    rotation: Matrix3  # working memory


@njit
def follow(nominal: Floats, samples: Floats, past: Floats, oldest: int, step_s: float, output: Output) -> None:
    """The output predictor: carry the output through the newest sample, and lead it towards the filter.

    PX4's (output_predictor.cpp). ``nominal`` is as old as the row ``oldest`` of the two rings: the samples, and the
    outputs less what was added until then. By what it differs from the output of then all since are corrected: position
    and velocity within TAU_S, the attitude within twice the delay.
    """
    now, added, slots = output.now, output.added, samples.shape[0]
    newest = (oldest + slots - 1) % slots
    for i in range(GYROSCOPE_BIAS, NOMINAL_ROWS):
        now[i] = nominal[i]
    turn(now, output.turn[0], output.turn[1], output.turn[2], now)
    move(now, samples[newest], step_s, output.rotation, now[NOMINAL_ROWS:])
    for i in range(6):
        past[newest, i] = now[i] - added[i]
    for i in range(QUATERNION, GYROSCOPE_BIAS):
        past[newest, i] = now[i]
    gain = step_s / TAU_S
    for i in range(6):
        behind = nominal[i] - past[oldest, i] - added[i]
        output.behind[i] += behind
        change = gain * (behind + 0.1 * gain * output.behind[i])
        added[i] += change
        now[i] += change
    a, b, c, d = nominal[6], nominal[7], nominal[8], nominal[9]
    w, x, y, z = past[oldest, 6], past[oldest, 7], past[oldest, 8], past[oldest, 9]
    share = math.copysign(1.0, a * w + b * x + c * y + d * z) / (slots - 1)
    output.turn[0] = share * (w * b - x * a + z * c - y * d)
    output.turn[1] = share * (w * c - y * a + x * d - z * b)
    output.turn[2] = share * (w * d - z * a + y * b - x * c)


@njit
def jump(nominal: Floats, past: Floats, oldest: int, output: Output) -> None:
    """Move position and velocity to the filter's at once: it was reset."""
    for i in range(6):
        change = nominal[i] - past[oldest, i] - output.added[i]
        output.added[i] += change
        output.now[i] += change


@njit
def keep_sample(samples: Floats, row: int, sensed: Floats, clipped: Floats) -> None:
    """Write a sample into a row of the ring. What it says of clipping is counted since boot, as ``clipped`` (3,) is."""
    for i in range(CLIPPED):
        samples[row, i] = sensed[i]
    for i in range(3):
        samples[row, CLIPPED + i] = sensed[CLIPPED + i] - clipped[i]
        clipped[i] = sensed[CLIPPED + i]


@njit
def show(now: Floats, share: float, estimate: Floats, acceleration: Floats) -> None:
    """Hand the output on: position, velocity and attitude as they are, the acceleration low-passed."""
    for i in range(GYROSCOPE_BIAS):
        estimate[i] = now[i]
    for i in range(3):
        acceleration[i] += share * (now[NOMINAL_ROWS + i] - acceleration[i])


@njit
def correct(nominal: Floats, error: Floats) -> None:
    """Move ``nominal`` by the estimated ``error`` and take that from the error."""
    turn(nominal, error[0], error[1], error[2], nominal)
    normalise(nominal)
    for i in range(3):
        nominal[VELOCITY + i] += error[D_VELOCITY + i]
        nominal[POSITION + i] += error[D_POSITION + i]
        nominal[GYROSCOPE_BIAS + i] += error[D_GYROSCOPE + i]
        nominal[ACCELEROMETER_BIAS + i] += error[D_ACCELEROMETER + i]
    for i in range(2):
        nominal[FLOW + i] += error[D_FLOW + i]
    error[:] = 0.0


@njit
def down_range(nominal: Floats, row: Floats) -> float:
    """Predicted distance along the beam; ``row`` (ERROR_ROWS,) gets its derivative by the error."""
    rotation = np.empty((3, 3))
    matrix_from_quaternion(nominal, rotation)
    distance = ground_distance(nominal, rotation)
    upright = max(rotation[2, 2], LEAST_UPRIGHT)
    row[:] = 0.0
    row[0] = distance * rotation[2, 1] / upright
    row[1] = -distance * rotation[2, 0] / upright
    row[D_POSITION + 2] = -1.0 / upright
    return distance


@njit
def heading(nominal: Floats, row: Floats) -> float:
    """Predicted heading (rad); ``row`` (ERROR_ROWS,) gets its derivative by the error."""
    rotation = np.empty((3, 3))
    matrix_from_quaternion(nominal, rotation)
    north, east = rotation[0, 0], rotation[1, 0]
    level = max(north * north + east * east, LEAST_UPRIGHT * LEAST_UPRIGHT)
    row[:] = 0.0
    row[1] = (-north * rotation[1, 2] + east * rotation[0, 2]) / level
    row[2] = (north * rotation[1, 1] - east * rotation[0, 1]) / level
    return math.atan2(east, north)
