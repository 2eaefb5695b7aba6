"""The delay of a velocity, the vehicle's own or a receiver's, learnt in its flight.

A velocity with the delay d differs from the integrated accelerometer by -d a. So a change of the acceleration a is a
step of velocity minus integral: s = -d a + noise. d is the least-squares estimate over all steps, with a prior.
"""

import math
from dataclasses import dataclass

from companion.messages import Vector3
from companion.motion.config import DELAY_S, LATEST_S


@dataclass(slots=True)
class Delay:
    """Changed only by `learn`. Velocities in m/s, accelerations in m/s^2, local NED."""

    expected_s: float = DELAY_S  # before the flight
    spread_s: float = DELAY_S  # its standard deviation
    longest_s: float = LATEST_S
    repeats: float = 1.0  # so many steps have the same noise
    _against: float = 0.0
    _square: float = 0.0

    def learn(self, step_m_s: Vector3, change_m_s2: Vector3) -> None:
        """Take one step of velocity minus integral, and the change of the acceleration in the same interval."""
        (a, b, c), (x, y, z) = step_m_s, change_m_s2
        self._against -= a * x + b * y + c * z
        self._square += x * x + y * y + z * z

    def found_s(self, variance_m2_s2: float) -> tuple[float, float]:
        """The delay and its standard deviation; `variance_m2_s2`: of steps on an axis at constant acceleration."""
        # Of what was known before, beside the squares of what is measured.
        weight = self.repeats * variance_m2_s2 / self.spread_s**2
        total = weight + self._square
        if total <= 0.0:
            return self.expected_s, self.spread_s
        found_s = (weight * self.expected_s + self._against) / total
        return min(max(found_s, 0.0), self.longest_s), self.spread_s * math.sqrt(weight / total)
