"""RETURN along the mission: on to its landing, straight to where the landing begins, or back the way it came.

Source: PX4's navigator rtl_direct_mission_land.cpp, rtl_mission_fast.cpp and rtl_mission_fast_reverse.cpp for
multicopters. Every item with a place becomes a plain waypoint; holds, jumps and commands are left out.
"""

import math
from collections.abc import Iterable
from dataclasses import dataclass

from sim_vehicle.autopilot.flight_tasks.target import Acceptance, Kind, Target, Vector3, View
from sim_vehicle.autopilot.mission_protocol import mission_items as kinds
from sim_vehicle.autopilot.mission_protocol.mission_messages import MissionItem
from sim_vehicle.geography import Origin
from sim_vehicle.hil.messages import Place
from sim_vehicle.parameters.store import Parameters

_LANDINGS = (kinds.LAND, kinds.VTOL_LAND)
_TAKEOFFS = (kinds.TAKEOFF, kinds.VTOL_TAKEOFF)

Items = tuple[MissionItem, ...]


@dataclass(frozen=True, slots=True)
class Stop:
    """One place on the way."""

    target: Target
    acceptance: Acceptance
    item: int | None = None
    """The mission item that is the current one meanwhile."""


@dataclass(frozen=True, slots=True)
class Landing:
    """Numbers of a mission's items: DO_LAND_START, or the landing itself without one; and the landing."""

    start: int
    land: int


def landing_of(items: Items) -> Landing | None:
    """The mission's landing, if it has one."""
    land = next((number for number, item in enumerate(items) if item.command in _LANDINGS), None)
    if land is None:
        return None
    starts = (number for number, item in enumerate(items[:land]) if item.command == kinds.DO_LAND_START)
    return Landing(next(starts, land), land)


def place_of(item: MissionItem, origin: Origin, home_ned_m: Vector3) -> Vector3:
    """Where an item with a place lies."""
    north, east, down = origin.position_of(Place(item.latitude_deg, item.longitude_deg, item.altitude_m))
    return north, east, home_ned_m[2] - item.altitude_m if item.is_relative else down


class PathPlanner:
    """A mission, as seen from where the vehicle is when it begins to return."""

    def __init__(self, items: Items, origin: Origin, parameters: Parameters, view: View) -> None:
        self._items = items
        self._parameters = parameters
        self._view = view
        self._places = {
            number: place_of(item, origin, view.home_ned_m)
            for number, item in enumerate(items)
            if item.command in kinds.WITH_POSITION
        }

    def to_landing(self, landing: Landing, return_down_m: float) -> list[Stop]:
        """Up to the return's height, then from where the landing begins to its end."""
        stops = []
        north, east, down = self._view.position_ned_m
        if down > return_down_m:
            # No heading is asked for in the climb
            stops.append(Stop(Target(Kind.HOLD, (north, east, return_down_m)), self._acceptance(None)))
        numbers = [number for number in self._places if landing.start <= number <= landing.land]
        return stops + self._stops(numbers, stops[-1].target.position_ned_m[2] if stops else down)

    def onwards(self, landing: Landing, current: int | None) -> list[Stop]:
        """On from the current item, or from the nearest where no mission was flown, to the landing."""
        first = self._nearest() if current is None else current
        numbers = [number for number in self._places if first <= number <= landing.land] or [landing.land]
        return self._stops(numbers, self._view.position_ned_m[2])

    def backwards(self, current: int | None) -> list[Stop]:
        """Back from the item before the current one, or from the nearest, to the takeoff; then down at home."""
        first = self._nearest() if current is None else current - 1
        numbers = [number for number in reversed(self._places) if number <= first]
        if not numbers:
            numbers = [number for number in self._places if current is not None and number > current][:1]
        takeoff = next((at for at, number in enumerate(numbers) if self._items[number].command in _TAKEOFFS), None)
        numbers = numbers if takeoff is None else numbers[: takeoff + 1]
        stops = self._stops(numbers, self._view.position_ned_m[2])
        return stops + self._down_at_home(stops[-1].target.position_ned_m[2] if stops else None)

    def _nearest(self) -> int:
        position = self._view.position_ned_m
        return min(self._places, key=lambda number: math.dist(self._places[number], position), default=0)

    def _stops(self, numbers: Iterable[int], down_m: float) -> list[Stop]:
        """``down_m``: the height before the first, at which a landing is flown to."""
        stops = []
        for number in numbers:
            item, place = self._items[number], self._places[number]
            if item.command in _LANDINGS:
                above = Target(Kind.POSITION, (place[0], place[1], down_m))
                stops.append(Stop(above, self._acceptance(None), number))
                stops.append(Stop(Target(Kind.LAND, place), self._acceptance(None), number))
            else:
                kind = Kind.HOLD if item.command == kinds.LOITER_TO_ALTITUDE else Kind.POSITION
                stops.append(Stop(Target(kind, place, item.yaw_rad), self._acceptance(item), number))
            down_m = place[2]
        return stops

    def _down_at_home(self, down_m: float | None) -> list[Stop]:
        north, east, home_down = self._view.home_ned_m
        above = Target(Kind.POSITION, (north, east, self._view.position_ned_m[2] if down_m is None else down_m))
        end = Target(Kind.LAND, self._view.home_ned_m)
        if self._parameters["RTL_LAND_DELAY"] < 0.0:
            end = Target(Kind.HOLD, (north, east, home_down - self._parameters["RTL_DESCEND_ALT"]))
        return [Stop(above, self._acceptance(None)), Stop(end, self._acceptance(None))]

    def _acceptance(self, item: MissionItem | None) -> Acceptance:
        horizontal_m, vertical_m = self._parameters["NAV_ACC_RAD"], self._parameters["NAV_MC_ALT_RAD"]
        if item is None:
            return Acceptance(horizontal_m, vertical_m)
        if item.command == kinds.WAYPOINT and math.isfinite(item.params[1]) and item.params[1] > 0.0:
            horizontal_m = item.params[1]
        return Acceptance(horizontal_m, vertical_m, yaw_rad=item.yaw_rad)
