"""Stiffness, damping and restitution from hits, each with its standard deviation.

The spring is the paper's eq. 2 on a wall that cannot pull.
"""

import math
from collections.abc import Sequence
from dataclasses import dataclass
from statistics import median_high

import numpy as np

from rebound_cli.identification.hit import Floats, Hit, Push


@dataclass(frozen=True, slots=True)
class Number:
    value: float
    sigma: float


@dataclass(frozen=True, slots=True)
class Spring:
    """Eq. 2 of the whole vehicle's mass on two guards, from so many hits; one guard has half of k_s and b_s."""

    natural_rad_s: Number
    ratio: Number  # of damping, below 1
    damping_per_s: Number
    hits: int

    @property
    def stiffness_per_s2(self) -> Number:
        natural = self.natural_rad_s
        return Number(natural.value**2, 2 * natural.value * natural.sigma)

    def on(self, guards: int) -> tuple[float, float]:
        """Natural frequency (rad/s) and damping ratio, the latter kept below 1: more is not told apart."""
        share = math.sqrt(guards / 2)
        return self.natural_rad_s.value * share, min(self.ratio.value * share, 0.999)

    def depth_m(self, hit: Hit) -> float:
        """How far the hit presses the spring."""
        natural, ratio = self.on(hit.guards)
        return hit.speed_in_m_s / natural * math.exp(-ratio / math.sqrt(1 - ratio**2) * math.acos(ratio))


def fit_restitution(hits: Sequence[Hit]) -> Number:
    """The mean ratio; its standard error from the spread of the hits, or from the noise if there is one."""
    ratios = [hit.ratio for hit in hits]
    sigma = math.hypot(*(hit.speed_sigma_m_s * math.hypot(1, hit.ratio) / hit.speed_in_m_s for hit in hits)) / len(hits)
    if len(hits) > 1:
        sigma = max(sigma, float(np.std(ratios, ddof=1)) / math.sqrt(len(hits)))
    return Number(float(np.mean(ratios)), sigma)


def _linear(design: Floats, measured: Floats) -> tuple[Floats, Floats]:
    """Two numbers of a linear model and their standard deviations."""
    numbers = np.linalg.lstsq(design, measured, rcond=None)[0].astype(np.float64)
    rest = measured - design @ numbers
    variance = float(rest @ rest) / max(1, len(rest) - 2)
    sigmas: Floats = np.sqrt(variance * np.diag(np.linalg.pinv(design.T @ design)))
    return numbers, sigmas


def fit_spring(hits: Sequence[Hit]) -> Spring | None:
    """b_s and k_s: each hit alone, then the median frequency and damping ratio; None where none shows a spring.

    Unlike k_s and b_s these two can be averaged each by itself without a new rebound. The standard deviation is
    the residuals' for one hit, and no less than the spread's for more: one hit says little about the next.
    """
    alone = [spring for hit in hits if (spring := _spring_of(hit)) is not None]
    if len(alone) <= 1:
        return alone[0] if alone else None
    natural, ratio = _median([spring.natural_rad_s for spring in alone]), _median([spring.ratio for spring in alone])
    sigma = 2 * math.hypot(ratio.value * natural.sigma, natural.value * ratio.sigma)
    return Spring(natural, ratio, Number(2 * ratio.value * natural.value, sigma), len(alone))


def _spring_of(hit: Hit) -> Spring | None:
    """The spring of one hit, or None where the contact is too short, or the data too poor, to show it."""
    spring = None if hit.push is None else _from_push(hit, hit.push)
    # A stiffness known no better than to a factor is not one to write into a file.
    if spring is None or spring.stiffness_per_s2.sigma >= spring.stiffness_per_s2.value or spring.ratio.value < 0:
        return None
    return spring


def _median(numbers: Sequence[Number]) -> Number:
    """Median and its standard error: 1.25 of a mean's, the spread from the median absolute deviation (1.48)."""
    values = np.array([number.value for number in numbers])
    middle = float(np.median(values))
    spread = 1.25 * 1.48 * float(np.median(np.abs(values - middle)))
    residual = float(np.median([number.sigma for number in numbers]))
    return Number(middle, max(spread, residual) / math.sqrt(len(values)))


def _from_push(hit: Hit, push: Push) -> Spring | None:
    """Eq. 2 is linear in k_s and b_s where depth, speed and acceleration are all known."""
    share, measured = hit.guards / 2, push.acceleration_m_s2
    design = share * np.column_stack([push.depth_m, push.speed_m_s])
    numbers, sigmas = _linear(design, measured)
    # Depth and speed start from a speed that is itself only known to the sigma of the hit, and the spring's
    # share of the push is a small difference: fitted again with that speed off by its sigma.
    off = hit.speed_sigma_m_s * np.column_stack([push.since_touch_s, np.ones(len(measured))])
    stiffness, damping = numbers.tolist()
    stiffness_sigma, damping_sigma = np.hypot(sigmas, _linear(design + share * off, measured)[0] - numbers).tolist()
    if stiffness <= 0:
        return None
    natural = math.sqrt(stiffness)
    ratio, relative = damping / (2 * natural), stiffness_sigma / stiffness / 2
    ratio_sigma = math.hypot(damping_sigma / (2 * natural), ratio * relative)
    return Spring(Number(natural, natural * relative), Number(ratio, ratio_sigma), Number(damping, damping_sigma), 1)


@dataclass(frozen=True, slots=True)
class Identified:
    """Everything fitted to the hits; None where they do not show it."""

    hits: Sequence[Hit]
    restitution: Number
    spring: Spring | None

    @property
    def deepest_m(self) -> float:
        """The furthest that any of the hits pressed the spring."""
        return 0.0 if self.spring is None else max(map(self.spring.depth_m, self.hits))

    @property
    def stop_m(self) -> float | None:
        stops = [hit.stop_m for hit in self.hits if hit.stop_m is not None]
        return median_high(stops) if stops else None


def identify(hits: Sequence[Hit]) -> Identified:
    return Identified(hits, fit_restitution(hits), fit_spring(hits))
