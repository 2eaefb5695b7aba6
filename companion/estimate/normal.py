"""The obstacle's normal, from the course of the push and from how it turned the vehicle.

Friction leans each part of the push against the sliding of the contact, by up to atan(mu): a head-on hit without
friction and a slanting one with it push the same way. They do not turn the vehicle the same way, because the normal
decides where a guard is touched (see `guards`). So hypotheses are tried: normals within 30 degrees of the push, on the
one or the other guard, with a friction up to 0.3, and the little that is not known of v_c along the obstacle or of the
moment of the touch. Each is followed from sample to sample by impulse and angular momentum

    v' = v + J,    w' = w + K^-2 (r x J),    J = N n - min(mu N, what ends the sliding) t,

N from the accelerometer, K the radii of gyration, and counts by how well it explains the direction of each sample's
push and the change of the rates up to it. The normal is the mean of all. The first hundredths of a second count most:
later another guard is touched, and a pole rolls.
"""

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from companion.estimate.guards import foremost, pushed, touched_at
from companion.estimate.rotation import body_to_ned
from companion.messages import Quaternion, Vector3
from companion.mission.config import GuardsConfig

Floats = npt.NDArray[np.float64]

# Friction of 0.3 leans the push by 17 degrees, the turning and the shaking of a sample by some more.
SPAN_RAD, STEP_RAD = math.radians(30.0), math.radians(5.0)
# Guards of plastic on a painted wall have 0.3.
FRICTIONS = (0.0, 0.15, 0.3)
# What v_c may be off by along the obstacle, m/s: it decides which way a head-on hit slides.
ASIDE_M_S = (-0.06, 0.0, 0.06)
# When in the first sample's interval the touch was, as the share that was contact, where samples leave gaps; and how
# well (logarithm) the force from then on must agree with the next sample's.
SHARES, AGREES = (0.2, 0.5, 0.8), 0.7
# Where samples follow each other the force tells it; most touches are in the first window's middle part.
USUAL_SHARE = 0.7
# Friction changes sides within milliseconds: steps of the hypotheses' motion.
SUB_STEP_S = 0.002
# The direction of a sample's push: 3 degrees, and what it shakes.
DIRECTION_RAD, SHAKING_M_S2 = 0.05, 0.4
# The rates' change: the gyroscope's noise, the motors' own part in it, the inertia of folding arms, 6 mm of lever.
RATE_RAD_S, MOTORS_RAD_S2, INERTIA_SHARE, LEVER_M = 0.08, 8.0, 0.15, 0.006
# How well the impulse between two samples is known where their windows join, and where a gap is between them.
JOINED, GAPPED = 0.12, 0.2
# Of samples that follow each other none is worse than this: some show another guard's touch.
WORST = 40.0
FADING_S, LOOKED_AT_S = 0.015, 0.03
DOWN = np.array([0.0, 0.0, 1.0])
# Of a ceiling's normal little is level; sideways then has no meaning.
LEAST_LEVEL = 0.2


@dataclass(frozen=True, slots=True)
class Part:
    """One sample of the push. `since_s` after the first, `over_s` after the one before it; body FRD."""

    since_s: float
    over_s: float
    joined: bool
    force_frd_m_s2: Vector3
    attitude_wxyz: Quaternion
    rates_frd_rad_s: Vector3
    turned_frd_rad_s: Vector3
    """Change of the rates since the sample before."""


@dataclass(slots=True)
class _Trials:
    """Hypotheses, one a column; `normal` is each one's number among the normals."""

    normal: npt.NDArray[np.int64]
    normals_ned: Floats
    guard: npt.NDArray[np.int64]
    friction: Floats
    share: Floats
    aside_ned_m_s: Floats
    misfit: Floats


def normal_of(parts: Sequence[Part], velocity_ned_m_s: Vector3, guards: GuardsConfig, averaging_s: float) -> Vector3:
    """Unit vector out of the obstacle, NED; zero where nothing pushed. `velocity_ned_m_s` is v_c."""
    turns = [_matrix(part.attitude_wxyz) for part in parts]
    forces = [np.array(part.force_frd_m_s2) for part in parts]
    fading = [math.exp(-part.since_s / FADING_S) for part in parts]
    push = sum((f * turn @ force for f, turn, force in zip(fading, turns, forces, strict=True)), np.zeros(3))
    size = float(np.linalg.norm(push))
    if size == 0.0:
        return (0.0, 0.0, 0.0)
    normals = _near(push / size)
    trials = _trials(normals, turns[0], parts[0].joined, guards)
    velocity = np.array(velocity_ned_m_s)
    before = 0.0
    for number, part in enumerate(parts):
        force_m_s2 = float(np.linalg.norm(forces[number]))
        after = float(np.linalg.norm(forces[1])) if len(parts) > 1 else 0.0
        course = _course(trials, part, number == 0, force_m_s2, before, after, averaging_s)
        misfit = _misfit(trials, part, turns[number], velocity, course, averaging_s, guards, number == 0)
        trials.misfit += fading[number] * misfit
        velocity = velocity + turns[number] @ forces[number] * course.mean_s
        before = force_m_s2
    likely = np.exp(0.5 * (trials.misfit.min() - trials.misfit))
    mean = np.bincount(trials.normal, likely, normals.shape[1]) @ normals.T
    n, e, d = mean / np.linalg.norm(mean)
    return (float(n), float(e), float(d))


def _near(middle: Floats) -> Floats:
    """Unit vectors (3, n) around one."""
    helper = DOWN if abs(middle[2]) < 0.8 else np.array([1.0, 0.0, 0.0])
    one = np.cross(helper, middle)
    one /= np.linalg.norm(one)
    other = np.cross(middle, one)
    tilts = np.arange(-SPAN_RAD, SPAN_RAD + 1e-9, STEP_RAD)
    x, y = (grid.ravel() for grid in np.meshgrid(tilts, tilts))
    inside = x * x + y * y <= SPAN_RAD**2 + 1e-9
    x, y = np.tan(x[inside]), np.tan(y[inside])
    vectors: Floats = middle[:, None] + one[:, None] * x + other[:, None] * y
    directions: Floats = vectors / np.linalg.norm(vectors, axis=0)
    return directions


def _trials(normals: Floats, turn: Floats, joined: bool, guards: GuardsConfig) -> _Trials:
    """All combinations; what is not known is the moment of the touch where there are gaps, the sliding where not."""
    order, unlikely = foremost(turn.T @ normals, guards)
    shares = np.array((USUAL_SHARE,) if joined else SHARES)
    asides = np.array(ASIDE_M_S if joined else (0.0,))
    axes = (np.arange(normals.shape[1]), np.arange(2), np.array(FRICTIONS), shares, asides)
    normal, second, friction, share, aside = (grid.ravel() for grid in np.meshgrid(*axes, indexing="ij"))
    level = np.cross(DOWN, normals.T).T
    level /= np.maximum(np.linalg.norm(level, axis=0), LEAST_LEVEL)
    misfit = unlikely[normal, second] + (aside / ASIDE_M_S[-1]) ** 2
    return _Trials(normal, normals[:, normal], order[normal, second], friction, share, aside * level[:, normal], misfit)


@dataclass(slots=True)
class _Course:
    """How hard the normal pushed since the sample before: impulses (steps, n), how long each step took (n,)."""

    impulses: Sequence[Floats]
    step_s: Floats
    mean_s: float


def _course(
    trials: _Trials, part: Part, is_first: bool, force: float, before: float, after: float, averaging_s: float
) -> _Course:
    """Between the sample before and this one, of which the wire shows only the ends. Forces per unit mass, m/s^2."""
    steps = max(1, math.ceil(part.over_s / SUB_STEP_S))
    if is_first:
        touched_s = trials.share * part.over_s
        if part.joined:
            height = force * part.over_s / touched_s
        else:
            height = force * averaging_s / np.minimum(touched_s, averaging_s)
            if after > 0.0:
                trials.misfit += (np.log(height / after) / AGREES) ** 2
    else:
        touched_s = np.full_like(trials.share, part.over_s)
        height = np.full_like(touched_s, force)
    step_s = touched_s / steps
    # Friction's share of the push is the rest.
    along = step_s / np.sqrt(1.0 + trials.friction**2)
    impulses = []
    for step in range(steps):
        done = (step + 0.5) / steps
        mean = height if is_first or part.joined else height + (before - height) * (1.0 - done)
        impulses.append(mean * along)
    mean_s = part.over_s if part.joined else float(touched_s.mean())
    return _Course(impulses, step_s, mean_s)


def _misfit(
    trials: _Trials,
    part: Part,
    turn: Floats,
    velocity_ned: Floats,
    course: _Course,
    averaging_s: float,
    guards: GuardsConfig,
    is_first: bool,
) -> Floats:
    """Squared misfit of each hypothesis with one sample."""
    normals = turn.T @ trials.normals_ned
    points = touched_at(normals, trials.guard, guards)
    gyration2 = np.square(guards.gyration_frd_m)[:, None]
    turned = np.array(part.turned_frd_rad_s)
    start = (np.array(part.rates_frd_rad_s) - turned)[:, None]
    velocity = turn.T @ (velocity_ned[:, None] + trials.aside_ned_m_s)
    rates, total, seen = start, np.zeros_like(normals), np.zeros_like(normals)
    left = len(course.impulses)
    for impulse in course.impulses:
        left -= 1
        velocity, rates, push = pushed(velocity, rates, normals, points, impulse, trials.friction, gyration2)
        total += push
        seen += push * np.clip((averaging_s - left * course.step_s) / course.step_s, 0.0, 1.0)
    force = np.array(part.force_frd_m_s2)
    size = float(np.linalg.norm(force))
    off = (force / size)[:, None] - seen / np.sqrt((seen * seen).sum(axis=0))
    misfit = (off * off).sum(axis=0) / (DIRECTION_RAD**2 + (SHAKING_M_S2 / size) ** 2)
    # The rates, the whole impulse taken a little larger or smaller.
    known = JOINED if part.joined and not is_first else GAPPED
    lever = (total * total).sum(axis=0) * (LEVER_M / float(gyration2.max())) ** 2
    own = RATE_RAD_S**2 + INERTIA_SHARE**2 * float(turned @ turned) + (MOTORS_RAD_S2 * part.over_s) ** 2
    spread2, change = own + lever, rates - start
    scale = (turned @ change / spread2 + known**-2) / ((change * change).sum(axis=0) / spread2 + known**-2)
    off = turned[:, None] - scale * change
    misfit += (off * off).sum(axis=0) / spread2 + ((scale - 1.0) / known) ** 2
    bounded: Floats = misfit / (1.0 + misfit / WORST) if part.joined else misfit
    return bounded


def _matrix(attitude_wxyz: Quaternion) -> Floats:
    """Body FRD to NED."""
    axes = ((1.0, 0.0, 0.0), (0.0, 1.0, 0.0), (0.0, 0.0, 1.0))
    return np.array([body_to_ned(attitude_wxyz, axis) for axis in axes]).T
