"""A vehicle's own number, learnt in its flight: the slope k of y = -k x + noise, so that y + k x is what it leaves.

Of a velocity, the vehicle's own or a receiver's, it is the delay. One with the delay d differs from the integrated
accelerometer by -d a, so a change x of the acceleration a is a step y of velocity minus integral. A velocity of the
centre differs from that of an accelerometer beside it by how fast that turns about it. k is the least-squares estimate
over all pairs, with a prior.
"""

import math
from dataclasses import dataclass

from companion.messages import Vector3


@dataclass(slots=True)
class Slope:
    """Changed only by `learn`."""

    expected: float  # before the flight
    spread: float  # its standard deviation
    least: float
    most: float
    repeats: float = 1.0  # so many pairs have the same noise
    _against: float = 0.0
    _square: float = 0.0

    def learn(self, y: Vector3, x: Vector3) -> None:
        """Take one pair."""
        (a, b, c), (i, j, k) = y, x
        self._against -= a * i + b * j + c * k
        self._square += i * i + j * j + k * k

    def found(self, variance: float) -> tuple[float, float]:
        """The slope and its standard deviation; `variance`: of y on an axis where x is zero."""
        # Of what was known before, beside the squares of what is measured.
        weight = self.repeats * variance / self.spread**2
        total = weight + self._square
        if total <= 0.0:
            return self.expected, self.spread
        slope = (weight * self.expected + self._against) / total
        return min(max(slope, self.least), self.most), self.spread * math.sqrt(weight / total)
