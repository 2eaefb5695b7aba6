"""Surface patches: what one hit shows of a surface, how hits of one surface merge, and how far it is assumed to extend.

Mission coordinates, metres.
"""

import math
from collections.abc import Sequence
from typing import Annotated

import numpy as np
from pydantic import AfterValidator, Field

from companion.messages import Vector3
from companion.motion.vector import ZERO, along, minus, plus, unit
from companion.reflex.config import PLACE_SPREAD_M
from companion.reflex.surface import Normal, away_from, is_from_behind
from companion.strict_model import FARTHEST_M, NotNegative, PositionNed, StrictModel

# One touch shows one place. Half a metre to every side is assumed. A trajectory round it then passes a metre beside the
# touch, clear of a pole or a door leaf. A surface that is longer costs one more hit.
REACHES_M = 0.5
# A surface touched in places far apart is long: it is assumed to extend by half of its known length. The end of a wall
# is then found in a number of hits that grows with the logarithm of its length ...
GOES_ON = 0.5
# ... but by no more than this, in which a door or the gap between two racks has room.
GOES_ON_MOST_M = 2.0


def _outwards(normal_ned: Vector3) -> Vector3:
    if not any(normal_ned):
        raise ValueError("has no direction; it points out of the surface, such as [-1, 0, 0]")
    outwards = away_from(normal_ned)
    # One that has been read before stays as it is, to the bit: a flight with it can be repeated.
    return normal_ned if math.dist(outwards, normal_ned) < 1e-12 else outwards


class Patch(StrictModel):
    """A surface: where it was touched, and the direction out of it. NED from the arming position, metres."""

    touches_ned_m: Annotated[tuple[PositionNed, ...], Field(min_length=1)]
    """Places on the surface; of a wall two near its ends."""
    normal_ned: Annotated[PositionNed, AfterValidator(_outwards)]
    """Of any length; a wall's counts as horizontal, see surface.away_from."""
    normal_error_deg: Annotated[NotNegative, Field(le=90.0)] = 15.0
    """One standard deviation; the normal of one whole contact."""
    reaches_m: Annotated[NotNegative, Field(le=FARTHEST_M)] = REACHES_M
    """The least that it is assumed to extend beyond its touches."""
    found_at_us: Annotated[int, Field(strict=True, ge=0)] = 0
    """When it was first touched, by the clock of the flight that did."""

    @property
    def normal_error_rad(self) -> float:
        return math.radians(self.normal_error_deg)

    @property
    def is_steep(self) -> bool:
        """Whether it is no wall but a ceiling, a floor or a roof."""
        return self.normal_ned[2] != 0.0

    @property
    def centre_ned_m(self) -> Vector3:
        return mean_of(self.touches_ned_m)

    def along_m(self, place_ned_m: Vector3) -> float:
        """Of a wall: how far a place is from the centre, to the right of someone who looks along the normal."""
        (n, e, _), (north, east, _) = self.centre_ned_m, self.normal_ned
        return -(place_ned_m[0] - n) * east + (place_ned_m[1] - e) * north

    def place_ne_m(self, along_m: float, off_m: float = 0.0) -> tuple[float, float]:
        """Of a wall: the place, in plan, that is so far along it and in front of its plane."""
        (n, e, _), (north, east, _) = self.centre_ned_m, self.normal_ned
        return (n + off_m * north - along_m * east, e + off_m * east + along_m * north)

    def off_m(self, place_ned_m: Vector3) -> float:
        """How far a place is in front of the surface's plane."""
        return along(minus(place_ned_m, self.centre_ned_m), self.normal_ned)

    def beside_m(self, place_ned_m: Vector3) -> float:
        """How far a place is beside all touches: of a wall along it."""
        if self.is_steep:
            return min(math.dist(place_ned_m[:2], touch[:2]) for touch in self.touches_ned_m)
        return _outside_m(self.along_m(place_ned_m), self.touched_along_m())

    def bends_m(self, beside_m: float) -> float:
        """One standard deviation of its plane so far beside its touches, because its normal is not known better."""
        return beside_m * math.tan(min(self.normal_error_rad, MOST_ANGLE_RAD))

    def touched_along_m(self) -> tuple[float, float]:
        """Of a wall: from where to where it was touched."""
        places_m = [self.along_m(place) for place in self.touches_ned_m]
        return min(places_m), max(places_m)

    def assumed_along_m(self) -> tuple[float, float]:
        """Of a wall: both ends of its assumed extent."""
        return self._grown(*self.touched_along_m())

    def assumed_heights_m(self) -> tuple[float, float]:
        """Lowest and highest height of its assumed extent; unbounded above a ceiling and below a floor."""
        heights_m = [-place[2] for place in self.touches_ned_m]
        if not self.is_steep:
            return self._grown(min(heights_m), max(heights_m))
        return (min(heights_m), math.inf) if self.normal_ned[2] > 0.0 else (-math.inf, max(heights_m))

    def faces(self, place_ned_m: Vector3, beside_m: float) -> bool:
        """Whether a place is in front of the assumed extent, or at most `beside_m` beside it."""
        return self.off_m(place_ned_m) > 0.0 and self.is_near(place_ned_m, beside_m)

    def is_near(self, place_ned_m: Vector3, beside_m: float) -> bool:
        """Whether a place, off the plane or on it, is at most `beside_m` beside the assumed extent."""
        if self.is_steep:
            return self.beside_m(place_ned_m) <= self.assumed_beyond_m() + beside_m
        is_beside = _outside_m(self.along_m(place_ned_m), self.assumed_along_m()) <= beside_m
        return is_beside and _outside_m(-place_ned_m[2], self.assumed_heights_m()) <= beside_m

    def assumed_beyond_m(self) -> float:
        """Of a ceiling or a floor: how far it is assumed to extend beyond its touches."""
        return self._beyond_m(max(math.dist(a[:2], b[:2]) for a in self.touches_ned_m for b in self.touches_ned_m))

    def _grown(self, low_m: float, high_m: float) -> tuple[float, float]:
        beyond_m = self._beyond_m(high_m - low_m)
        return low_m - beyond_m, high_m + beyond_m

    def _beyond_m(self, known_m: float) -> float:
        """How far it is assumed to extend beyond a known length."""
        return max(self.reaches_m, min(GOES_ON_MOST_M, GOES_ON * known_m))


def mean_of(places: Sequence[Vector3]) -> Vector3:
    """Mean of one or more positions, m."""
    n, e, d = (sum(axis) / len(places) for axis in zip(*places, strict=True))
    return (n, e, d)


# Slower than this the obstacle came to the vehicle: it moves, and will not stand there as a wall does. The map keeps it
# where it was, with no assumed extent.
LEAST_SPEED_M_S = 0.3


def touch_of(
    centre_ned_m: Vector3, velocity_ned_m_s: Vector3, normal: Normal, reach_m: float, found_at_us: int
) -> Patch | None:
    """The patch of one hit, from the vehicle's centre and velocity; None where the direction is not known, or the
    place beyond all that there is.

    ``normal`` is horizontal, steep or zero (see surface.away_from). ``reach_m``: centre to the guards' rim.
    """
    touch = plus(centre_ned_m, -reach_m, normal.direction_ned)
    if normal.direction_ned == ZERO or not all(abs(part) <= FARTHEST_M for part in touch):
        return None
    is_fast = math.hypot(*velocity_ned_m_s) >= LEAST_SPEED_M_S
    is_behind = is_from_behind(normal.direction_ned, away_from(minus(ZERO, velocity_ned_m_s)))
    # Not validated: an estimate that has run away must not stop the flight here.
    return Patch.model_construct(
        touches_ned_m=(touch,),
        normal_ned=normal.direction_ned,
        normal_error_deg=min(math.degrees(normal.error_rad), 90.0),
        reaches_m=REACHES_M if is_fast and not is_behind else 0.0,
        found_at_us=found_at_us,
    )


# Normals this near to each other may be one surface's however sure each is of itself: a wall is not quite plane.
LEAST_ANGLE_RAD = math.radians(25.0)
# Walls of a corner stand at 90 degrees: normals that differ by more than this are never one surface's.
MOST_ANGLE_RAD = math.radians(60.0)
# Two places nearer to each other than this give no direction that is better than the normals.
LEAST_BASE_M = 0.4


def is_same(patch: Patch, touch: Patch, clearance_m: float) -> bool:
    """Whether the touch is one more of the patch's surface."""
    if patch.is_steep != touch.is_steep:
        return False
    errors_rad = math.hypot(patch.normal_error_rad, touch.normal_error_rad)
    angle_rad = math.acos(max(-1.0, min(1.0, along(patch.normal_ned, touch.normal_ned))))
    if angle_rad > min(MOST_ANGLE_RAD, max(LEAST_ANGLE_RAD, 2.0 * errors_rad)):
        return False
    place = touch.centre_ned_m
    errors_m = 2.0 * PLACE_SPREAD_M + patch.bends_m(patch.beside_m(place))
    return patch.is_near(place, 2.0 * clearance_m) and abs(patch.off_m(place)) <= errors_m


def joined(patches: Sequence[Patch], touch: Patch) -> Patch:
    """The touch and the patches of its surface as one; the normal by the means, then by places that lie far apart."""
    parts, normal = [*patches, touch], ZERO
    for part in parts:
        normal = plus(normal, len(part.touches_ned_m) / max(part.normal_error_rad, 1e-3) ** 2, part.normal_ned)
    patch = Patch.model_construct(
        touches_ned_m=tuple(place for part in parts for place in part.touches_ned_m),
        normal_ned=unit(normal),
        # Normals of one surface have errors in common (friction leans all alike): the mean is no better than the best.
        normal_error_deg=min(part.normal_error_deg for part in parts),
        reaches_m=max(part.reaches_m for part in parts),
        found_at_us=min(part.found_at_us for part in parts),
    )
    return patch if patch.is_steep else _turned_to_places(patch)


def _turned_to_places(patch: Patch) -> Patch:
    """A wall's normal square to the line through its touches (least squares), as far as those are apart enough."""
    low_m, high_m = patch.touched_along_m()
    error_rad = math.atan2(2.0 * PLACE_SPREAD_M, high_m - low_m)
    if high_m - low_m < LEAST_BASE_M or error_rad >= patch.normal_error_rad:
        return patch
    (nn, ne), (_, ee) = np.cov(np.transpose(patch.touches_ned_m)[:2]).tolist()
    along_rad = 0.5 * math.atan2(2.0 * ne, nn - ee)
    normal = (-math.sin(along_rad), math.cos(along_rad), 0.0)
    if along(normal, patch.normal_ned) < 0.0:
        normal = minus(ZERO, normal)
    return patch.model_copy(update={"normal_ned": normal, "normal_error_deg": math.degrees(error_rad)})


def _outside_m(value: float, bounds: tuple[float, float]) -> float:
    return max(0.0, bounds[0] - value, value - bounds[1])
