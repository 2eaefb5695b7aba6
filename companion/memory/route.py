"""Ways round what is known: a visibility graph (Lozano-Perez and Wesley, 1979) in plan, and levels above and below.

The vehicle's centre keeps `clearance_m` off every assumed area. Shapes and their distances are shapely's; of the graph
only the edges that the search comes to are looked at. Mission coordinates, metres.
"""

import heapq
import math
from collections.abc import Sequence
from itertools import accumulate, pairwise

import shapely
from shapely import Point, Polygon
from shapely.geometry.base import BaseGeometry

from companion.fence import Fence
from companion.memory.surroundings import ROUNDING_M, ObstacleMap, Place
from companion.messages import Vector3

# For ways along an edge of a polygon; less than what the safety envelope takes for rounding.
FENCE_SLACK_M = 5e-6
START, GOAL = 0, 1


def route(known: ObstacleMap, start_ned_m: Vector3, goal_ned_m: Vector3) -> tuple[Vector3, ...] | None:
    """The places to fly to, one after the other, the goal last; None when there is no way that is known to be free.

    Round about first, the height changing evenly; then at the nearest level at which there is a way.
    """
    start, goal = start_ned_m[:2], goal_ned_m[:2]
    from_m, to_m = -start_ned_m[2], -goal_ned_m[2]
    found = _search(known.between(from_m, to_m, start_ned_m), start, goal)
    if found is not None:
        return _sloped(start_ned_m, goal_ned_m, found)
    for level_m in sorted(known.levels_m(), key=lambda level_m: abs(level_m - from_m) + abs(level_m - to_m)):
        if known.between(to_m, level_m, start_ned_m).holds(goal) or known.is_capped(start, from_m, level_m):
            continue
        found = _search(known.between(level_m, level_m, start_ned_m), start, goal)
        if found is not None:
            return (*[(n, e, -level_m) for n, e in (start, *found)], goal_ned_m)
    return None


def _search(known: ObstacleMap, start: Place, goal: Place) -> list[Place] | None:
    """The shortest way over the corners of what is known (A*): the places after the start."""
    if known.holds(goal):
        return None
    graph = _Graph(known, start, goal)
    # Of each entry: how long a way over its last place is at least, that place, its way's length so far, and the way.
    queue: list[tuple[float, int, float, list[Place]]] = [(math.dist(start, goal), START, 0.0, [])]
    done = set[int]()
    while queue:
        _, here, length_m, way = heapq.heappop(queue)
        if here == GOAL:
            return way
        if here in done:
            continue
        done.add(here)
        for there in graph.seen_from(here, done):
            place = graph.places[there]
            longer_m = length_m + math.dist(graph.places[here], place)
            heapq.heappush(queue, (longer_m + math.dist(place, goal), there, longer_m, [*way, place]))
    return None


class _Graph:
    """The start, the goal, and the corners of what is known and of the fence."""

    def __init__(self, known: ObstacleMap, start: Place, goal: Place) -> None:
        self._known, fence = known, known.fence
        self._fence = _fence_shape(fence)
        self._inner = known.grown(known.clearance_m - ROUNDING_M)
        shapely.prepare(self._fence)
        shapely.prepare(self._inner)
        around = shapely.get_coordinates(known.grown(known.clearance_m))
        corners = [corner for corner in ((float(n), float(e)) for n, e in around) if fence.contains(*corner)]
        corners += fence.polygon_ne_m or ()
        free = [corner for corner in dict.fromkeys(corners) if not self._inner.intersects(Point(corner))]
        self.places: list[Place] = [start, goal, *free]

    def seen_from(self, here: int, done: set[int]) -> list[int]:
        """The places, of those not yet done with, to which a straight way is free."""
        others = [there for there in range(GOAL, len(self.places)) if there not in done]
        lines = shapely.linestrings([[self.places[here], self.places[there]] for there in others])
        inside = shapely.covers(self._fence, lines)
        return [
            there
            for there, line, is_inside in zip(others, lines, inside, strict=True)
            if is_inside and self._is_free(here, there, line)
        ]

    def _is_free(self, here: int, there: int, line: BaseGeometry) -> bool:
        # From the start and to the goal as near as those themselves are.
        ends = [self.places[end] for end in (here, there) if end in (START, GOAL)]
        return self._known.keeps_off(line, ends) if ends else not self._inner.intersects(line)


def _fence_shape(fence: Fence) -> BaseGeometry:
    shapes = []
    if fence.radius_m is not None:
        # Between two places in a circle the way is inside too: its shape here, of straight edges, may be larger.
        shapes.append(Point(0.0, 0.0).buffer(1.01 * fence.radius_m, quad_segs=32))
    if fence.polygon_ne_m is not None:
        shapes.append(Polygon(fence.polygon_ne_m).buffer(FENCE_SLACK_M, join_style="mitre"))
    return shapely.intersection_all(shapes)


def _sloped(start: Vector3, goal: Vector3, places: Sequence[Place]) -> tuple[Vector3, ...]:
    """The places with heights that change evenly along the way."""
    lengths = list(accumulate(math.dist(*leg) for leg in pairwise((start[:2], *places))))
    total = lengths[-1] or 1.0
    downs = [start[2] + (goal[2] - start[2]) * length / total for length in lengths]
    sloped = [(n, e, down) for (n, e), down in zip(places, downs, strict=True)]
    return (*sloped[:-1], goal)
