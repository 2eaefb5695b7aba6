"""The geofence: uploaded polygons and circles.

Source: PX4's navigator/geofence.cpp and Navigator::geofence_breach_check. Heights of the uploaded shapes do not count.
"""

import math
from collections.abc import Sequence
from dataclasses import dataclass

from sim_vehicle.autopilot.flight_tasks.target import View
from sim_vehicle.autopilot.messages import Severity, Texts
from sim_vehicle.autopilot.mission_protocol import mission_items
from sim_vehicle.autopilot.mission_protocol.mission_items import StoredItem
from sim_vehicle.geography import Origin
from sim_vehicle.parameters.store import Parameters
from sim_vehicle.quantities import Vector3

# GEOFENCE_CHECK_INTERVAL_US.
CHECK_PERIOD_US = 200_000


@dataclass(frozen=True, slots=True)
class Shape:
    """One polygon or circle in local north and east, metres."""

    keeps_in: bool
    corners_m: tuple[tuple[float, float], ...]
    """Of a circle: its centre alone."""
    radius_m: float | None = None

    def allows(self, north_m: float, east_m: float) -> bool:
        """Whether the shape lets a vehicle be there."""
        return self._contains(north_m, east_m) is self.keeps_in

    def _contains(self, north_m: float, east_m: float) -> bool:
        if self.radius_m is not None:
            centre_north, centre_east = self.corners_m[0]
            return math.hypot(north_m - centre_north, east_m - centre_east) < self.radius_m
        # Crossings of a ray to the south with the sides, in PX4's order of comparisons.
        inside = False
        before_north, before_east = self.corners_m[-1]
        for corner_north, corner_east in self.corners_m:
            if (corner_east >= east_m) != (before_east >= east_m):
                slope = (before_north - corner_north) / (before_east - corner_east)
                inside ^= north_m <= slope * (east_m - corner_east) + corner_north
            before_north, before_east = corner_north, corner_east
        return inside


class Geofence:
    """What is allowed where, judged five times a second."""

    def __init__(self, parameters: Parameters, origin: Origin, texts: Texts) -> None:
        self._parameters = parameters
        self._origin = origin
        self._shapes: tuple[Shape, ...] = ()
        self._checked_us: int | None = None
        self.breached = False
        self._texts = texts

    def load(self, items: Sequence[StoredItem], view: View) -> None:
        """Take an uploaded fence; shapes that exclude home, or a flying vehicle, are left out."""
        shapes = []
        for shape in shapes_of(items, self._origin):
            if not shape.allows(*view.home_ned_m[:2]):
                self._texts.say(Severity.CRITICAL, "Geofence invalid, doesn't contain Home position")
            elif self._acts and not view.landed and not shape.allows(*view.position_ned_m[:2]):
                self._texts.say(Severity.CRITICAL, "Geofence invalid, doesn't contain current vehicle position")
            else:
                shapes.append(shape)
        self._shapes = tuple(shapes)

    def update(self, view: View, holds_after_breach: bool) -> None:
        """Judge where the vehicle is. While it holds after a breach, the breach stays one."""
        if not self._acts:
            self.breached = False
            return
        if self._checked_us is not None and view.now_us - self._checked_us < CHECK_PERIOD_US:
            return
        self._checked_us = view.now_us
        self.breached = not self.allows(view.position_ned_m) or (self.breached and holds_after_breach)

    def allows(self, position_ned_m: Vector3) -> bool:
        """Whether a place is inside every shape."""
        north, east, _ = position_ned_m
        return all(shape.allows(north, east) for shape in self._shapes)

    @property
    def _acts(self) -> bool:
        return self._parameters["GF_ACTION"] != 0


def shapes_of(items: Sequence[StoredItem], origin: Origin) -> list[Shape]:
    """The polygons and circles that a list of items describes; a polygon that is cut short is left out."""
    shapes: list[Shape] = []
    number = 0
    while number < len(items):
        item = items[number]
        if item.command in mission_items.FENCE_CIRCLES:
            keeps_in = item.command == mission_items.FENCE_CIRCLE_INCLUSION
            shapes.append(Shape(keeps_in, (_place(item, origin),), item.params[0]))
        elif item.command in mission_items.FENCE_POLYGONS:
            count = int(item.params[0])
            corners = items[number : number + count]
            if len(corners) == count:
                keeps_in = item.command == mission_items.FENCE_POLYGON_INCLUSION
                shapes.append(Shape(keeps_in, tuple(_place(corner, origin) for corner in corners)))
            number += count - 1
        number += 1
    return shapes


def _place(item: StoredItem, origin: Origin) -> tuple[float, float]:
    north, east, _ = origin.position_of(item.place)
    return north, east
