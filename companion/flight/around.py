"""From an item to a way round what is known. Mission coordinates, metres."""

import math
from collections.abc import Sequence
from dataclasses import dataclass
from itertools import pairwise

from companion.flight.course import Limits, Pace, way_home, way_of
from companion.flight.curve import CurveProfile
from companion.flight.trajectory import Chain, LineProfile, Trajectory
from companion.memory.route import route
from companion.memory.surroundings import Surroundings
from companion.messages import Vector3
from companion.mission.items import GoToItem, Motion, OrbitItem, PathItem, ReturnItem, VelocityItem

# A curve is looked at in steps of half a guard; a longer one in so many.
LOOK_EVERY_M = 0.1
MOST_LOOKS = 2_000
# A circle that cannot be flown as one is flown by its points: 24 differ from it by less than 1 % of the radius.
ROUND_BY_DEG = 15.0
# Beside a point by less than this it has been passed: setpoints on a curve are up to 4 cm apart.
PASSED_M = 0.1


@dataclass(frozen=True, slots=True)
class Planned:
    """A way to fly an item; None where there is none that is known to be free.

    `is_detour`: another than the item's own. `left_out`: so many of the item's points, which are within what is known.
    """

    way: Trajectory | None
    is_detour: bool = False
    left_out: int = 0


def way_around(item: Motion, start_m: Vector3, pace: Pace, known: Surroundings) -> Planned:
    """The item's own way where that is free. A velocity is flown as it is: it asks for a motion, not for a place."""
    own = way_of(item, start_m, pace)
    if isinstance(item, VelocityItem) or not _is_blocked(own, known):
        return Planned(own)
    points = _points_of(item, own)
    places, left_out = [start_m], 0
    for point in points:
        is_welcome = not isinstance(item, OrbitItem) or known.is_clear(point, start_m)
        found = route(known, places[-1], point) if is_welcome else None
        left_out += found is None
        places += found or ()
    # Of a circle any part is worth flying; a line or a path has somewhere to be.
    if len(places) == 1 or (not isinstance(item, OrbitItem) and places[-1] != points[-1]):
        return Planned(None)
    limits = pace.limits(item.speed_m_s, item.acceleration_m_s2)
    if not isinstance(item, GoToItem):
        curve = CurveProfile(places, *limits)
        if not _is_blocked(curve, known) and _is_inside(curve, known):
            return Planned(curve, True, left_out)
    return Planned(lines(places, limits), True, left_out)


def home_around(start_m: Vector3, item: ReturnItem, pace: Pace, known: Surroundings) -> Planned:
    """Home as the item says; where there is something above, or in the way, round it."""
    own = way_home(start_m, item, pace, known.fence)
    if not _is_blocked(own, known):
        return Planned(own)
    up, across = own.parts
    places = [start_m] if _is_blocked(up, known) else [start_m, up.target_m]
    found = route(known, places[-1], across.target_m)
    if found is None:
        return Planned(None)
    return Planned(lines([*places, *found], pace.limits(item.speed_m_s, None)), True)


def lines(places_m: Sequence[Vector3], limits: Limits) -> Chain:
    """Straight from each to the next, at rest in each."""
    return Chain([LineProfile(a, b, *limits) for a, b in pairwise(places_m)])


def passed(item: PathItem, way: Trajectory, elapsed_s: float) -> int:
    """How many of a path's points lie behind the vehicle: all up to the last one that its way has led through."""
    flown = looks(way, min(elapsed_s, way.duration_s))
    numbers = [
        number
        for number, point in enumerate(item.points_ned_m, start=1)
        if any(math.dist(point, place) < PASSED_M for place in flown)
    ]
    return max(numbers, default=0)


def looks(way: Trajectory, until_s: float) -> list[Vector3]:
    """Places along a way, near to one another, from its start until a time."""
    count = max(1, min(MOST_LOOKS, math.ceil(way.distance_m / LOOK_EVERY_M)))
    return [way.at(until_s * number / count)[0] for number in range(count + 1)]


def _is_blocked(way: Trajectory, known: Surroundings) -> bool:
    if not known.patches:
        return False
    if isinstance(way, Chain):
        return any(_is_blocked(part, known) for part in way.parts)
    if isinstance(way, LineProfile):
        return known.block((way.start_m, way.target_m))
    return known.block(looks(way, way.duration_s))


def _is_inside(way: Trajectory, known: Surroundings) -> bool:
    places = looks(way, way.duration_s)
    fence = known.fence
    return all(fence.contains(n, e) and fence.min_height_m <= -d <= fence.max_height_m for n, e, d in places)


def _points_of(item: GoToItem | PathItem | OrbitItem, own: Trajectory) -> Sequence[Vector3]:
    match item:
        case GoToItem():
            return (item.position_ned_m,)
        case PathItem():
            return item.points_ned_m
        case OrbitItem():
            assert isinstance(own, Chain), "to the circle and round it"
            circle = own.parts[1]
            count = math.ceil(360.0 * item.turns / ROUND_BY_DEG)
            # Evenly in time is nearly evenly round, as a circle's ramps are short.
            return [circle.at(circle.duration_s * number / count)[0] for number in range(count + 1)]
