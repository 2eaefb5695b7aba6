"""The geofence: where no setpoint lies and no vehicle should be. Mission coordinates, metres."""

import math
from functools import cached_property
from typing import Annotated, Self

import shapely
from pydantic import Field, model_validator
from shapely import LineString, Point, Polygon
from shapely.ops import nearest_points

from companion.strict_model import NotNegative, Number, PositionNed, Positive, StrictModel

# A fence for someone who gives none: a large room, and well inside the range of sight.
DEFAULT_RADIUS_M = 15.0
# A corner nearer to another than this is the same corner typed twice.
LEAST_EDGE_M = 0.01
# Of a quarter of a circle: straight edges within it are nowhere further inside than 0.01 % of the radius.
_ARC_SEGMENTS = 64
# GEOS finds no direction in a way that is shorter by far.
_LEAST_M = 1e-9


class Fence(StrictModel):
    """A cylinder around the arming position, a polygon of (north, east) corners, or both; with a floor and a top.

    The floor is for the flight between take-off and landing.
    """

    radius_m: Positive | None = None
    """Of a circle round the arming position; 15 where there is no polygon either."""
    polygon_ne_m: Annotated[tuple[tuple[Number, Number], ...], Field(min_length=3)] | None = None
    """Corners [north, east] round an area with the arming position in it."""
    max_height_m: Positive = 6.0
    """Above the arming position."""
    min_height_m: NotNegative = 0.2
    """Guards and landing gear reach 0.1 m below the centre of a small vehicle; as much again for a hover's drift."""

    @model_validator(mode="before")
    @classmethod
    def _some_fence(cls, data: object) -> object:
        if isinstance(data, dict) and data.get("radius_m") is None and data.get("polygon_ne_m") is None:
            return {**data, "radius_m": DEFAULT_RADIUS_M}
        return data

    @model_validator(mode="after")
    def _sound(self) -> Self:
        if self.min_height_m >= self.max_height_m:
            raise ValueError(f"min_height_m = {self.min_height_m:g} is not below max_height_m = {self.max_height_m:g}")
        corners = self.polygon_ne_m or ()
        for number, corner in enumerate(corners):
            if math.dist(corner, corners[number - 1]) < LEAST_EDGE_M:
                raise ValueError(f"polygon_ne_m: corner {number or len(corners)} is the same as the next")
        if self._polygon is not None and not self._polygon.is_valid:
            where = shapely.is_valid_reason(self._polygon).partition("[")[2].removesuffix("]").replace(" ", ", ")
            raise ValueError(f"polygon_ne_m: an edge crosses another, at [{where}]")
        if not self.contains(0.0, 0.0):
            raise ValueError("polygon_ne_m does not contain the arming position [0, 0]")
        return self

    @cached_property
    def _polygon(self) -> Polygon | None:
        """Prepared for many places to be looked for in it."""
        polygon = None if self.polygon_ne_m is None else Polygon(self.polygon_ne_m)
        shapely.prepare(polygon)
        return polygon

    def contains(self, north_m: float, east_m: float) -> bool:
        """Whether a place is inside, whatever its height."""
        if self.radius_m is not None and math.hypot(north_m, east_m) > self.radius_m:
            return False
        return self._polygon is None or bool(self._polygon.covers(Point(north_m, east_m)))

    def outside_by_m(self, position_ned_m: PositionNed) -> float:
        """How far beyond the fence a position is, upwards or sideways; 0 inside. The floor does not count."""
        north_m, east_m, down_m = position_ned_m
        above_m = -down_m - self.max_height_m
        beside_m = math.dist((north_m, east_m), self.nearest_inside(north_m, east_m))
        return max(0.0, above_m, beside_m)

    def complaint(self, position_ned_m: PositionNed) -> str | None:
        """What is wrong with a position, or None when it is inside."""
        north_m, east_m, down_m = position_ned_m
        distance_m = math.hypot(north_m, east_m)
        if self.radius_m is not None and distance_m > self.radius_m:
            return f"lies {distance_m:.2f} m out, beyond fence.radius_m = {self.radius_m:g}"
        if not self.contains(north_m, east_m):
            return f"lies at [{north_m:g}, {east_m:g}], outside fence.polygon_ne_m"
        if -down_m > self.max_height_m:
            return f"lies {-down_m:.2f} m up, above fence.max_height_m = {self.max_height_m:g}"
        if down_m >= 0.0:
            return f"has down = {down_m:g} m, which is not above the ground; up is negative"
        if -down_m < self.min_height_m:
            return f"lies {-down_m:.2f} m up, below fence.min_height_m = {self.min_height_m:g}"
        return None

    def nearest_inside(self, north_m: float, east_m: float) -> tuple[float, float]:
        """The place inside that is nearest to a place; of a polygon within a circle, nearly the nearest."""
        place = (north_m, east_m)
        if self._polygon is not None and not self._polygon.covers(Point(place)):
            edge = self._polygon.exterior
            nearest = edge.interpolate(edge.project(Point(place)))
            place = (nearest.x, nearest.y)
        distance_m = math.hypot(*place)
        if self.radius_m is not None and distance_m > self.radius_m:
            place = (place[0] * self.radius_m / distance_m, place[1] * self.radius_m / distance_m)
            if self._polygon is not None and not self._polygon.covers(Point(place)):
                both = self._polygon.intersection(Point(0.0, 0.0).buffer(self.radius_m, quad_segs=_ARC_SEGMENTS))
                nearest = nearest_points(both, Point(north_m, east_m))[0]
                place = (nearest.x, nearest.y)
        return place

    def shortened(self, start: tuple[float, float], end: tuple[float, float]) -> tuple[float, float]:
        """Where the straight way from `start`, which is inside, to `end` leaves the fence; `end` if it does not."""
        leaves_at = 1.0
        step = (end[0] - start[0], end[1] - start[1])
        if math.hypot(*step) <= _LEAST_M:
            return end
        if self.radius_m is not None and math.hypot(*end) > self.radius_m:
            # |start + s * step| = radius, for the s in [0, 1] that leaves the circle
            a = step[0] ** 2 + step[1] ** 2
            b = start[0] * step[0] + start[1] * step[1]
            c = start[0] ** 2 + start[1] ** 2 - self.radius_m**2
            leaves_at = (-b + math.sqrt(max(0.0, b * b - a * c))) / a
        if self._polygon is not None:
            line = LineString((start, end))
            for outside in shapely.get_coordinates(line.difference(self._polygon)):
                leaves_at = min(leaves_at, line.project(Point(outside), normalized=True))
        return (start[0] + leaves_at * step[0], start[1] + leaves_at * step[1])
