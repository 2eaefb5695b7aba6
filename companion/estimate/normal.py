"""The obstacle's normal, fitted to forces and rotation in the first 22 ms of a contact.

Friction turns the contact force away from the normal by up to atan(mu): a head-on hit without friction and an oblique
hit with friction have the same force direction. Their rotation differs, because the normal decides where a guard is
touched, and when the next guard is. So hypotheses are simulated (see `guards`) and compared with all measurements:
forces, rates, and the attitude, which contains what falls between the samples. A hypothesis has a normal, a flat or a
round obstacle (with a guard and a radius), friction, and the time of the first touch. v_c, the arms' stiffness and the
motors' damping of the rotation vary about their known values.

A coarse search selects a few hypotheses. Least squares refine each (Levenberg 1944, Marquardt 1963). The first rounds
have larger standard deviations: a sample beside the touch of a second guard would otherwise be a local minimum. The
normal is the mean of the refined hypotheses, weighted by exp(-chi_squared / 2).

The search takes some 15 ms of a core here, longer than a loop that sends setpoints may block. So the search is a
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
# Hypotheses that are simulated in one piece of work, 2 ms here. Nine messages are then enough: at 200 messages a second
# the normal is known before the recovery needs it (flight.recovering).
HYPOTHESES_A_PIECE = 400
# Least angle between the normals of two selected hypotheses of one kind.
APART_COSINE = math.cos(math.radians(18.0))
# Factors on the measurements' standard deviations: of the coarse search, and of each round of least squares with the
# number of hypotheses that it keeps. Each round has STEPS steps.
COARSE, ROUNDS, STEPS = 2.5, ((5.0, 12), (2.0, 12), (1.0, 12)), 4
# A hypothesis whose chi squared is larger than the best one's by more than this is dropped.
MOST_CHI_SQUARED_ABOVE_BEST = 25.0
# Largest reduced chi squared, per measured number. A fit that explains the contact has 1 or less; above this it was no
# contact of guards on spring arms.
MOST_REDUCED_CHI_SQUARED = 3.0
DIFFERENCE_STEPS = np.array([0.005, 0.005, 0.01, 0.0002, 0.005, 0.005, 0.005, 0.02, 1.0, 0.05, 0.0002])
DAMPING, DAMPINGS, LEAST_DAMPING, MOST_DAMPING = 1e-2, (0.1, 1.0, 10.0, 100.0), 1e-5, 1e3
# Simulations of one hypothesis in one step: itself, its finite differences, and its candidates.
HYPOTHESES_A_STEP = 1 + g.SIZE + len(DAMPINGS)
LOWER_BOUNDS = np.array([-0.7, -0.7, -0.02, -0.2, -0.5, -0.5, -0.5, -0.7, 0.0, -4.6, 0.001])
UPPER_BOUNDS = np.array([0.7, 0.7, 0.32, 0.0, 0.5, 0.5, 0.5, 0.7, 50.0, 0.0, 0.1])


@dataclass(frozen=True, slots=True)
class Search:
    """How far the search for one touch's normal has come; see `advance_search`."""

    measurement: Measurement | None
    hypotheses: Hypotheses | None
    chi_squared: Floats
    """Sum of squared residuals of the hypotheses that have been simulated."""
    damping: Floats
    steps: int = -1
    """Steps of least squares so far; -1 during the coarse search."""
    is_over: bool = False
    normal_ned: Vector3 | None = None
    """Unit vector out of the obstacle; None where too little was measured or no hypothesis fits."""


def begin_search(touch: Touch, velocity_ned_m_s: Vector3, guards: GuardsConfig, averaging_s: float) -> Search:
    """A search before its first piece; `velocity_ned_m_s` is v_c, `averaging_s` the length of an IMU sample's mean."""
    measurement = measurement_of(touch, velocity_ned_m_s, guards, averaging_s)
    nothing = np.zeros(0)
    if measurement is None:
        return Search(None, None, nothing, nothing, is_over=True)
    return Search(measurement, initial_hypotheses(measurement), nothing, nothing)


def advance_search(search: Search) -> Search:
    """The search after one more piece of work; itself where it is over."""
    measurement, hypotheses = search.measurement, search.hypotheses
    if search.is_over or measurement is None or hypotheses is None:
        return search
    if search.steps < 0:
        return _scored(search, measurement, hypotheses)
    return _refined(search, measurement, hypotheses)


def normal_of(touch: Touch, velocity_ned_m_s: Vector3, guards: GuardsConfig, averaging_s: float) -> Vector3 | None:
    """The result of a whole search, all pieces at once."""
    search = begin_search(touch, velocity_ned_m_s, guards, averaging_s)
    while not search.is_over:
        search = advance_search(search)
    return search.normal_ned


@lru_cache(maxsize=1)
def prepare() -> None:
    """Compile the simulation, or load its compiled code: that takes seconds, and is done before a flight."""
    if not IS_AVAILABLE:
        return
    samples = [ImuSample(4_000 * number, (-float(number), 0.0, -10.0), (0.0, 0.0, 0.0)) for number in range(2)]
    touch = Touch((0.0, 0.0, -10.0), samples, [Attitude(0, (1.0, 0.0, 0.0, 0.0))])
    normal_of(touch, (1.0, 0.0, 0.0), GuardsConfig(), 0.004)


def _scored(search: Search, measurement: Measurement, hypotheses: Hypotheses) -> Search:
    """Simulate the next hypotheses of the coarse search; after the last, keep the best."""
    begun, count = search.chi_squared.size, len(hypotheses.values)
    part = hypotheses.chosen(range(begun, min(begun + HYPOTHESES_A_PIECE, count)))
    found = np.square(residuals(measurement, part, part.values, COARSE)).sum(axis=1)
    chi_squared = np.concatenate([search.chi_squared, found])
    if chi_squared.size < count:
        return replace(search, chi_squared=chi_squared)
    kept = hypotheses.chosen(_distinct(hypotheses, chi_squared))
    return replace(search, hypotheses=kept, damping=np.full(len(kept.values), DAMPING), steps=0)


def _distinct(hypotheses: Hypotheses, chi_squared: Floats) -> list[int]:
    """Indices of the best hypotheses that differ from all better ones in kind or normal."""
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
    """Steps of least squares within one piece and one round; a round ends by dropping the worst hypotheses."""
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
    """Mean normal, weighted by likelihood; None where no hypothesis fits."""
    if chi_squared.min() > MOST_REDUCED_CHI_SQUARED * measurement.measured.size:
        return None
    mean = np.exp(0.5 * (chi_squared.min() - chi_squared)) @ hypotheses.normals(hypotheses.values)
    n, e, d = mean / np.linalg.norm(mean)
    return (float(n), float(e), float(d))


def _levenberg_marquardt_step(
    measurement: Measurement, hypotheses: Hypotheses, damping: Floats, sigma_factor: float
) -> tuple[Floats, Floats, Floats]:
    """One step with the best of several dampings: values (n, 11), dampings (n,), chi squared (n,)."""
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
