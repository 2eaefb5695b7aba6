"""A guarded vehicle in the first hundredths of a second of a touch: suppositions about it, each followed. Compiled.

A guard is a hoop at the end of a spring arm. An obstacle with normal n touches it where its rim faces the obstacle, on
the edge that leans into it; without friction the push goes through the hoop's middle. Pressed in by a depth d the arm
folds by l = d / s, s the share of n in the hoop's plane, and pushes with (the paper's eq. 2 for one arm)

    F = (k l + b l') / s

and friction, no more than what ends the sliding (Coulomb). Vehicle and rates follow from F n - friction by impulse and
angular momentum, per unit mass: v' = g + R f + F, w' = K^-2 (r x F) + m, f what the accelerometer shows without the
touch, K the radii of gyration, m the motors, which brake the turning. All four guards may touch. On a round the normal
turns as the guard rolls.

Columns of a supposition: tilts of the normal along two axes [rad], friction, time of the touch [s], error of v_c (3)
[m/s], logarithm of the arms' stiffness over the setting's, motors' braking [1/s], logarithm of the radius [m], length
of a sample's mean [s].
"""

import math
from collections.abc import Callable
from typing import Any, TypeVar, cast

import numba
import numpy as np
import numpy.typing as npt

Floats = npt.NDArray[np.float64]
Ints = npt.NDArray[np.int64]
Kernel = TypeVar("Kernel", bound=Callable[..., Any])

# Of a supposition.
SIZE = 11
TILT, ACROSS, FRICTION, TOUCH, ERROR, STIFFNESS, BRAKING, RADIUS, AVERAGING = 0, 1, 2, 3, 4, 7, 8, 9, 10
# Of a measurement: what a sample says, six numbers; of an attitude three, and three zeros.
MEASURED = 6
FLAT = -1
MOST_FRICTION = 0.3

STEP_S = 0.001
GRAVITY_M_S2 = 9.80665
# Unit vectors of the arms of a quad-x, body FRD.
ARMS_FRD = np.array([[1.0, 1.0, 0.0], [-1.0, -1.0, 0.0], [1.0, -1.0, 0.0], [-1.0, 1.0, 0.0]]) / math.sqrt(2)
# Leaning by this the hoop stands on one edge; less, on both of them in part.
EDGE_LEAN_RAD = 0.1
# A hoop that faces the obstacle by more than 77 degrees has no one place on its rim, and does not fold.
LEAST_SHARE = 0.22
# An arm at the end of its travel meets a stop that ends the motion within some milliseconds.
STOP_PER_S2, STOP_DAMPING_PER_S = 60_000.0, 30.0
# Motors follow within 20 ms and turn the vehicle with no more than this.
MOTORS_S, MOTORS_RAD_S2, YAW_SHARE = 0.025, 100.0, 0.3


def _compiled(function: Kernel) -> Kernel:
    """To machine code, kept for the next start. No fast-math: the same inputs have to give the same bits."""
    return cast(Kernel, numba.njit(cache=True, fastmath=False)(function))


def _inlined(function: Kernel) -> Kernel:
    """The same, put into whatever calls it: arrays that are handed on are counted, which takes longer than the rest."""
    return cast(Kernel, numba.njit(cache=True, fastmath=False, forceinline=True)(function))


@_inlined
def _matrix(q: Floats, out: Floats) -> None:
    """Body FRD to NED."""
    w, x, y, z = q[0], q[1], q[2], q[3]
    out[0, 0], out[0, 1], out[0, 2] = 1.0 - 2.0 * (y * y + z * z), 2.0 * (x * y - w * z), 2.0 * (x * z + w * y)
    out[1, 0], out[1, 1], out[1, 2] = 2.0 * (x * y + w * z), 1.0 - 2.0 * (x * x + z * z), 2.0 * (y * z - w * x)
    out[2, 0], out[2, 1], out[2, 2] = 2.0 * (x * z - w * y), 2.0 * (y * z + w * x), 1.0 - 2.0 * (x * x + y * y)


@_inlined
def _turn(q: Floats, w: Floats, over_s: float) -> None:
    """The attitude a short time on, in place."""
    h = 0.5 * over_s
    a, b, c, d = q[0], q[1], q[2], q[3]
    q[0] += h * (-b * w[0] - c * w[1] - d * w[2])
    q[1] += h * (a * w[0] + c * w[2] - d * w[1])
    q[2] += h * (a * w[1] - b * w[2] + d * w[0])
    q[3] += h * (a * w[2] + b * w[1] - c * w[0])
    length = math.sqrt(q[0] * q[0] + q[1] * q[1] + q[2] * q[2] + q[3] * q[3])
    for i in range(4):
        q[i] /= length


@_inlined
def _farthest(guard: int, n: Floats, r: Floats, shape: Floats, out: Floats) -> float:
    """Where a guard reaches farthest against n, from the vehicle's middle, NED, m; returns the share s."""
    against = -(n[0] * r[0, 2] + n[1] * r[1, 2] + n[2] * r[2, 2])
    share = max(math.sqrt(max(0.0, 1.0 - against * against)), LEAST_SHARE)
    edge = 0.5 * shape[2] * min(max(against / EDGE_LEAN_RAD, -1.0), 1.0)
    for i in range(3):
        arm = r[i, 0] * ARMS_FRD[guard, 0] + r[i, 1] * ARMS_FRD[guard, 1]
        out[i] = shape[0] * arm + shape[1] / share * (-n[i] - against * r[i, 2]) + edge * r[i, 2]
    return share


@_inlined
def _cross(a: Floats, b: Floats, out: Floats) -> None:
    out[0], out[1], out[2] = a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]


@_compiled
def _first_reach(obstacle: int, n: Floats, r: Floats, shape: Floats, radius: float, axis: Floats) -> float:
    """How far a flat obstacle is from the middle, m, when the first guard touches; of a round its axis."""
    point = np.empty(3)
    far = -math.inf
    for guard in range(4):
        if obstacle in (FLAT, guard):
            _farthest(guard, n, r, shape, point)
            far = max(far, -(n[0] * point[0] + n[1] * point[1] + n[2] * point[2]))
            for i in range(3):
                axis[i] = 0.0 if obstacle == FLAT else point[i] - radius * n[i]
    return far if obstacle == FLAT else 0.0


@_inlined
def _round_normal(normal: Floats, from_axis: Floats, n: Floats) -> None:
    """Of a round's surface towards a guard; its axis is upright but for what the normal at first leans."""
    lean = 1.0 / max(1.0 - normal[2] * normal[2], 1e-6)
    level = lean * (from_axis[2] - normal[2] * (normal @ from_axis))
    for i in range(3):
        n[i] = from_axis[i] - level * ((1.0 if i == 2 else 0.0) - normal[2] * normal[i])
    length = math.sqrt(n[0] * n[0] + n[1] * n[1] + n[2] * n[2]) + 1e-9
    for i in range(3):
        n[i] /= length


@_inlined
def _force(fold: float, folding: float, stiffness: float, shape: Floats) -> float:
    """Along an arm, per unit mass; never a pull."""
    force: float = stiffness * shape[3] * fold + shape[4] * folding
    if fold > shape[5]:
        force += max(0.0, STOP_PER_S2 * (fold - shape[5]) + STOP_DAMPING_PER_S * folding)
    return max(0.0, force)


@_inlined
def _push(
    guard: int,
    obstacle: int,
    surface: Floats,
    normal: Floats,
    friction: float,
    stiffness: float,
    motion: Floats,
    r: Floats,
    shape: Floats,
    work: Floats,
    total: Floats,
) -> None:
    """Add one guard's push (NED) and its moment about the middle to `total` (2, 3), per unit mass.

    `surface`: a round's axis and radius, or how far a flat obstacle is. `motion`: place, velocity and rates, NED.
    """
    point, n, along, sliding, push = work[0], work[1], work[2], work[3], work[4]
    reach = surface[3] + shape[1] + shape[2]
    for i in range(3):
        n[i] = normal[i]
        point[i] = motion[0, i] + shape[0] * (r[i, 0] * ARMS_FRD[guard, 0] + r[i, 1] * ARMS_FRD[guard, 1]) - surface[i]
    if obstacle != FLAT:
        _round_normal(normal, point, n)
    if reach <= n[0] * point[0] + n[1] * point[1] + n[2] * point[2]:
        return
    share = _farthest(guard, n, r, shape, point)
    depth = surface[3]
    for i in range(3):
        depth -= (motion[0, i] + point[i] - surface[i]) * n[i]
    if depth <= 0.0:
        return
    for i in range(3):
        point[i] += depth * n[i]
    _cross(motion[2], point, sliding)
    inward, speed = 0.0, 1e-9
    for i in range(3):
        sliding[i] += motion[1, i]
        inward -= sliding[i] * n[i]
    force = _force(depth / share, inward / share, stiffness, shape) / share
    for i in range(3):
        sliding[i] += inward * n[i]
        speed += sliding[i] * sliding[i]
    speed = math.sqrt(speed)
    for i in range(3):
        along[i] = sliding[i] / speed
    _cross(point, along, push)
    soft = 1.0
    for j in range(3):
        lever = (r[0, j] * push[0] + r[1, j] * push[1] + r[2, j] * push[2]) / shape[6 + j]
        soft += lever * lever
    held = min(friction * force, 0.7 * speed / soft / STEP_S)
    for i in range(3):
        push[i] = force * n[i] - held * along[i]
        total[0, i] += push[i]
    _cross(point, push, along)
    for i in range(3):
        total[1, i] += along[i]


@_compiled
def _follow(
    trial: Floats,
    axes: Floats,
    obstacle: int,
    velocity: Floats,
    attitude: Floats,
    rates: Floats,
    free: Floats,
    times: Floats,
    shape: Floats,
    sums: Floats,
    attitudes: Floats,
) -> int:
    """Sums (steps, 6) of specific force and rates, body FRD, and attitudes (steps, 4) from the touch on; how many."""
    normal = axes[0] + math.tan(trial[TILT]) * axes[1] + math.tan(trial[ACROSS]) * axes[2]
    normal = normal / math.sqrt((normal * normal).sum())
    friction, stiffness = min(max(trial[FRICTION], 0.0), MOST_FRICTION), math.exp(trial[STIFFNESS])
    radius = 0.0 if obstacle == FLAT else math.exp(trial[RADIUS])
    q, w, motors, motion = attitude.copy(), rates.copy(), np.zeros(3), np.zeros((3, 3))
    r, surface, total, pushed, work = np.empty((3, 3)), np.zeros(4), np.zeros((2, 3)), np.empty(3), np.empty((5, 3))
    motion[1] = velocity + trial[ERROR : ERROR + 3]
    _turn(q, rates, trial[TOUCH])
    _matrix(q, r)
    surface[3] = radius - _first_reach(obstacle, normal, r, shape, radius, surface)
    steps: int = min(int((times[-1] - trial[TOUCH]) / STEP_S) + 2, sums.shape[0] - 1)
    sums[0] = 0.0
    attitudes[0] = q
    for step in range(steps):
        for i in range(3):
            motion[2, i] = r[i, 0] * w[0] + r[i, 1] * w[1] + r[i, 2] * w[2]
        total[:] = 0.0
        for guard in range(4):
            _push(guard, obstacle, surface, normal, friction, stiffness, motion, r, shape, work, total)
        for j in range(3):
            pushed[j] = free[j] + r[0, j] * total[0, 0] + r[1, j] * total[0, 1] + r[2, j] * total[0, 2]
            sums[step + 1, j] = sums[step, j] + pushed[j]
            sums[step + 1, 3 + j] = sums[step, 3 + j] + w[j]
        for i in range(3):
            gravity = GRAVITY_M_S2 if i == 2 else 0.0
            motion[1, i] += STEP_S * (r[i, 0] * pushed[0] + r[i, 1] * pushed[1] + r[i, 2] * pushed[2] + gravity)
            motion[0, i] += STEP_S * motion[1, i]
        for j in range(3):
            braking = trial[BRAKING] * (YAW_SHARE if j == 2 else 1.0)
            asked = min(max(-braking * (w[j] - rates[j]), -MOTORS_RAD_S2), MOTORS_RAD_S2)
            motors[j] += STEP_S / MOTORS_S * (asked - motors[j])
            moment = r[0, j] * total[1, 0] + r[1, j] * total[1, 1] + r[2, j] * total[1, 2]
            w[j] += STEP_S * (moment / (shape[6 + j] * shape[6 + j]) + motors[j])
        _turn(q, w, STEP_S)
        _matrix(q, r)
        attitudes[step + 1] = q
    return steps


@_compiled
def _summed(sums: Floats, at: float, entry: int, before: float) -> float:
    """A sum after so many steps; before the touch its slope is known."""
    if at <= 0.0:
        return at * before
    step = min(int(at), sums.shape[0] - 2)
    total: float = sums[step, entry] + (at - step) * (sums[step + 1, entry] - sums[step, entry])
    return total


@_compiled
def misfits(
    trials: Floats,
    axes: Floats,
    obstacles: Ints,
    velocity: Floats,
    attitude: Floats,
    rates: Floats,
    free: Floats,
    times: Floats,
    is_attitude: Ints,
    measured: Floats,
    spread: Floats,
    shape: Floats,
) -> Floats:
    """Each supposition less what was measured, in standard deviations: (n, 6 measurements).

    `trials` (n, 11); `axes` (n, 3, 3): the normal without tilt and the two ways it tilts, NED; `obstacles` (n,): FLAT
    or the guard that met a round. `velocity` is v_c NED, `attitude`, body `rates` and specific force `free` those of
    before the touch, carried on to time 0. `times` (k,) s, ascending; `measured` (k, 6): specific force and rates,
    means, or the attitude (4) where `is_attitude`; `spread` (k, 2): of forces and rates, or of the attitude. `shape`: a
    guard's place, radius, height, stiffness, damping and travel, and the radii of gyration.
    """
    count, known = trials.shape[0], times.shape[0]
    out = np.zeros((count, MEASURED * known))
    most = int((times[-1] - trials[:, TOUCH].min()) / STEP_S) + 4
    sums, attitudes = np.zeros((most, 6)), np.zeros((most, 4))
    for trial in range(count):
        steps = _follow(
            trials[trial], axes[trial], obstacles[trial], velocity, attitude, rates, free, times, shape, sums, attitudes
        )
        for k in range(known):
            at, first = (times[k] - trials[trial, TOUCH]) / STEP_S, MEASURED * k
            at = min(at, float(steps))
            if is_attitude[k]:
                q = attitudes[round(max(at, 0.0))]
                a, b, c, d = measured[k, 0], measured[k, 1], measured[k, 2], measured[k, 3]
                sign = 2.0 / spread[k, 0] * (1.0 if a * q[0] + b * q[1] + c * q[2] + d * q[3] > 0.0 else -1.0)
                out[trial, first] = sign * (a * q[1] - b * q[0] - c * q[3] + d * q[2])
                out[trial, first + 1] = sign * (a * q[2] - c * q[0] - d * q[1] + b * q[3])
                out[trial, first + 2] = sign * (a * q[3] - d * q[0] - b * q[2] + c * q[1])
                continue
            over = trials[trial, AVERAGING] / STEP_S
            for j in range(6):
                before = free[j] if j < 3 else rates[j - 3]
                mean = (_summed(sums, at, j, before) - _summed(sums, at - over, j, before)) / over
                out[trial, first + j] = (mean - measured[k, j]) / spread[k, 0 if j < 3 else 1]
    return out
