"""Numbers drawn from a seed, rounded as a person would write them into a file."""

import math
from collections.abc import Sequence
from typing import TypeVar

import numpy as np

Choice = TypeVar("Choice")
NorthEast = tuple[float, float]

# A millimetre, a millimetre a second, a thousandth of a second: what is written is what is flown.
DIGITS = 3


class Draw:
    """The same seeds give the same numbers in the same order."""

    def __init__(self, *seeds: int) -> None:
        self._rng = np.random.default_rng(seeds)

    def number(self, low: float, high: float) -> float:
        return round(float(self._rng.uniform(low, high)), DIGITS)

    def whole(self, low: int, high: int) -> int:
        """`high` included."""
        return int(self._rng.integers(low, high + 1))

    def happens(self, share: float) -> bool:
        return bool(self._rng.random() < share)

    def one_of(self, choices: Sequence[Choice], weights: Sequence[float] | None = None) -> Choice:
        if weights is None:
            return choices[self.whole(0, len(choices) - 1)]
        shares = np.array(weights) / sum(weights)
        return choices[int(self._rng.choice(len(choices), p=shares))]

    def heading(self) -> float:
        """Radians."""
        return float(self._rng.uniform(-math.pi, math.pi))


def towards(start_ne_m: NorthEast, heading_rad: float, distance_m: float) -> NorthEast:
    north, east = start_ne_m
    return (
        round(north + distance_m * math.cos(heading_rad), DIGITS),
        round(east + distance_m * math.sin(heading_rad), DIGITS),
    )
