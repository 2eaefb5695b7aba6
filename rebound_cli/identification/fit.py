"""Stiffness, damping and restitution from hits, each with its uncertainty (one standard deviation)."""

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from scipy.optimize import least_squares

from rebound_cli.identification.hit import Floats, Hit, Push, Track
from rebound_cli.identification.model import contact_time, natural_and_ratio, path, restitution_of

# Positions see a spring only if the contact lasts this many of their intervals; eq. 2 bends the path three
# times (touch, turn, release), and with fewer samples any stiff spring fits.
_LEAST_CONTACT_INTERVALS = 2.5
# A stiffness known no better than to a factor is not one to write into a file.
_GREATEST_RELATIVE_SIGMA = 1.0
# Speed and loss are two numbers; from two hits they would follow without a check.
FEWEST_FOR_LOSS = 3

_STARTS_RAD_S = (25.0, 60.0, 120.0, 250.0)
_START_RATIO = 0.3
# Stiffer than this is a contact below 1 ms: beyond any motion capture and most inertial sensors.
_NATURAL_BOUNDS_RAD_S = (5.0, 3000.0)
_RATIO_BOUNDS = (0.001, 0.99)
# Logarithm of the frequency, ratio, then speed, place and moment of the touch, which are free; and their usual
# sizes: a third of the frequency, 0.1, 0.1 m/s, 5 mm and 10 ms.
_BOUNDS = (
    [math.log(_NATURAL_BOUNDS_RAD_S[0]), _RATIO_BOUNDS[0], -np.inf, -np.inf, -np.inf],
    [math.log(_NATURAL_BOUNDS_RAD_S[1]), _RATIO_BOUNDS[1], np.inf, np.inf, np.inf],
)
_SCALE = (0.3, 0.1, 0.1, 0.005, 0.01)


@dataclass(frozen=True, slots=True)
class Number:
    value: float
    sigma: float


@dataclass(frozen=True, slots=True)
class Rebound:
    """speed out = restitution * speed in - loss, never below zero; `loss_m_s` None is the model without it."""

    restitution: Number
    loss_m_s: Number | None = None

    def speed_out(self, hit: Hit) -> float:
        loss = self.loss_m_s.value if self.loss_m_s else 0.0
        return max(0.0, self.restitution.value * hit.speed_in_m_s - loss)


@dataclass(frozen=True, slots=True)
class Spring:
    """b_s and k_s of eq. 2, of the whole vehicle's mass and two guards; one guard has half of both."""

    stiffness_per_s2: Number
    damping_per_s: Number
    rms_residual: float
    """Of positions in metres, or of accelerations in m/s2."""
    hits: int
    """That showed it."""

    def speed_out(self, hit: Hit) -> float:
        share = hit.guards / 2
        _, ratio = natural_and_ratio(self.stiffness_per_s2.value * share, self.damping_per_s.value * share)
        return hit.speed_in_m_s * restitution_of(ratio)

    @property
    def contact_time_s(self) -> float:
        """Head-on, on two guards."""
        return contact_time(self.stiffness_per_s2.value, self.damping_per_s.value)


def fit_restitution(hits: Sequence[Hit]) -> Rebound:
    """The mean ratio; its standard error from the spread of the hits, or from the noise if there is one."""
    ratios = np.array([hit.ratio for hit in hits])
    noise = [hit.speed_sigma_m_s * math.hypot(1, hit.ratio) / hit.speed_in_m_s for hit in hits]
    sigma = math.sqrt(sum(n**2 for n in noise)) / len(hits)
    if len(hits) > 1:
        sigma = max(sigma, float(ratios.std(ddof=1)) / math.sqrt(len(hits)))
    return Rebound(Number(float(ratios.mean()), sigma))


def fit_restitution_with_loss(hits: Sequence[Hit]) -> Rebound:
    """A line through the speeds; from FEWEST_FOR_LOSS hits of different speeds on."""
    speeds_in = np.array([hit.speed_in_m_s for hit in hits])
    speeds_out = np.array([hit.speed_out_m_s for hit in hits])
    design = np.column_stack([speeds_in, -np.ones(len(hits))])
    numbers, *_ = np.linalg.lstsq(design, speeds_out, rcond=None)
    rest = speeds_out - design @ numbers
    variance = max(float(rest @ rest) / max(1, len(hits) - 2), max(hit.speed_sigma_m_s for hit in hits) ** 2)
    sigmas = np.sqrt(variance * np.diag(np.linalg.pinv(design.T @ design)))
    return Rebound(Number(float(numbers[0]), float(sigmas[0])), Number(float(numbers[1]), float(sigmas[1])))


def fit_friction(hits: Sequence[Hit]) -> Number | None:
    """Coulomb's coefficient at least: change of speed along the wall over change across it, of oblique hits.

    A guard that stops sliding, because the hit has set the vehicle turning, rolls off with less than that.
    """
    oblique = [hit for hit in hits if abs(hit.along_in_m_s) > hit.speed_in_m_s / 2]
    if not oblique:
        return None
    ratios = np.array([(abs(h.along_in_m_s) - abs(h.along_out_m_s)) / h.normal_change_m_s for h in oblique])
    noise = math.sqrt(sum((1.5 * h.speed_sigma_m_s / h.normal_change_m_s) ** 2 for h in oblique)) / len(oblique)
    spread = float(ratios.std(ddof=1)) / math.sqrt(len(oblique)) if len(oblique) > 1 else 0.0
    return Number(max(0.0, float(ratios.mean())), max(noise, spread))


def fit_spring(hits: Sequence[Hit]) -> Spring | None:
    """b_s and k_s: each hit alone, then the median frequency and damping ratio; None where none shows a spring.

    The standard deviation is the residuals' (Jacobian) for one hit, and no less than the spread's for more:
    the residuals of one hit say little about the next.
    """
    alone = [spring for hit in hits if (spring := spring_of(hit)) is not None]
    if not alone:
        return None
    frequencies, ratios = zip(*(_frequency_and_ratio(spring) for spring in alone), strict=True)
    frequency, ratio = _median(frequencies), _median(ratios)
    rms = math.sqrt(sum(spring.rms_residual**2 for spring in alone) / len(alone))
    return _spring(frequency.value, ratio.value, np.diag([frequency.sigma**2, ratio.sigma**2]), rms, len(alone))


def spring_of(hit: Hit) -> Spring | None:
    """The spring of one hit, or None where the contact is too short, or the data too poor, to show it."""
    if hit.push is not None:
        spring = _from_push(hit, hit.push)
    elif hit.track is not None:
        spring = _from_track(hit, hit.track)
        share = hit.guards / 2
        pressed_s = contact_time(spring.stiffness_per_s2.value * share, spring.damping_per_s.value * share)
        if pressed_s < _LEAST_CONTACT_INTERVALS * hit.track.interval_s:
            return None
    else:
        return None
    stiffness, damping = spring.stiffness_per_s2, spring.damping_per_s
    is_known = 0 <= stiffness.sigma < _GREATEST_RELATIVE_SIGMA * stiffness.value
    return spring if is_known and damping.value >= 0 else None


def _median(numbers: Sequence[Number]) -> Number:
    """Median and its standard error: 1.25 of a mean's, the spread from the median absolute deviation (1.48)."""
    values = np.array([number.value for number in numbers])
    middle = float(np.median(values))
    spread = 1.25 * 1.48 * float(np.median(np.abs(values - middle))) / math.sqrt(len(values))
    residual = float(np.median([number.sigma for number in numbers])) / math.sqrt(len(values))
    return Number(middle, max(spread, residual))


def _frequency_and_ratio(spring: Spring) -> tuple[Number, Number]:
    """Of one hit's spring: unlike k_s and b_s these two can be averaged each by itself without a new rebound."""
    stiffness, damping = spring.stiffness_per_s2, spring.damping_per_s
    natural = math.sqrt(stiffness.value)
    relative = stiffness.sigma / stiffness.value / 2
    ratio = damping.value / (2 * natural)
    ratio_sigma = math.hypot(damping.sigma / (2 * natural), ratio * relative)
    return Number(natural, natural * relative), Number(ratio, ratio_sigma)


def _from_push(hit: Hit, push: Push) -> Spring:
    """Eq. 2 is linear in k_s and b_s where depth, speed and acceleration are all known."""
    share, measured = hit.guards / 2, push.acceleration_m_s2
    design = share * np.column_stack([push.depth_m, push.speed_m_s])
    numbers, *_ = np.linalg.lstsq(design, measured, rcond=None)
    rest = measured - design @ numbers
    variance = float(rest @ rest) / max(1, len(rest) - 2)
    sigmas = np.sqrt(variance * np.diag(np.linalg.pinv(design.T @ design)))
    # Depth and speed start from a speed that is itself only known to the sigma of the hit, and the spring's
    # share of the push is a small difference: fitted again with that speed off by its sigma.
    off = hit.speed_sigma_m_s * np.column_stack([push.since_touch_s, np.ones(len(rest))])
    shifted, *_ = np.linalg.lstsq(design + share * off, measured, rcond=None)
    sigmas = np.hypot(sigmas, shifted - numbers)
    stiffness = Number(float(numbers[0]), float(sigmas[0]))
    return Spring(stiffness, Number(float(numbers[1]), float(sigmas[1])), math.sqrt(variance), hits=1)


def _from_track(hit: Hit, data: Track) -> Spring:
    """Two numbers of the spring, and speed, place and moment of the first touch."""
    share = math.sqrt(hit.guards / 2)

    def residuals(numbers: Floats) -> Floats:
        natural, ratio, speed, place, moment = numbers
        ratio = min(ratio * share, _RATIO_BOUNDS[1])
        depth = path(data.time_s - moment, speed, math.exp(natural) * share, ratio)
        rest: Floats = depth + place - data.towards_wall_m
        return rest

    top = int(np.argmax(data.towards_wall_m))
    fits = []
    for start_rad_s in _STARTS_RAD_S:
        lead_s = 1.0 / start_rad_s
        place = data.towards_wall_m[top] - 0.6 * lead_s * hit.speed_in_m_s
        start = [math.log(start_rad_s), _START_RATIO, hit.speed_in_m_s, place, data.time_s[top] - lead_s]
        fits.append(least_squares(residuals, start, bounds=_BOUNDS, x_scale=_SCALE, max_nfev=200))
    best = min(fits, key=lambda fit: float(fit.cost))
    variance = 2 * float(best.cost) / max(1, len(data.time_s) - len(best.x))
    covariance = variance * np.linalg.pinv(best.jac.T @ best.jac)
    natural, ratio = math.exp(best.x[0]), float(best.x[1])
    to_frequency = np.diag([natural, 1.0])  # the fit has its logarithm
    return _spring(natural, ratio, to_frequency @ covariance[:2, :2] @ to_frequency, math.sqrt(variance), hits=1)


def _spring(natural_rad_s: float, ratio: float, covariance: Floats, rms: float, hits: int) -> Spring:
    """k_s = w^2 and b_s = 2 z w, and their standard deviations from the covariance of w and z."""
    gradient = np.array([[2 * natural_rad_s, 0.0], [2 * ratio, 2 * natural_rad_s]])
    sigmas = np.sqrt(np.diag(gradient @ covariance @ gradient.T))
    stiffness = Number(natural_rad_s**2, float(sigmas[0]))
    return Spring(stiffness, Number(2 * ratio * natural_rad_s, float(sigmas[1])), rms, hits)
