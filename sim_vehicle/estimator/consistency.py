"""Whether the filter is as wrong as it says: the normalised innovations squared, sensor by sensor."""

import math
from dataclasses import dataclass

# Half-width of the standard normal's middle 95 %.
TWO_SIDED_95 = 1.95996


@dataclass(slots=True)
class Innovations:
    """Of one sensor: NIS = y' S^-1 y, whose mean over a consistent filter is the number of its values."""

    dimension: int
    count: int = 0
    total: float = 0.0
    rejected: int = 0

    def add(self, nis: float, accepted: bool) -> None:
        """Count one innovation, whether it was fused or not."""
        self.count += 1
        self.total += nis
        self.rejected += not accepted

    @property
    def mean_per_value(self) -> float:
        """Mean NIS over its expectation: 1 for a consistent filter."""
        return self.total / (self.count * self.dimension) if self.count else math.nan

    @property
    def bounds(self) -> tuple[float, float]:
        """Between which `mean_per_value` lies in 95 of 100 flights of a consistent filter."""
        freedom = max(self.count * self.dimension, 1)
        return chi_square(freedom, -TWO_SIDED_95) / freedom, chi_square(freedom, TWO_SIDED_95) / freedom


def chi_square(freedom: int, normal_quantile: float) -> float:
    """Chi-square's quantile from the standard normal's (Wilson and Hilferty, 1931); to 0.1 % from 30 up."""
    spread = 2 / (9 * freedom)
    return freedom * (1 - spread + normal_quantile * math.sqrt(spread)) ** 3
