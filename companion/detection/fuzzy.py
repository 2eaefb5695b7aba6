"""Detector `fuzzy`: an impact's acceleration, the inclination and the flip rate to one response intensity.

After F. Chui, G. Dicker and I. Sharf, "Dynamics of a quadrotor undergoing impact with a wall" (ICUAS 2016) and
G. Dicker, I. Sharf and P. Rustagi, "Recovery control for quadrotor UAV colliding with a pole" (IROS 2018). A collision
is a horizontal acceleration above a fixed threshold. A fuzzy process then rates it: three inputs, each low or high to a
degree,

    A   horizontal acceleration, m/s^2      I   inclination, rad      F   flip rate towards the obstacle, rad/s

and the response intensity R in [0, 1] is the weighted mean (Sugeno) of the rules

    A low -> 0.2      A high -> 1      I high -> 0.8      F high -> 0.8      I low and F low -> 0.2.

R is told as the impact's confidence and scales nothing: the recovery laws answer to v_c and the normal, which are
measured, and of which A, I and F are only signs.

Neither the articles' text nor a program of their authors was at hand: that they rate a collision by a fuzzy process is
what the paper says of them; their inputs, rules, membership functions and threshold were not checked. Those here are
this project's, and comparing with this file says little of theirs.
"""

import math
from collections.abc import Mapping
from dataclasses import dataclass
from typing import ClassVar

from companion.detection.contact import judge
from companion.detection.interface import DetectorState, Impact, Situation
from companion.estimate.strapdown import LEVEL
from companion.messages import Attitude, ImuSample, MessageId, Quaternion, Sample
from companion.written import Positive, Written


class FuzzyConfig(Written):
    """Settings of the detector `fuzzy`."""

    # Horizontal, because the thrust that carries the vehicle is vertical; a tilt of 30 degrees has 5.7.
    threshold_m_s2: Positive = 8.0
    # Where an input counts as wholly high: a hit at 1 m/s, a tilt of 45 degrees, half a turn in a second and a half.
    high_acceleration_m_s2: Positive = 30.0
    high_inclination_rad: Positive = 0.785
    high_flip_rad_s: Positive = 4.0


@dataclass(slots=True)
class FuzzyState(DetectorState):
    """Adds the attitude; changed in place."""

    attitude_wxyz: Quaternion = LEVEL


class FuzzyDetector:
    """See the module's text."""

    name = "fuzzy"
    losses: ClassVar[Mapping[MessageId, str]] = {}

    def __init__(self, config: FuzzyConfig, averaging_interval_us: int) -> None:
        self._config = config
        self._averaging_us = averaging_interval_us

    def initial(self) -> FuzzyState:
        return FuzzyState(threshold_m_s2=self._config.threshold_m_s2)

    def step(self, state: FuzzyState, sample: Sample, situation: Situation) -> tuple[FuzzyState, Impact | None]:
        if isinstance(sample, Attitude):
            state.attitude_wxyz = sample.attitude_wxyz
        if not isinstance(sample, ImuSample):
            return state, None
        # In body axes: across the thrust, which is what is horizontal of it in level flight.
        f_x, f_y, _ = sample.specific_force_frd_m_s2
        size = math.hypot(f_x, f_y)
        now_us = sample.time_boot_us
        free_until_us = min(now_us - self._averaging_us, state.last_sample_boot_us)
        is_loud = size >= state.threshold_m_s2
        impact = judge(state, now_us, free_until_us, (f_x, f_y, 0.0), size, is_loud, situation.off_reason)
        if impact is None:
            return state, None
        response = self.intensity(size, inclination_rad(state.attitude_wxyz), self._flip(sample, size))
        return state, Impact(now_us, free_until_us, impact.specific_force_frd_m_s2, confidence=response)

    @staticmethod
    def _flip(sample: ImuSample, size_m_s2: float) -> float:
        """Rate about the horizontal axis across the push, positive towards the obstacle: rad/s."""
        f_x, f_y, _ = sample.specific_force_frd_m_s2
        p, q, _ = sample.angular_velocity_frd_rad_s
        # A push to the rear (f_x < 0) and the nose going down (q < 0) is a flip towards the obstacle ahead.
        return (q * f_x - p * f_y) / size_m_s2

    def intensity(self, acceleration_m_s2: float, inclination_rad: float, flip_rad_s: float) -> float:
        """R of the rules in the module's text."""
        c = self._config
        a = _share(acceleration_m_s2, c.threshold_m_s2, c.high_acceleration_m_s2)
        i = _share(inclination_rad, 0.0, c.high_inclination_rad)
        f = _share(flip_rad_s, 0.0, c.high_flip_rad_s)
        calm = min(1.0 - i, 1.0 - f)
        weights = (1.0 - a) + a + i + f + calm
        return (0.2 * (1.0 - a) + a + 0.8 * i + 0.8 * f + 0.2 * calm) / weights


def inclination_rad(attitude_wxyz: Quaternion) -> float:
    """Angle between body z and down."""
    _, x, y, _ = attitude_wxyz
    return math.acos(min(1.0, max(-1.0, 1.0 - 2.0 * (x * x + y * y))))


def _share(value: float, low: float, high: float) -> float:
    """How far a value has come from low to high, 0 to 1."""
    return min(1.0, max(0.0, (value - low) / max(high - low, 1e-9)))
