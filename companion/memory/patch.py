"""A patch: what touches have shown of one surface, and how far it is believed to go on. Mission coordinates, metres."""

import math
from collections.abc import Sequence
from dataclasses import dataclass

from companion.messages import Vector3
from companion.reflex.config import STEEP

# One touch shows one place. Half a metre to every side is believed: the way round then passes a metre beside the touch,
# clear of a pole, a post or the leaf of a door, and a surface that goes on costs one hit more.
REACHES_M = 0.5
# What has been touched in places far apart is long: it is believed to go on by half of what is known of it. The end of
# a wall is then found in a number of hits that grows with the logarithm of its length ...
GOES_ON = 0.5
# ... but by no more than this, in which a door or the gap between two racks has room.
GOES_ON_MOST_M = 2.0


@dataclass(frozen=True, slots=True)
class Touch:
    """One hit: the place on the surface, the unit normal out of it and its standard deviation.

    `reaches_m` is how far the surface is believed to reach beyond this place, whatever else is known.
    """

    place_ned_m: Vector3
    normal_ned: Vector3
    normal_error_rad: float
    reaches_m: float
    found_at_us: int


@dataclass(frozen=True, slots=True)
class Patch:
    """One surface: all touches of it, the unit normal that they agree on and its standard deviation.

    The normal is horizontal, or the surface is a ceiling, a floor or a roof (`is_steep`). `found_at_us`: first touch.
    """

    touches_ned_m: tuple[Vector3, ...]
    normal_ned: Vector3
    normal_error_rad: float
    reaches_m: float
    found_at_us: int

    @property
    def hits(self) -> int:
        return len(self.touches_ned_m)

    @property
    def is_steep(self) -> bool:
        return abs(self.normal_ned[2]) > STEEP

    @property
    def centre_ned_m(self) -> Vector3:
        return mean_of(self.touches_ned_m)

    def along_m(self, place_ned_m: Vector3) -> float:
        """Of a wall: how far a place is from the centre, to the right of someone who looks along the normal."""
        (n, e, _), (north, east, _) = self.centre_ned_m, self.normal_ned
        return -(place_ned_m[0] - n) * east + (place_ned_m[1] - e) * north

    def off_m(self, place_ned_m: Vector3) -> float:
        """How far a place is in front of the surface's plane."""
        return sum(n * (p - c) for n, p, c in zip(self.normal_ned, place_ned_m, self.centre_ned_m, strict=True))

    def touched_along_m(self) -> tuple[float, float]:
        """Of a wall: from where to where it was touched."""
        return _range([self.along_m(place) for place in self.touches_ned_m])

    def believed_along_m(self) -> tuple[float, float]:
        """Of a wall: from where to where it is believed to go."""
        return _grown(self.touched_along_m(), self.reaches_m)

    def believed_heights_m(self) -> tuple[float, float]:
        """From which height to which it is believed to go; behind a ceiling and below a floor without an end."""
        low, high = touched = _range([-place[2] for place in self.touches_ned_m])
        if not self.is_steep:
            return _grown(touched, self.reaches_m)
        return (low, math.inf) if self.normal_ned[2] > 0.0 else (-math.inf, high)

    def faces(self, place_ned_m: Vector3, beside_m: float) -> bool:
        """Whether a place is in front of what is believed of it, or up to so much beside that."""
        if self.off_m(place_ned_m) <= 0.0:
            return False
        if self.is_steep:
            away_m = min(math.dist(place_ned_m[:2], touch[:2]) for touch in self.touches_ned_m)
            return away_m <= self.believed_beyond_m() + beside_m
        (left_m, right_m), (low_m, high_m) = self.believed_along_m(), self.believed_heights_m()
        along_m, height_m = self.along_m(place_ned_m), -place_ned_m[2]
        return left_m - beside_m <= along_m <= right_m + beside_m and low_m - beside_m <= height_m <= high_m + beside_m

    def believed_beyond_m(self) -> float:
        """Of a ceiling or a floor: how far it is believed to go on beyond its touches."""
        widest_m = max(math.dist(a[:2], b[:2]) for a in self.touches_ned_m for b in self.touches_ned_m)
        return goes_on_m(widest_m, self.reaches_m)


def goes_on_m(known_m: float, reaches_m: float) -> float:
    """How far a surface of which so much is known is believed to go on beyond it."""
    return max(reaches_m, min(GOES_ON_MOST_M, GOES_ON * known_m))


def mean_of(places: Sequence[Vector3]) -> Vector3:
    n, e, d = (sum(axis) / len(places) for axis in zip(*places, strict=True))
    return (n, e, d)


def _range(values: Sequence[float]) -> tuple[float, float]:
    return min(values), max(values)


def _grown(touched: tuple[float, float], reaches_m: float) -> tuple[float, float]:
    low, high = touched
    beyond_m = goes_on_m(high - low, reaches_m)
    return low - beyond_m, high + beyond_m
