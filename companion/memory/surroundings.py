"""The obstacle map for one vehicle: shapes in plan, obstacles at a height, how near the vehicle may come, ways round.

Ways are those of a visibility graph (Lozano-Perez and Wesley, 1979) in plan, the height changing evenly. Shapes and
their distances are shapely's. Mission coordinates, metres.
"""

import heapq
import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property, lru_cache
from itertools import accumulate

import numpy as np
import shapely
from shapely import LineString, MultiPoint, Point, Polygon
from shapely.geometry.base import BaseGeometry

from companion.fence import Fence
from companion.memory.patch import Patch, is_same, joined
from companion.messages import Vector3

Place = tuple[float, float]

# A trajectory along the clearance may come this much nearer before it is planned again: a position estimate drifts by
# as much between two hits, and one more touch moves a patch.
SLACK_M = 0.05
# Corners and ends, computed, and what a vehicle at rest is beside its setpoint.
ROUNDING_M = 0.02
# A goal may lie nearer to a surface than the clearance. A touch's place is good to 0.1 m (see patch); 5 cm more between
# guards and surface make it safe to fly to.
LEAST_FREE_M = 0.15
# A vehicle that keeps the clearance above or below a patch, but for so much, is beside it: recoveries end there.
HEIGHT_SLACK_M = 0.01


@dataclass(frozen=True)
class ObstacleMap:
    """All patches for one vehicle: `reach_m` from its centre to the guards' rim, `margin_m` from there to surfaces.

    `keeps_in`: a way that leaves the fence is blocked, too; a mission that is written so is refused.
    """

    patches: tuple[Patch, ...]
    fence: Fence
    reach_m: float
    margin_m: float
    keeps_in: bool = True

    @property
    def clearance_m(self) -> float:
        return self.reach_m + self.margin_m

    @property
    def least_m(self) -> float:
        """How near a vehicle's centre may come to a core."""
        return min(self.reach_m + LEAST_FREE_M, self.clearance_m - SLACK_M)

    @cached_property
    def areas(self) -> list[BaseGeometry]:
        """The assumed area of each patch, in plan."""
        return [assumed_area(patch, patch.normal_error_rad) for patch in self.patches]

    @cached_property
    def cores(self) -> list[BaseGeometry]:
        return [assumed_area(patch, 0.0) for patch in self.patches]

    def joined(self, touches: Sequence[Patch]) -> "ObstacleMap":
        """With what the touches, in their order, add to it.

        Through a gap of less than twice the clearance the vehicle cannot pass, so what lies on both sides of such a gap
        may as well be one.
        """
        patches = list(self.patches)
        for touch in touches:
            fitting = [patch for patch in patches if is_same(patch, touch, self.clearance_m)]
            patches = [patch for patch in patches if patch not in fitting]
            patches.append(joined(fitting, touch))
        return replace(self, patches=tuple(patches))

    def between(self, points_ned_m: Sequence[Vector3], start_ned_m: Vector3) -> "ObstacleMap":
        """What of it stands at the heights of these points and between them, for a vehicle that starts there."""
        heights_m = [-point[2] for point in points_ned_m]
        off_m = self.clearance_m - HEIGHT_SLACK_M
        low_m, high_m = min(heights_m) - off_m, max(heights_m) + off_m

        def stands(patch: Patch) -> bool:
            bottom_m, top_m = patch.assumed_heights_m()
            if top_m <= low_m or bottom_m >= high_m:
                return False
            # A patch in which the vehicle itself is cannot be there, or not any more.
            is_beside = not bottom_m <= -start_ned_m[2] <= top_m
            return is_beside or assumed_area(patch, 0.0).distance(Point(start_ned_m[:2])) >= 2.0 * ROUNDING_M

        return replace(self, patches=tuple(filter(stands, self.patches)))

    def holds(self, place: Place) -> bool:
        """Whether a place lies in one of the patches, for a vehicle that has a size."""
        return bool(np.any(shapely.distance(Point(place), self.cores) < self.least_m))

    def keeps_off(self, line: BaseGeometry, ends: Sequence[Place]) -> bool:
        """Whether a line keeps the clearance, or what these of its ends leave of it.

        It stays off the cores, and never leads through a shape that the ends are outside of.
        """
        for shapes, off_m in ((self.areas, self.clearance_m - SLACK_M), (self.cores, self.least_m)):
            needs_m = np.full(len(shapes), off_m)
            for end in ends:
                needs_m = np.minimum(needs_m, shapely.distance(Point(end), shapes) - ROUNDING_M)
            if np.any(shapely.distance(line, shapes) < needs_m):
                return False
        return True

    def grown(self, by_m: float) -> BaseGeometry:
        """The assumed areas as one, grown by `by_m` on every side."""
        return shapely.union_all([shape.buffer(by_m, join_style="mitre") for shape in self.areas])

    def is_clear(self, place_ned_m: Vector3, start_ned_m: Vector3) -> bool:
        """Whether a place keeps the whole clearance."""
        return self.between([place_ned_m], start_ned_m).keeps_off(Point(place_ned_m[:2]), ())

    def block(self, points_ned_m: Sequence[Vector3]) -> bool:
        """Whether a line through these points comes too near to a patch."""
        here, places = self.between(points_ned_m, points_ned_m[0]), [point[:2] for point in points_ned_m]
        return here.holds(places[-1]) or not here.keeps_off(LineString(places), (places[0], places[-1]))


# Nobody knows how thick what was hit is; thinner than an inner wall is rare.
THICKNESS_M = 0.1


@lru_cache(maxsize=512)  # a path looks at the same patches for each of its points
def assumed_area(patch: Patch, error_rad: float) -> BaseGeometry:
    """The area in plan that the surface is assumed to cover, whatever its heights.

    Of a wall: a rectangle behind its front. The error of its normal over its length widens it, so that a surface turned
    by that error still lies within it. Without an error it is the core: a vehicle beside the wall cannot be in it.
    """
    if patch.is_steep:
        touched = MultiPoint([place[:2] for place in patch.touches_ned_m]).convex_hull
        return touched.buffer(max(patch.assumed_beyond_m(), THICKNESS_M), quad_segs=2)
    low_m, high_m = patch.assumed_along_m()
    drift_m = (patch.touched_along_m()[0] - low_m) * math.sin(error_rad)
    offs_m = [patch.off_m(place) for place in patch.touches_ned_m]
    back_m, front_m = min(offs_m) - max(THICKNESS_M, drift_m), max(offs_m) + drift_m
    # A touch without an assumed extent is as wide as it is thick.
    low_m, high_m = min(low_m, high_m - THICKNESS_M), max(high_m, low_m + THICKNESS_M)
    corners = ((low_m, back_m), (low_m, front_m), (high_m, front_m), (high_m, back_m))
    return Polygon([patch.place_ne_m(along_m, off_m) for along_m, off_m in corners])


# For ways along an edge of a polygon; less than what the safety envelope takes for rounding.
FENCE_SLACK_M = 5e-6
START, GOAL = 0, 1


def route(known: ObstacleMap, start_ned_m: Vector3, goal_ned_m: Vector3) -> tuple[Vector3, ...] | None:
    """The places to fly to, one after the other, the goal last; None when there is no way that is known to be free."""
    way = _search(known.between((start_ned_m, goal_ned_m), start_ned_m), start_ned_m[:2], goal_ned_m[:2])
    if way is None:
        return None
    lengths = list(accumulate(map(math.dist, way, way[1:]), initial=0.0))
    down_m, falls_m, total = start_ned_m[2], goal_ned_m[2] - start_ned_m[2], lengths[-1] or 1.0
    sloped = [(n, e, down_m + falls_m * length / total) for (n, e), length in zip(way, lengths, strict=True)]
    return (*sloped[1:-1], goal_ned_m)


def _search(known: ObstacleMap, start: Place, goal: Place) -> list[Place] | None:
    """The shortest way over the corners of what is known and of the fence (A*), from the start to the goal."""
    fence = known.fence
    if known.holds(goal) or fence.outside_by_m((*goal, 0.0)) > ROUNDING_M:
        return None
    # Between two places in a circle the way is inside too.
    corners_ne_m = fence.polygon_ne_m
    polygon = None if corners_ne_m is None else Polygon(corners_ne_m).buffer(FENCE_SLACK_M, join_style="mitre")
    straight = LineString((start, goal))
    if (polygon is None or polygon.covers(straight)) and known.keeps_off(straight, (start, goal)):
        return [start, goal]
    inner = known.grown(known.clearance_m - ROUNDING_M)
    shapely.prepare([polygon, inner])
    around = map(tuple, shapely.get_coordinates(known.grown(known.clearance_m)).tolist())
    corners = filter(lambda corner: fence.contains(*corner), dict.fromkeys([*around, *(corners_ne_m or ())]))
    places: list[Place] = [start, goal, *(corner for corner in corners if not inner.intersects(Point(corner)))]

    done = set[int]()

    def free_from(here: int) -> list[int]:
        """The places, of those not yet done with, to which a straight way is free."""
        others = [there for there in range(GOAL, len(places)) if there not in done]
        lines = shapely.linestrings([[places[here], places[there]] for there in others])
        is_inside = np.full(len(others), True) if polygon is None else shapely.covers(polygon, lines)
        is_free = is_inside & ~shapely.intersects(inner, lines)
        # From the start and to the goal as near as those themselves are.
        for number in np.flatnonzero(is_inside) if here == START else (0,):
            ends = [places[end] for end in (here, others[number]) if end in (START, GOAL)]
            is_free[number] = is_inside[number] and known.keeps_off(lines[number], ends)
        return [others[number] for number in np.flatnonzero(is_free)]

    # Of each way that is looked at: how long it is to the goal at least, its length so far, and its places.
    queue = [(math.dist(start, goal), 0.0, [START])]
    while queue:
        _, length_m, way = heapq.heappop(queue)
        here = way[-1]
        if here == GOAL:
            return [places[number] for number in way]
        if here in done:
            continue
        done.add(here)
        for there in free_from(here):
            longer_m = length_m + math.dist(places[here], places[there])
            heapq.heappush(queue, (longer_m + math.dist(places[there], goal), longer_m, [*way, there]))
    return None
