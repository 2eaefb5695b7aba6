"""The delay of the vehicle's velocity estimate, learnt in its flight.

A velocity with the delay d differs from the integrated accelerometer by -d a. So a change of the acceleration a is a
step of velocity minus integral: s = -d a + noise. d is the least-squares estimate over all steps, with a prior.
"""

from dataclasses import dataclass

from companion.messages import Vector3
from companion.motion.config import DELAY_S, LATEST_S


@dataclass(slots=True)
class Delay:
    """Changed only by `learn`. Velocities in m/s, accelerations in m/s^2, local NED."""

    _against: float = 0.0
    _square: float = 0.0

    def learn(self, step_m_s: Vector3, change_m_s2: Vector3) -> None:
        """Take one step of velocity minus integral, and the change of the acceleration in the same interval."""
        (a, b, c), (x, y, z) = step_m_s, change_m_s2
        self._against -= a * x + b * y + c * z
        self._square += x * x + y * y + z * z

    def delay_s(self, variance_m2_s2: float) -> float:
        """The delay; `variance_m2_s2` is the steps' variance on an axis at constant acceleration."""
        weight = variance_m2_s2 / DELAY_S**2
        total = weight + self._square
        found_s = (weight * DELAY_S + self._against) / total if total > 0.0 else DELAY_S
        return min(max(found_s, 0.0), LATEST_S)
