"""What a healthy flight shakes: running mean and spread of the sideways specific force."""

import math
from dataclasses import dataclass

from rebound_cli.logs.shaking import MEMORY_US


@dataclass(frozen=True, slots=True)
class NoiseFloor:
    """Exponentially weighted mean (m/s^2) and variance of f_x and f_y, body FRD."""

    mean_x_m_s2: float = 0.0
    mean_y_m_s2: float = 0.0
    variance_x: float = 0.0
    variance_y: float = 0.0
    known_for_us: int = 0

    @property
    def spread_m_s2(self) -> float:
        """Standard deviation on the noisier axis."""
        return math.sqrt(max(self.variance_x, self.variance_y))

    def learn(self, f_x_m_s2: float, f_y_m_s2: float, elapsed_us: int) -> "NoiseFloor":
        """With one more sample, ``elapsed_us`` after the last; the first ones count as a plain mean."""
        known_for_us = min(self.known_for_us + elapsed_us, MEMORY_US)
        share = min(1.0, elapsed_us / known_for_us) if known_for_us > 0 else 1.0
        x, y = f_x_m_s2 - self.mean_x_m_s2, f_y_m_s2 - self.mean_y_m_s2
        keep = 1.0 - share
        return NoiseFloor(
            self.mean_x_m_s2 + share * x,
            self.mean_y_m_s2 + share * y,
            keep * (self.variance_x + share * x * x),
            keep * (self.variance_y + share * y * y),
            known_for_us,
        )
