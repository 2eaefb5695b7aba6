"""Ways round what is known: a visibility graph (Lozano-Perez and Wesley, 1979) in plan, the height changing evenly.

The vehicle's centre keeps `clearance_m` off every assumed area. Shapes and their distances are shapely's; of the graph
only the edges that the search comes to are looked at. Mission coordinates, metres.
"""

import heapq
import math
from itertools import accumulate, pairwise

import shapely
from shapely import LineString, Point, Polygon
from shapely.geometry.base import BaseGeometry

from companion.fence import Fence
from companion.memory.surroundings import ROUNDING_M, ObstacleMap, Place
from companion.messages import Vector3

# For ways along an edge of a polygon; less than what the safety envelope takes for rounding.
FENCE_SLACK_M = 5e-6
START, GOAL = 0, 1


def route(known: ObstacleMap, start_ned_m: Vector3, goal_ned_m: Vector3) -> tuple[Vector3, ...] | None:
    """The places to fly to, one after the other, the goal last; None when there is no way that is known to be free."""
    here = known.between((start_ned_m, goal_ned_m), start_ned_m)
    places = _search(here, start_ned_m[:2], goal_ned_m[:2])
    if places is None:
        return None
    lengths = list(accumulate(math.dist(*leg) for leg in pairwise((start_ned_m[:2], *places))))
    down_m, falls_m, total = start_ned_m[2], goal_ned_m[2] - start_ned_m[2], lengths[-1] or 1.0
    corners = zip(places[:-1], lengths[:-1], strict=True)
    return (*[(n, e, down_m + falls_m * length / total) for (n, e), length in corners], goal_ned_m)


def _search(known: ObstacleMap, start: Place, goal: Place) -> list[Place] | None:
    """The shortest way over the corners of what is known and of the fence (A*): the places after the start."""
    if known.holds(goal):
        return None
    fence, inner = _fence_shape(known.fence), known.grown(known.clearance_m - ROUNDING_M)
    shapely.prepare([fence, inner])
    around = shapely.get_coordinates(known.grown(known.clearance_m)).tolist()
    corners = [*[(n, e) for n, e in around if known.fence.contains(n, e)], *(known.fence.polygon_ne_m or ())]
    free = [corner for corner in dict.fromkeys(corners) if not inner.intersects(Point(corner))]
    places: list[Place] = [start, goal, *free]

    def is_free(here: int, there: int) -> bool:
        line = LineString([places[here], places[there]])
        # From the start and to the goal as near as those themselves are.
        ends = [places[end] for end in (here, there) if end in (START, GOAL)]
        keeps_off = known.keeps_off(line, ends) if ends else not inner.intersects(line)
        return keeps_off and bool(fence.covers(line))

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
        for there in range(GOAL, len(places)):
            if there not in done and is_free(here, there):
                longer_m = length_m + math.dist(places[here], places[there])
                heapq.heappush(
                    queue, (longer_m + math.dist(places[there], goal), there, longer_m, [*way, places[there]])
                )
    return None


def _fence_shape(fence: Fence) -> BaseGeometry:
    shapes = []
    if fence.radius_m is not None:
        # Between two places in a circle the way is inside too: its shape here, of straight edges, may be larger.
        shapes.append(Point(0.0, 0.0).buffer(1.01 * fence.radius_m, quad_segs=32))
    if fence.polygon_ne_m is not None:
        shapes.append(Polygon(fence.polygon_ne_m).buffer(FENCE_SLACK_M, join_style="mitre"))
    return shapely.intersection_all(shapes)
