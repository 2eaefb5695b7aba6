"""The obstacle's normal, from how the first hundredths of a second of a touch pushed and turned the vehicle.

Friction leans the push against the sliding of the contact, by up to atan(mu): a head-on hit without friction and a
slanting one with it push the same way. They do not turn the vehicle the same way, because the normal decides where a
guard is touched, and when the next one is. So suppositions are followed (see `guards`) and held against all that was
measured: forces and rates, and the attitude, which tells what the samples leave out. What is supposed: the normal,
flat or round (and then which guard met it and the radius), friction, the moment of the touch, and, near what is known
of them, v_c, the arms' stiffness and how hard the motors brake the turning.

A coarse search chooses a few; each is then improved by least squares (Levenberg 1944, Marquardt 1963), with what was
measured taken for less certain at first, or a sample that falls beside the touch of a second guard ends the way to it.
The normal is the mean of what they become, weighed by exp(-misfit / 2).

All that takes some 15 ms of a core here, which nothing that sends setpoints has to spare at once. So the search is a
value, `Search`, and `further` takes it on by a piece: no more than so many suppositions are followed, whatever the time
that takes, so that the same messages give the same normal at the same message in flight, in lockstep and in a replay.
"""

import math
from dataclasses import dataclass, replace
from functools import lru_cache

import numpy as np

from companion.estimate import guards as g
from companion.estimate.config import GuardsConfig
from companion.estimate.suppositions import Floats, Known, Touch, Trials, known_of, residuals, supposed
from companion.messages import Attitude, ImuSample, Vector3

# Without machine code the search would take seconds.
IS_AVAILABLE = g.IS_COMPILED
# Suppositions that are followed in one piece of work: two milliseconds here. Nine messages are then enough, and the
# normal is there before the recovery asks for it (flight.recovering), also where two hundred come in a second.
FOLLOWED = 400
# How much apart suppositions of one kind that are improved are at least.
APART = math.cos(math.radians(18.0))
# The search takes what was measured for so much less certain, and so do the rounds of least squares, in which the best
# so many are improved by so many steps.
COARSE, ROUNDS, STEPS = 2.5, ((5.0, 12), (2.0, 12), (1.0, 12)), 4
# What misfits by so much more than the best goes no further.
HOPELESS = 25.0
# Of a touch that is explained each number misfits by one or less; by this, it was not by guards on spring arms.
BELIEVED = 3.0
DIFFERENCES = np.array([0.005, 0.005, 0.01, 0.0002, 0.005, 0.005, 0.005, 0.02, 1.0, 0.05, 0.0002])
DAMPING, DAMPINGS, LEAST_DAMPING, MOST_DAMPING = 1e-2, (0.1, 1.0, 10.0, 100.0), 1e-5, 1e3
# Of one supposition in one step: itself, its slopes, and what may become of it.
FOLLOWED_A_STEP = 1 + g.SIZE + len(DAMPINGS)
LEAST = np.array([-0.7, -0.7, -0.02, -0.2, -0.5, -0.5, -0.5, -0.7, 0.0, -4.6, 0.001])
MOST = np.array([0.7, 0.7, 0.32, 0.0, 0.5, 0.5, 0.5, 0.7, 50.0, 0.0, 0.1])


@dataclass(frozen=True, slots=True)
class Search:
    """How far the search for one touch's normal has come; see `further`."""

    known: Known | None
    trials: Trials | None
    misfit: Floats
    """Of the suppositions that have been looked at."""
    damping: Floats
    steps: int = -1
    """Of least squares; -1 while suppositions are looked at."""
    is_over: bool = False
    normal_ned: Vector3 | None = None
    """Unit vector out of the obstacle; None where too little is known of the touch or nothing explains it."""


def begin(touch: Touch, velocity_ned_m_s: Vector3, guards: GuardsConfig, averaging_s: float) -> Search:
    """A search of which nothing is done; `velocity_ned_m_s` is v_c."""
    known = known_of(touch, velocity_ned_m_s, guards, averaging_s)
    nothing = np.zeros(0)
    if known is None:
        return Search(None, None, nothing, nothing, is_over=True)
    return Search(known, supposed(known), nothing, nothing)


def further(search: Search) -> Search:
    """The same search by one piece of work further; itself where it is over."""
    known, trials = search.known, search.trials
    if search.is_over or known is None or trials is None:
        return search
    if search.steps < 0:
        return _looked(search, known, trials)
    return _improved(search, known, trials)


def normal_of(touch: Touch, velocity_ned_m_s: Vector3, guards: GuardsConfig, averaging_s: float) -> Vector3 | None:
    """What the search comes to, all at once."""
    search = begin(touch, velocity_ned_m_s, guards, averaging_s)
    while not search.is_over:
        search = further(search)
    return search.normal_ned


@lru_cache(maxsize=1)
def prepare() -> None:
    """Compile, or load what the last start compiled: seconds that a flight does not have."""
    if not IS_AVAILABLE:
        return
    samples = [ImuSample(4_000 * number, (-float(number), 0.0, -10.0), (0.0, 0.0, 0.0)) for number in range(2)]
    touch = Touch((0.0, 0.0, -10.0), samples, [Attitude(0, (1.0, 0.0, 0.0, 0.0))])
    normal_of(touch, (1.0, 0.0, 0.0), GuardsConfig(), 0.004)


def _looked(search: Search, known: Known, trials: Trials) -> Search:
    """The next of the suppositions; after the last of them the best are left."""
    begun, count = search.misfit.size, len(trials.values)
    part = trials.chosen(range(begun, min(begun + FOLLOWED, count)))
    found = np.square(residuals(known, part, part.values, COARSE)).sum(axis=1)
    misfit = np.concatenate([search.misfit, found])
    if misfit.size < count:
        return replace(search, misfit=misfit)
    kept = trials.chosen(_distinct(trials, misfit))
    return replace(search, trials=kept, damping=np.full(len(kept.values), DAMPING), steps=0)


def _distinct(trials: Trials, misfit: Floats) -> list[int]:
    """The few that fit best, each of another kind or with another normal than the better ones."""
    normals = trials.normals(trials.values)
    kept: list[int] = []
    for one in np.argsort(misfit, kind="stable").tolist():
        same = [other for other in kept if trials.obstacles[other] == trials.obstacles[one]]
        if all(normals[one] @ normals[other] < APART for other in same):
            kept.append(one)
        if len(kept) == ROUNDS[0][1]:
            break
    return kept


def _improved(search: Search, known: Known, trials: Trials) -> Search:
    """As many steps as the piece has room for, but for one round; after a round the hopeless are left behind."""
    doubt, _ = ROUNDS[search.steps // STEPS]
    damping, misfit, steps = search.damping, search.misfit, search.steps
    left = FOLLOWED // (FOLLOWED_A_STEP * len(trials.values))
    for _ in range(max(1, left)):
        values, damping, misfit = _stepped(known, trials, damping, doubt)
        trials, steps = Trials(values, trials.axes, trials.obstacles), steps + 1
        if steps % STEPS == 0:
            break
    else:
        return replace(search, trials=trials, damping=damping, misfit=misfit, steps=steps)
    if steps == STEPS * len(ROUNDS):
        return replace(search, trials=None, is_over=True, normal_ned=_mean(known, trials, misfit))
    most = ROUNDS[steps // STEPS][1]
    order = np.argsort(misfit, kind="stable")[:most]
    near = [int(one) for one in order if misfit[one] <= misfit.min() + HOPELESS]
    return replace(search, trials=trials.chosen(near), damping=np.full(len(near), DAMPING), steps=steps)


def _mean(known: Known, trials: Trials, misfit: Floats) -> Vector3 | None:
    """Weighed by how likely each is."""
    if misfit.min() > BELIEVED * known.measured.size:
        return None
    mean = np.exp(0.5 * (misfit.min() - misfit)) @ trials.normals(trials.values)
    n, e, d = mean / np.linalg.norm(mean)
    return (float(n), float(e), float(d))


def _stepped(known: Known, trials: Trials, damping: Floats, doubt: float) -> tuple[Floats, Floats, Floats]:
    """One step with the damping that helps most: values, dampings, misfits."""
    values, count = trials.values, len(trials.values)
    every = [*range(count)]
    around = np.concatenate([values, *(values + step for step in np.diag(DIFFERENCES))])
    found = residuals(known, trials.chosen(every * (g.SIZE + 1)), around, doubt).reshape(g.SIZE + 1, count, -1)
    here = found[0]
    slopes = (found[1:] - here) / DIFFERENCES[:, None, None]
    curvature, downhill = np.einsum("ank,bnk->nab", slopes, slopes), np.einsum("ank,nk->na", slopes, here)
    scale = np.einsum("naa->na", curvature) + 1e-9
    tried = []
    for factor in DAMPINGS:
        damped = curvature + (factor * damping[:, None] * scale)[:, :, None] * np.eye(g.SIZE) + 1e-9 * np.eye(g.SIZE)
        tried.append(np.clip(values - np.linalg.solve(damped, downhill[:, :, None])[:, :, 0], LEAST, MOST))
    candidates = np.array([*tried, values])
    off = residuals(known, trials.chosen(every * len(DAMPINGS)), np.concatenate(tried), doubt)
    misfit = np.square(np.concatenate([off, here])).sum(axis=1).reshape(len(candidates), count)
    best = misfit.argmin(axis=0)
    factors = np.array([*DAMPINGS, 10.0 * DAMPINGS[-1]])
    return (
        candidates[best, every],
        np.clip(damping * factors[best], LEAST_DAMPING, MOST_DAMPING),
        misfit[best, every],
    )
