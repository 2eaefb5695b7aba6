"""The delay of a velocity, the vehicle's own or a receiver's, learnt in its flight.

A velocity with the delay d differs from the integrated accelerometer by -d a. So a change of the acceleration a is a
step of velocity minus integral: s = -d a + noise. d is the least-squares estimate over all steps, with a prior.
"""

import math
from dataclasses import dataclass
from typing import NamedTuple

from companion.messages import Vector3
from companion.motion.config import (
    DELAY_S,
    LATEST_S,
    RECEIVER_DELAY_S,
    RECEIVER_LATEST_S,
    RECEIVER_REPEATS,
    RECEIVER_SPREAD_S,
)


class Prior(NamedTuple):
    """What is known of a delay before the flight: its mean, its standard deviation, the longest."""

    expected_s: float
    spread_s: float
    longest_s: float
    repeats: float = 1.0  # so many steps have the same noise

    def weight(self, variance_m2_s2: float) -> float:
        """Beside the squares of what is measured."""
        return self.repeats * variance_m2_s2 / self.spread_s**2


ESTIMATE = Prior(DELAY_S, DELAY_S, LATEST_S)
RECEIVER = Prior(RECEIVER_DELAY_S, RECEIVER_SPREAD_S, RECEIVER_LATEST_S, RECEIVER_REPEATS)


@dataclass(slots=True)
class Delay:
    """Changed only by `learn`. Velocities in m/s, accelerations in m/s^2, local NED."""

    prior: Prior = ESTIMATE
    _against: float = 0.0
    _square: float = 0.0

    def learn(self, step_m_s: Vector3, change_m_s2: Vector3) -> None:
        """Take one step of velocity minus integral, and the change of the acceleration in the same interval."""
        (a, b, c), (x, y, z) = step_m_s, change_m_s2
        self._against -= a * x + b * y + c * z
        self._square += x * x + y * y + z * z

    def delay_s(self, variance_m2_s2: float) -> float:
        """The delay; `variance_m2_s2` is the steps' variance on an axis at constant acceleration."""
        prior, weight = self.prior, self.prior.weight(variance_m2_s2)
        total = weight + self._square
        found_s = (weight * prior.expected_s + self._against) / total if total > 0.0 else prior.expected_s
        return min(max(found_s, 0.0), prior.longest_s)

    def error_s(self, variance_m2_s2: float) -> float:
        """Its standard deviation."""
        weight = self.prior.weight(variance_m2_s2)
        total = weight + self._square
        return self.prior.spread_s * math.sqrt(weight / total) if total > 0.0 else self.prior.spread_s
