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

import numpy as np
import numpy.typing as npt

from companion.motion.strapdown import GRAVITY_M_S2, MOTORS_RAD_S2, YAW_SHARE

try:
    import numba
except ImportError:
    # The extra [fit] is not installed: a drone does without the fit.
    numba = None

IS_COMPILED = numba is not None

Floats = npt.NDArray[np.float64]
Ints = npt.NDArray[np.int64]
Kernel = TypeVar("Kernel", bound=Callable[..., Any])
# Numbers in tuples stay in registers: with small arrays in their place a supposition took six times as long.
Triple = tuple[float, float, float]
Frame = tuple[Triple, Triple, Triple]

# Of a supposition.
SIZE = 11
TILT, ACROSS, FRICTION, TOUCH, ERROR, STIFFNESS, BRAKING, RADIUS, AVERAGING = 0, 1, 2, 3, 4, 7, 8, 9, 10
# Of a measurement: what a sample says, six numbers; of an attitude three, and three zeros.
MEASURED = 6
FLAT = -1
MOST_FRICTION = 0.3

STEP_S = 0.001
# Unit vectors of the arms of a quad-x, body FRD.
ARMS_FRD = np.array([[1.0, 1.0, 0.0], [-1.0, -1.0, 0.0], [1.0, -1.0, 0.0], [-1.0, 1.0, 0.0]]) / math.sqrt(2)
# Leaning by this the hoop stands on one edge; less, on both of them in part.
EDGE_LEAN_RAD = 0.1
# A hoop that faces the obstacle by more than 77 degrees has no one place on its rim, and does not fold.
LEAST_SHARE = 0.22
# At the touch itself the depth is zero, and arms push by their damping already: rounding must not decide whether.
ROUNDING_M = 1e-9
# An arm at the end of its travel meets a stop that ends the motion within some milliseconds.
STOP_PER_S2, STOP_DAMPING_PER_S = 60_000.0, 30.0
# Motors follow within 20 ms.
MOTORS_S = 0.025


def _compiled(function: Kernel, inlined: bool = False) -> Kernel:
    """To machine code, kept for the next start. No fast-math: the same inputs have to give the same bits."""
    if numba is None:
        return function
    options = {"fastmath": False, "forceinline": True} if inlined else {"fastmath": False, "nogil": True}
    try:
        return cast(Kernel, numba.njit(cache=True, **options)(function))
    except RuntimeError:
        # Numba finds no folder to keep it in: neither beside this file nor in the user's own.
        return cast(Kernel, numba.njit(**options)(function))


def _inlined(function: Kernel) -> Kernel:
    """The same, put into whatever calls it."""
    return _compiled(function, inlined=True)


@_inlined
def _dot(a: Triple, b: Triple) -> float:
    return a[0] * b[0] + a[1] * b[1] + a[2] * b[2]


@_inlined
def _plus(a: Triple, times: float, b: Triple) -> Triple:
    return a[0] + times * b[0], a[1] + times * b[1], a[2] + times * b[2]


@_inlined
def _cross(a: Triple, b: Triple) -> Triple:
    return a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]


@_inlined
def _frame(q: tuple[float, float, float, float]) -> Frame:
    """The body's axes, NED."""
    w, x, y, z = q
    ahead = (1.0 - 2.0 * (y * y + z * z), 2.0 * (x * y + w * z), 2.0 * (x * z - w * y))
    right = (2.0 * (x * y - w * z), 1.0 - 2.0 * (x * x + z * z), 2.0 * (y * z + w * x))
    return ahead, right, (2.0 * (x * z + w * y), 2.0 * (y * z - w * x), 1.0 - 2.0 * (x * x + y * y))


@_inlined
def _turned(q: tuple[float, float, float, float], w: Triple, over_s: float) -> tuple[float, float, float, float]:
    """The attitude a short time on."""
    h = 0.5 * over_s
    a = q[0] - h * (q[1] * w[0] + q[2] * w[1] + q[3] * w[2])
    b = q[1] + h * (q[0] * w[0] + q[2] * w[2] - q[3] * w[1])
    c = q[2] + h * (q[0] * w[1] - q[1] * w[2] + q[3] * w[0])
    d = q[3] + h * (q[0] * w[2] + q[1] * w[1] - q[2] * w[0])
    per_length = 1.0 / math.sqrt(a * a + b * b + c * c + d * d)
    return per_length * a, per_length * b, per_length * c, per_length * d


@_inlined
def _middle(guard: int, r: Frame, shape: Floats) -> Triple:
    """Of a guard, from the vehicle's middle, NED, m."""
    x, y = shape[0] * ARMS_FRD[guard, 0], shape[0] * ARMS_FRD[guard, 1]
    return x * r[0][0] + y * r[1][0], x * r[0][1] + y * r[1][1], x * r[0][2] + y * r[1][2]


@_inlined
def _farthest(guard: int, n: Triple, r: Frame, shape: Floats) -> tuple[float, Triple]:
    """The share s, and where a guard reaches farthest against n, from the vehicle's middle, NED, m."""
    against = -_dot(n, r[2])
    share = max(math.sqrt(max(0.0, 1.0 - against * against)), LEAST_SHARE)
    edge = 0.5 * shape[2] * min(max(against / EDGE_LEAN_RAD, -1.0), 1.0)
    out = shape[1] / share
    return share, _plus(_plus(_middle(guard, r, shape), -out, n), edge - out * against, r[2])


@_inlined
def _first_reach(obstacle: int, n: Triple, r: Frame, shape: Floats, radius: float) -> tuple[float, Triple]:
    """How far a flat obstacle is from the middle, m, when the first guard touches; of a round its axis."""
    if obstacle != FLAT:
        return 0.0, _plus(_farthest(obstacle, n, r, shape)[1], -radius, n)
    far = -math.inf
    for guard in range(4):
        far = max(far, -_dot(n, _farthest(guard, n, r, shape)[1]))
    return far, (0.0, 0.0, 0.0)


@_inlined
def _round_normal(normal: Triple, from_axis: Triple) -> Triple:
    """Of a round's surface towards a guard; its axis is upright but for what the normal at first leans."""
    lean = 1.0 / max(1.0 - normal[2] * normal[2], 1e-6)
    level = lean * (from_axis[2] - normal[2] * _dot(normal, from_axis))
    x, y = from_axis[0] + level * normal[2] * normal[0], from_axis[1] + level * normal[2] * normal[1]
    z = from_axis[2] - level * (1.0 - normal[2] * normal[2])
    per_length = 1.0 / (math.sqrt(x * x + y * y + z * z) + 1e-9)
    return per_length * x, per_length * y, per_length * z


@_inlined
def _force(fold: float, folding: float, stiffness: float, shape: Floats) -> float:
    """Along an arm, per unit mass; never a pull."""
    force: float = stiffness * shape[3] * fold + shape[4] * folding
    if fold > shape[5]:
        force += max(0.0, STOP_PER_S2 * (fold - shape[5]) + STOP_DAMPING_PER_S * folding)
    return max(0.0, force)


@_inlined
def _pushed(
    guard: int,
    obstacle: int,
    surface: tuple[Triple, float],
    normal: Triple,
    holds: tuple[float, float],
    motion: Frame,
    r: Frame,
    shape: Floats,
) -> tuple[Triple, Triple]:
    """One guard's push, NED, and its moment about the middle, per unit mass.

    `surface`: a round's axis and radius, or how far a flat obstacle is. `holds`: friction and stiffness. `motion`:
    place, velocity and rates, NED.
    """
    axis, size = surface
    nothing = (0.0, 0.0, 0.0)
    from_axis = _plus(_plus(motion[0], 1.0, _middle(guard, r, shape)), -1.0, axis)
    n = normal if obstacle == FLAT else _round_normal(normal, from_axis)
    if size + shape[1] + shape[2] <= _dot(n, from_axis):
        return nothing, nothing
    share, point = _farthest(guard, n, r, shape)
    depth = size - _dot(_plus(_plus(motion[0], 1.0, point), -1.0, axis), n)
    if depth < -ROUNDING_M:
        return nothing, nothing
    point = _plus(point, depth, n)
    sliding = _plus(motion[1], 1.0, _cross(motion[2], point))
    inward = -_dot(sliding, n)
    force = _force(depth / share, inward / share, holds[1], shape) / share
    sliding = _plus(sliding, inward, n)
    speed = math.sqrt(_dot(sliding, sliding) + 1e-9)
    along = (sliding[0] / speed, sliding[1] / speed, sliding[2] / speed)
    turning = _cross(point, along)
    soft = 1.0
    for j in range(3):
        lever = _dot(r[j], turning) / shape[6 + j]
        soft += lever * lever
    held = min(holds[0] * force, 0.7 * speed / soft / STEP_S)
    push = _plus((force * n[0], force * n[1], force * n[2]), -held, along)
    return push, _cross(point, push)


@_compiled
def _follow(
    hypothesis: Floats,
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
    across = axes[0] + math.tan(hypothesis[TILT]) * axes[1] + math.tan(hypothesis[ACROSS]) * axes[2]
    across = across / math.sqrt((across * across).sum())
    normal = (across[0], across[1], across[2])
    holds = (min(max(hypothesis[FRICTION], 0.0), MOST_FRICTION), math.exp(hypothesis[STIFFNESS]))
    radius = 0.0 if obstacle == FLAT else math.exp(hypothesis[RADIUS])
    before = (rates[0], rates[1], rates[2])
    thrust, braking = (
        (free[0], free[1], free[2]),
        (hypothesis[BRAKING], hypothesis[BRAKING], YAW_SHARE * hypothesis[BRAKING]),
    )
    place, w, motors = (0.0, 0.0, 0.0), before, (0.0, 0.0, 0.0)
    v = (velocity[0] + hypothesis[ERROR], velocity[1] + hypothesis[ERROR + 1], velocity[2] + hypothesis[ERROR + 2])
    q = _turned((attitude[0], attitude[1], attitude[2], attitude[3]), before, hypothesis[TOUCH])
    r = _frame(q)
    far, axis = _first_reach(obstacle, normal, r, shape, radius)
    surface = (axis, radius - far)
    inertia = (shape[6] * shape[6], shape[7] * shape[7], shape[8] * shape[8])
    steps: int = min(int((times[-1] - hypothesis[TOUCH]) / STEP_S) + 2, sums.shape[0] - 1)
    sums[0] = 0.0
    attitudes[0, 0], attitudes[0, 1], attitudes[0, 2], attitudes[0, 3] = q
    for step in range(steps):
        turn = _plus(_plus((w[0] * r[0][0], w[0] * r[0][1], w[0] * r[0][2]), w[1], r[1]), w[2], r[2])
        push, moment = (0.0, 0.0, 0.0), (0.0, 0.0, 0.0)
        for guard in range(4):
            one = _pushed(guard, obstacle, surface, normal, holds, (place, v, turn), r, shape)
            push, moment = _plus(push, 1.0, one[0]), _plus(moment, 1.0, one[1])
        felt = (thrust[0] + _dot(r[0], push), thrust[1] + _dot(r[1], push), thrust[2] + _dot(r[2], push))
        for j in range(3):
            sums[step + 1, j] = sums[step, j] + felt[j]
            sums[step + 1, 3 + j] = sums[step, 3 + j] + w[j]
        pull = _plus(_plus(_plus((0.0, 0.0, GRAVITY_M_S2), felt[0], r[0]), felt[1], r[1]), felt[2], r[2])
        v = _plus(v, STEP_S, pull)
        place = _plus(place, STEP_S, v)
        asked = (
            min(max(-braking[0] * (w[0] - before[0]), -MOTORS_RAD_S2), MOTORS_RAD_S2),
            min(max(-braking[1] * (w[1] - before[1]), -MOTORS_RAD_S2), MOTORS_RAD_S2),
            min(max(-braking[2] * (w[2] - before[2]), -MOTORS_RAD_S2), MOTORS_RAD_S2),
        )
        motors = _plus(motors, STEP_S / MOTORS_S, _plus(asked, -1.0, motors))
        spun = (_dot(r[0], moment) / inertia[0], _dot(r[1], moment) / inertia[1], _dot(r[2], moment) / inertia[2])
        w = _plus(w, STEP_S, _plus(spun, 1.0, motors))
        q = _turned(q, w, STEP_S)
        r = _frame(q)
        attitudes[step + 1, 0], attitudes[step + 1, 1], attitudes[step + 1, 2], attitudes[step + 1, 3] = q
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
def weighted_residuals(
    hypotheses: Floats,
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

    `hypotheses` (n, 11); `axes` (n, 3, 3): the normal without tilt and its two directions of tilt, NED; `obstacles`
    (n,): FLAT or the guard that met a round. `velocity` is v_c NED, `attitude`, body `rates` and specific force `free`
    those of before the touch, carried on to time 0. `times` (k,) s, ascending; `measured` (k, 6): specific force and
    rates, means, or the attitude (4) where `is_attitude`; `spread` (k, 2): of forces and rates, or of the attitude.
    `shape`: a guard's place, radius, height, stiffness, damping and travel, and the radii of gyration.
    """
    count, known = hypotheses.shape[0], times.shape[0]
    out = np.zeros((count, MEASURED * known))
    most = int((times[-1] - hypotheses[:, TOUCH].min()) / STEP_S) + 4
    sums, attitudes = np.zeros((most, 6)), np.zeros((most, 4))
    for hypothesis in range(count):
        steps = _follow(
            hypotheses[hypothesis],
            axes[hypothesis],
            obstacles[hypothesis],
            velocity,
            attitude,
            rates,
            free,
            times,
            shape,
            sums,
            attitudes,
        )
        for k in range(known):
            at, first = (times[k] - hypotheses[hypothesis, TOUCH]) / STEP_S, MEASURED * k
            at = min(at, float(steps))
            if is_attitude[k]:
                q = attitudes[round(max(at, 0.0))]
                a, b, c, d = measured[k, 0], measured[k, 1], measured[k, 2], measured[k, 3]
                sign = 2.0 / spread[k, 0] * (1.0 if a * q[0] + b * q[1] + c * q[2] + d * q[3] > 0.0 else -1.0)
                out[hypothesis, first] = sign * (a * q[1] - b * q[0] - c * q[3] + d * q[2])
                out[hypothesis, first + 1] = sign * (a * q[2] - c * q[0] - d * q[1] + b * q[3])
                out[hypothesis, first + 2] = sign * (a * q[3] - d * q[0] - b * q[2] + c * q[1])
                continue
            over = hypotheses[hypothesis, AVERAGING] / STEP_S
            for j in range(6):
                before = free[j] if j < 3 else rates[j - 3]
                mean = (_summed(sums, at, j, before) - _summed(sums, at - over, j, before)) / over
                out[hypothesis, first + j] = (mean - measured[k, j]) / spread[k, 0 if j < 3 else 1]
    return out
