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
value, `Search`, and `advance_search` takes it on by a piece: no more than so many hypotheses are simulated, whatever
the time that takes. So the same messages give the same normal at the same message in flight, lockstep and replay.
"""

import math
from dataclasses import dataclass, replace
from functools import lru_cache

import numpy as np

from companion.estimate import guards as g
from companion.estimate.config import GuardsConfig
from companion.estimate.hypotheses import (
    Floats,
    Hypotheses,
    Measurement,
    Touch,
    initial_hypotheses,
    measurement_of,
    residuals,
)
from companion.messages import Attitude, ImuSample, Vector3

# Without machine code the search would take seconds.
IS_AVAILABLE = g.IS_COMPILED
# Suppositions that are followed in one piece of work: two milliseconds here. Nine messages are then enough, and the
# normal is there before the recovery asks for it (flight.recovering), also where two hundred come in a second.
HYPOTHESES_A_PIECE = 400
# How much apart suppositions of one kind that are improved are at least.
APART_COSINE = math.cos(math.radians(18.0))
# The search takes what was measured for so much less certain, and so do the rounds of least squares, in which the best
# so many are improved by so many steps.
COARSE, ROUNDS, STEPS = 2.5, ((5.0, 12), (2.0, 12), (1.0, 12)), 4
# What misfits by so much more than the best goes no further.
MOST_CHI_SQUARED_ABOVE_BEST = 25.0
# Of a touch that is explained each number misfits by one or less; by this, it was not by guards on spring arms.
MOST_REDUCED_CHI_SQUARED = 3.0
DIFFERENCE_STEPS = np.array([0.005, 0.005, 0.01, 0.0002, 0.005, 0.005, 0.005, 0.02, 1.0, 0.05, 0.0002])
DAMPING, DAMPINGS, LEAST_DAMPING, MOST_DAMPING = 1e-2, (0.1, 1.0, 10.0, 100.0), 1e-5, 1e3
# Of one supposition in one step: itself, its slopes, and what may become of it.
HYPOTHESES_A_STEP = 1 + g.SIZE + len(DAMPINGS)
LOWER_BOUNDS = np.array([-0.7, -0.7, -0.02, -0.2, -0.5, -0.5, -0.5, -0.7, 0.0, -4.6, 0.001])
UPPER_BOUNDS = np.array([0.7, 0.7, 0.32, 0.0, 0.5, 0.5, 0.5, 0.7, 50.0, 0.0, 0.1])


@dataclass(frozen=True, slots=True)
class Search:
    """How far the search for one touch's normal has come; see `advance_search`."""

    measurement: Measurement | None
    hypotheses: Hypotheses | None
    chi_squared: Floats
    """Of the suppositions that have been looked at."""
    damping: Floats
    steps: int = -1
    """Of least squares; -1 while suppositions are looked at."""
    is_over: bool = False
    normal_ned: Vector3 | None = None
    """Unit vector out of the obstacle; None where too little is known of the touch or nothing explains it."""


def begin_search(touch: Touch, velocity_ned_m_s: Vector3, guards: GuardsConfig, averaging_s: float) -> Search:
    """A search of which nothing is done; `velocity_ned_m_s` is v_c."""
    measurement = measurement_of(touch, velocity_ned_m_s, guards, averaging_s)
    nothing = np.zeros(0)
    if measurement is None:
        return Search(None, None, nothing, nothing, is_over=True)
    return Search(measurement, initial_hypotheses(measurement), nothing, nothing)


def advance_search(search: Search) -> Search:
    """The same search by one piece of work further; itself where it is over."""
    measurement, hypotheses = search.measurement, search.hypotheses
    if search.is_over or measurement is None or hypotheses is None:
        return search
    if search.steps < 0:
        return _scored(search, measurement, hypotheses)
    return _refined(search, measurement, hypotheses)


def normal_of(touch: Touch, velocity_ned_m_s: Vector3, guards: GuardsConfig, averaging_s: float) -> Vector3 | None:
    """What the search comes to, all at once."""
    search = begin_search(touch, velocity_ned_m_s, guards, averaging_s)
    while not search.is_over:
        search = advance_search(search)
    return search.normal_ned


@lru_cache(maxsize=1)
def prepare() -> None:
    """Compile, or load what the last start compiled: seconds that a flight does not have."""
    if not IS_AVAILABLE:
        return
    samples = [ImuSample(4_000 * number, (-float(number), 0.0, -10.0), (0.0, 0.0, 0.0)) for number in range(2)]
    touch = Touch((0.0, 0.0, -10.0), samples, [Attitude(0, (1.0, 0.0, 0.0, 0.0))])
    normal_of(touch, (1.0, 0.0, 0.0), GuardsConfig(), 0.004)


def _scored(search: Search, measurement: Measurement, hypotheses: Hypotheses) -> Search:
    """The next of the suppositions; after the last of them the best are left."""
    begun, count = search.chi_squared.size, len(hypotheses.values)
    part = hypotheses.chosen(range(begun, min(begun + HYPOTHESES_A_PIECE, count)))
    found = np.square(residuals(measurement, part, part.values, COARSE)).sum(axis=1)
    chi_squared = np.concatenate([search.chi_squared, found])
    if chi_squared.size < count:
        return replace(search, chi_squared=chi_squared)
    kept = hypotheses.chosen(_distinct(hypotheses, chi_squared))
    return replace(search, hypotheses=kept, damping=np.full(len(kept.values), DAMPING), steps=0)


def _distinct(hypotheses: Hypotheses, chi_squared: Floats) -> list[int]:
    """The few that fit best, each of another kind or with another normal than the better ones."""
    normals = hypotheses.normals(hypotheses.values)
    kept: list[int] = []
    for one in np.argsort(chi_squared, kind="stable").tolist():
        same = [other for other in kept if hypotheses.obstacles[other] == hypotheses.obstacles[one]]
        if all(normals[one] @ normals[other] < APART_COSINE for other in same):
            kept.append(one)
        if len(kept) == ROUNDS[0][1]:
            break
    return kept


def _refined(search: Search, measurement: Measurement, hypotheses: Hypotheses) -> Search:
    """As many steps as the piece has room for, but for one round; after a round the hopeless are left behind."""
    sigma_factor, _ = ROUNDS[search.steps // STEPS]
    damping, chi_squared, steps = search.damping, search.chi_squared, search.steps
    left = HYPOTHESES_A_PIECE // (HYPOTHESES_A_STEP * len(hypotheses.values))
    for _ in range(max(1, left)):
        values, damping, chi_squared = _levenberg_marquardt_step(measurement, hypotheses, damping, sigma_factor)
        hypotheses, steps = Hypotheses(values, hypotheses.axes, hypotheses.obstacles), steps + 1
        if steps % STEPS == 0:
            break
    else:
        return replace(search, hypotheses=hypotheses, damping=damping, chi_squared=chi_squared, steps=steps)
    if steps == STEPS * len(ROUNDS):
        return replace(search, hypotheses=None, is_over=True, normal_ned=_mean(measurement, hypotheses, chi_squared))
    most = ROUNDS[steps // STEPS][1]
    order = np.argsort(chi_squared, kind="stable")[:most]
    near = [int(one) for one in order if chi_squared[one] <= chi_squared.min() + MOST_CHI_SQUARED_ABOVE_BEST]
    return replace(search, hypotheses=hypotheses.chosen(near), damping=np.full(len(near), DAMPING), steps=steps)


def _mean(measurement: Measurement, hypotheses: Hypotheses, chi_squared: Floats) -> Vector3 | None:
    """Weighed by how likely each is."""
    if chi_squared.min() > MOST_REDUCED_CHI_SQUARED * measurement.measured.size:
        return None
    mean = np.exp(0.5 * (chi_squared.min() - chi_squared)) @ hypotheses.normals(hypotheses.values)
    n, e, d = mean / np.linalg.norm(mean)
    return (float(n), float(e), float(d))


def _levenberg_marquardt_step(
    measurement: Measurement, hypotheses: Hypotheses, damping: Floats, sigma_factor: float
) -> tuple[Floats, Floats, Floats]:
    """One step with the damping that helps most: values, dampings, misfits."""
    values, count = hypotheses.values, len(hypotheses.values)
    every = [*range(count)]
    around = np.concatenate([values, *(values + step for step in np.diag(DIFFERENCE_STEPS))])
    found = residuals(measurement, hypotheses.chosen(every * (g.SIZE + 1)), around, sigma_factor).reshape(
        g.SIZE + 1, count, -1
    )
    here = found[0]
    slopes = (found[1:] - here) / DIFFERENCE_STEPS[:, None, None]
    curvature, downhill = np.einsum("ank,bnk->nab", slopes, slopes), np.einsum("ank,nk->na", slopes, here)
    scale = np.einsum("naa->na", curvature) + 1e-9
    tried = []
    for factor in DAMPINGS:
        damped = curvature + (factor * damping[:, None] * scale)[:, :, None] * np.eye(g.SIZE) + 1e-9 * np.eye(g.SIZE)
        tried.append(
            np.clip(values - np.linalg.solve(damped, downhill[:, :, None])[:, :, 0], LOWER_BOUNDS, UPPER_BOUNDS)
        )
    candidates = np.array([*tried, values])
    off = residuals(measurement, hypotheses.chosen(every * len(DAMPINGS)), np.concatenate(tried), sigma_factor)
    chi_squared = np.square(np.concatenate([off, here])).sum(axis=1).reshape(len(candidates), count)
    best = chi_squared.argmin(axis=0)
    factors = np.array([*DAMPINGS, 10.0 * DAMPINGS[-1]])
    return (
        candidates[best, every],
        np.clip(damping * factors[best], LEAST_DAMPING, MOST_DAMPING),
        chi_squared[best, every],
    )
