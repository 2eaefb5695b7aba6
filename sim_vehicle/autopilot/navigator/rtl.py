"""RETURN: climb, fly to where it is best to land, and land; or along the mission, as RTL_TYPE has it.

Sources: PX4's navigator rtl.cpp, rtl_direct.cpp, rtl_direct_mission_land.cpp, rtl_mission_fast.cpp and
rtl_mission_fast_reverse.cpp for multicopters. On a way along the mission every item with a place becomes a plain
waypoint; holds, jumps and commands are left out.
"""

import math
from collections.abc import Iterable
from dataclasses import dataclass
from enum import Enum, IntEnum, auto

from sim_vehicle.autopilot.flight_tasks.target import Acceptance, Arrival, Kind, NavigatorTarget, Vector3, View
from sim_vehicle.autopilot.messages import Severity, StatusText
from sim_vehicle.autopilot.mission_protocol import mission_items as kinds
from sim_vehicle.autopilot.mission_protocol.mission_items import place_of
from sim_vehicle.autopilot.mission_protocol.mission_messages import StoredItem
from sim_vehicle.autopilot.mission_protocol.mission_store import MissionStore
from sim_vehicle.geography import Origin
from sim_vehicle.parameters.store import Parameters

_LANDINGS = (kinds.LAND, kinds.VTOL_LAND)
_TAKEOFFS = (kinds.TAKEOFF, kinds.VTOL_TAKEOFF)

Items = tuple[StoredItem, ...]


@dataclass(frozen=True, slots=True)
class Stop:
    """One place on the way."""

    target: NavigatorTarget
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
            stops.append(Stop(NavigatorTarget(Kind.HOLD, (north, east, return_down_m)), self._acceptance(None)))
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
                above = NavigatorTarget(Kind.POSITION, (place[0], place[1], down_m))
                stops.append(Stop(above, self._acceptance(None), number))
                stops.append(Stop(NavigatorTarget(Kind.LAND, place), self._acceptance(None), number))
            else:
                kind = Kind.HOLD if item.command == kinds.LOITER_TO_ALTITUDE else Kind.POSITION
                stops.append(Stop(NavigatorTarget(kind, place, item.yaw_rad), self._acceptance(item), number))
            down_m = place[2]
        return stops

    def _down_at_home(self, down_m: float | None) -> list[Stop]:
        north, east, home_down = self._view.home_ned_m
        above = NavigatorTarget(
            Kind.POSITION, (north, east, self._view.position_ned_m[2] if down_m is None else down_m)
        )
        end = NavigatorTarget(Kind.LAND, self._view.home_ned_m)
        if self._parameters["RTL_LAND_DELAY"] < 0.0:
            end = NavigatorTarget(Kind.HOLD, (north, east, home_down - self._parameters["RTL_DESCEND_ALT"]))
        return [Stop(above, self._acceptance(None)), Stop(end, self._acceptance(None))]

    def _acceptance(self, item: StoredItem | None) -> Acceptance:
        horizontal_m, vertical_m = self._parameters["NAV_ACC_RAD"], self._parameters["NAV_MC_ALT_RAD"]
        if item is None:
            return Acceptance(horizontal_m, vertical_m)
        if item.command == kinds.WAYPOINT and math.isfinite(item.params[1]) and item.params[1] > 0.0:
            horizontal_m = item.params[1]
        return Acceptance(horizontal_m, vertical_m, yaw_rad=item.yaw_rad)


# RTL::findClosestSafePoint: rally points this near to home are home, and one must be nearer by this much.
_SAME_AS_HOME_M = 10.0
_NEARER_BY_M = 2.0


class Type(IntEnum):
    """RTL_TYPE; a number that has no name here chooses as NEAREST does."""

    NEAREST = 0
    """Home or a rally point."""
    NOT_HOME = 1
    """The mission's landing or a rally point; home where there is neither."""
    MISSION = 2
    """On along the mission to its landing, or back along it."""
    NEAREST_OR_LANDING = 3
    """Home, a rally point or the mission's landing."""
    SHORTER_MISSION = 4
    """As MISSION, whichever way has fewer items."""
    RALLY_POINT = 5
    """A rally point, or here."""


_ALONG_THE_MISSION = (Type.MISSION, Type.SHORTER_MISSION)


class ReturnLeg(Enum):
    """RtlDirect's states."""

    CLIMB = auto()
    GO = auto()
    SINK = auto()
    WAIT = auto()
    GO_OVER = auto()
    LAND = auto()
    DONE = auto()


class Return:
    """The stages of one return."""

    def __init__(self, parameters: Parameters, origin: Origin) -> None:
        self._parameters = parameters
        self._origin = origin
        self._arrival = Arrival()
        self._leg = ReturnLeg.DONE
        self._place_ned_m: Vector3 = (0.0, 0.0, 0.0)
        self._place_yaw_rad: float | None = None
        self._down_m = 0.0
        self._missions = MissionStore()
        self._stop: Stop | None = None
        self._stops: list[Stop] = []
        """What is left of a way along the mission."""
        self.target = NavigatorTarget(Kind.IDLE, self._place_ned_m)
        self.texts: list[StatusText] = []

    def begin(self, view: View, missions: MissionStore, from_mission: bool) -> None:
        """Choose where to and how high, and start; ``from_mission``: a mission was flown until now."""
        self._missions = missions
        items = missions.mission.items if missions.progress.valid else ()
        landing, planner = landing_of(items), PathPlanner(items, self._origin, self._parameters, view)
        self._stops = []
        current = missions.current if from_mission else None
        if self._parameters["RTL_TYPE"] in _ALONG_THE_MISSION:
            self._place_ned_m, self._place_yaw_rad = view.home_ned_m, view.home_yaw_rad
            if landing is not None and self._leads_onwards(landing):
                self._stops = planner.onwards(landing, current)
            elif items:
                self._stops = planner.backwards(current)
        elif self._chooses_landing(view, landing, items):
            assert landing is not None, "chosen"
            self._stops = planner.to_landing(landing, self._return_down_m(view))
            if self._stops[0].item is None:
                altitude_m = self._origin.place.altitude_m - self._stops[0].target.position_ned_m[2]
                self._say(f"RTL Mission land: climb to {_metres(altitude_m)} m")
        if self._stops and not view.landed:
            self._enter_stop(self._stops.pop(0))
        else:
            self._begin_direct(view)

    def _begin_direct(self, view: View) -> None:
        self._stop = None
        self._stops = []
        place_down_m = self._place_ned_m[2]
        self._down_m = self._return_down_m(view)
        return_height_m = place_down_m - self._down_m
        if view.landed:
            self._leg = ReturnLeg.DONE
        else:
            self._leg = ReturnLeg.CLIMB if place_down_m - view.position_ned_m[2] < return_height_m else ReturnLeg.GO
        altitude_m = self._origin.place.altitude_m - self._down_m
        self._say(f"RTL: start return at {_metres(altitude_m)} m ({_metres(return_height_m)} m above destination)")
        self._enter(view)

    def _return_down_m(self, view: View) -> float:
        down_m = self._place_ned_m[2]
        distance_m = view.distance_m(self._place_ned_m)
        return down_m - return_height_over(down_m - view.position_ned_m[2], distance_m, self._parameters)

    def update(self, view: View) -> None:
        """Go on to the next leg where this one is over."""
        if self._stop is not None:
            if self._stops and self._arrival.is_reached(self.target, self._stop.acceptance, view, self._parameters):
                self._enter_stop(self._stops.pop(0))
            return
        if self._leg in (ReturnLeg.DONE, ReturnLeg.LAND):
            return
        if self._arrival.is_reached(self.target, self._acceptance(), view, self._parameters):
            self._leg = self._next()
            self._enter(view)

    def _enter_stop(self, stop: Stop) -> None:
        if self._stop is not None and self._stop.item is not None:
            self._missions.progress.reached = self._stop.item
        self._arrival.begin()
        self._stop, self.target = stop, stop.target
        if stop.item is not None:
            self._missions.current = stop.item

    def _leads_onwards(self, landing: Landing) -> bool:
        """RTL::reverseIsFurther, where that counts."""
        current = self._missions.current
        return self._parameters["RTL_TYPE"] == Type.MISSION or landing.start - current < current

    def _next(self) -> ReturnLeg:
        if self._leg is ReturnLeg.CLIMB:
            return ReturnLeg.GO
        if self._leg is ReturnLeg.GO:
            return ReturnLeg.LAND if self._parameters["RTL_LAND_DELAY"] == 0.0 else ReturnLeg.SINK
        return {ReturnLeg.SINK: ReturnLeg.WAIT, ReturnLeg.WAIT: ReturnLeg.GO_OVER}.get(self._leg, ReturnLeg.LAND)

    def _enter(self, view: View) -> None:
        self._arrival.begin()
        north, east, down = self._place_ned_m
        over = (north, east, max(down - self._parameters["RTL_DESCEND_ALT"], self._down_m))
        if self._leg is ReturnLeg.CLIMB:
            here = (view.position_ned_m[0], view.position_ned_m[1], self._down_m)
            self.target = NavigatorTarget(Kind.HOLD, here, view.yaw_rad)
        elif self._leg is ReturnLeg.GO:
            is_near = view.distance_m(self._place_ned_m) < self._parameters["RTL_MIN_DIST"]
            yaw_rad = self._place_yaw_rad if is_near else None
            self.target = NavigatorTarget(Kind.POSITION, (north, east, self._down_m), yaw_rad)
        elif self._leg in (ReturnLeg.SINK, ReturnLeg.WAIT):
            self.target = NavigatorTarget(Kind.HOLD, over, self._place_yaw_rad)
            if self._leg is ReturnLeg.WAIT and self._parameters["RTL_LAND_DELAY"] < 0.0:
                self._say("RTL: completed, loitering")
        elif self._leg is ReturnLeg.GO_OVER:
            self.target = NavigatorTarget(Kind.POSITION, over, self._place_yaw_rad)
        elif self._leg is ReturnLeg.LAND:
            self.target = NavigatorTarget(Kind.LAND, self._place_ned_m, self._place_yaw_rad)
            self._say("RTL: land at destination")
        else:
            self.target = NavigatorTarget(Kind.IDLE, view.position_ned_m)

    def _acceptance(self) -> Acceptance:
        parameters = self._parameters
        horizontal_m, vertical_m = parameters["NAV_ACC_RAD"], parameters["NAV_MC_ALT_RAD"]
        if self._leg is ReturnLeg.WAIT:
            wait_s = parameters["RTL_LAND_DELAY"]
            return Acceptance(math.inf, math.inf, inside_s=wait_s if wait_s >= 0.0 else math.inf)
        vertical_m = math.inf if self._leg is ReturnLeg.GO_OVER else vertical_m
        yaw_rad = None if self._leg is ReturnLeg.CLIMB else self.target.yaw_rad
        return Acceptance(horizontal_m, vertical_m, yaw_rad=yaw_rad)

    def _chooses_landing(self, view: View, landing: Landing | None, items: Items) -> bool:
        """Choose the place (RTL::findRtlDestination); whether it is the mission's landing."""
        kind = self._parameters["RTL_TYPE"]
        only_rally, home = kind == Type.RALLY_POINT, view.home_ned_m
        self._place_ned_m, self._place_yaw_rad = home, view.home_yaw_rad
        nearest_m = math.inf if kind in (Type.NOT_HOME, Type.RALLY_POINT) else view.distance_m(home)
        if only_rally:
            self._place_ned_m, self._place_yaw_rad = view.position_ned_m, None
        is_landing = False
        if landing is not None and kind in (Type.NOT_HOME, Type.NEAREST_OR_LANDING):
            place = place_of(items[landing.land], self._origin, home)
            if view.distance_m(place) + _NEARER_BY_M < nearest_m:
                is_landing, nearest_m = True, view.distance_m(place)
                self._place_ned_m, self._place_yaw_rad = place, None
        for item in self._missions.rally.items:
            if item.command != kinds.RALLY_POINT:
                continue
            place = place_of(item, self._origin, home)
            is_another = only_rally or math.hypot(place[0] - home[0], place[1] - home[1]) > _SAME_AS_HOME_M
            if is_another and view.distance_m(place) + _NEARER_BY_M < nearest_m:
                is_landing, nearest_m = False, view.distance_m(place)
                self._place_ned_m, self._place_yaw_rad = place, None
        return is_landing

    def _say(self, text: str) -> None:
        self.texts.append(StatusText(Severity.INFO, text))


def _metres(length_m: float) -> int:
    """As it is told: whole and rounded up; 0 for a height that is none, which a rally point may come with."""
    return math.ceil(length_m) if math.isfinite(length_m) else 0


def return_height_over(height_m: float, distance_m: float, parameters: Parameters) -> float:
    """Height above the destination at which RETURN flies, from the present height and distance (rtl.cpp)."""
    most_m, near_m = parameters["RTL_RETURN_ALT"], parameters["NAV_ACC_RAD"]
    cone_deg = parameters["RTL_CONE_ANG"]
    if cone_deg <= 0.0:
        return max(height_m, most_m)
    if distance_m <= near_m:
        wanted = 2.0 * distance_m
    else:
        wanted = most_m
        if distance_m <= parameters["RTL_MIN_DIST"]:
            wanted = min(wanted, distance_m / math.tan(math.radians(min(max(cone_deg, 1.0), 89.0))))
        wanted = max(wanted, 2.0 * near_m)
    return max(height_m, min(wanted, most_m))
