"""RETURN: climb, fly to where it is best to land, and land. Source: PX4's navigator rtl.cpp and rtl_direct.cpp.

RTL_TYPE 0 and 5 choose among home and the rally points as PX4 does. Its other types fly back along a mission; here
they choose like 0.
"""

import math
from enum import Enum, auto

from sim_vehicle.autopilot import mission_items
from sim_vehicle.autopilot.messages import Severity, StatusText
from sim_vehicle.autopilot.mission_messages import MissionItem
from sim_vehicle.autopilot.target import Acceptance, Arrival, Kind, Target, Vector3, View
from sim_vehicle.geography import Origin
from sim_vehicle.hil.messages import Place
from sim_vehicle.parameters.store import Parameters

# RTL::findClosestSafePoint: rally points this near to home are home, and one must be nearer by this much.
_SAME_AS_HOME_M = 10.0
_NEARER_BY_M = 2.0
_ONLY_RALLY_POINTS = 5


class Leg(Enum):
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
        self._leg = Leg.DONE
        self._place_ned_m: Vector3 = (0.0, 0.0, 0.0)
        self._place_yaw_rad: float | None = None
        self._down_m = 0.0
        self.target = Target(Kind.IDLE, self._place_ned_m)
        self.texts: list[StatusText] = []

    def begin(self, view: View, rally: tuple[MissionItem, ...]) -> None:
        """Choose where to and how high, and start."""
        self._choose_place(view, rally)
        place_down_m = self._place_ned_m[2]
        height_m = place_down_m - view.position_ned_m[2]
        return_height_m = return_height_over(height_m, view.distance_m(self._place_ned_m), self._parameters)
        self._down_m = place_down_m - return_height_m
        if view.landed:
            self._leg = Leg.DONE
        else:
            self._leg = Leg.CLIMB if height_m < return_height_m else Leg.GO
        altitude_m = self._origin.place.altitude_m - self._down_m
        self._say(f"RTL: start return at {math.ceil(altitude_m)} m ({math.ceil(return_height_m)} m above destination)")
        self._enter(view)

    def update(self, view: View) -> None:
        """Go on to the next leg where this one is over."""
        if self._leg in (Leg.DONE, Leg.LAND):
            return
        if self._arrival.is_reached(self.target, self._acceptance(), view, self._parameters):
            self._leg = self._next()
            self._enter(view)

    def _next(self) -> Leg:
        if self._leg is Leg.CLIMB:
            return Leg.GO
        if self._leg is Leg.GO:
            return Leg.LAND if self._parameters["RTL_LAND_DELAY"] == 0.0 else Leg.SINK
        return {Leg.SINK: Leg.WAIT, Leg.WAIT: Leg.GO_OVER}.get(self._leg, Leg.LAND)

    def _enter(self, view: View) -> None:
        self._arrival.begin()
        north, east, down = self._place_ned_m
        over = (north, east, max(down - self._parameters["RTL_DESCEND_ALT"], self._down_m))
        if self._leg is Leg.CLIMB:
            here = (view.position_ned_m[0], view.position_ned_m[1], self._down_m)
            self.target = Target(Kind.HOLD, here, view.yaw_rad)
        elif self._leg is Leg.GO:
            is_near = view.distance_m(self._place_ned_m) < self._parameters["RTL_MIN_DIST"]
            yaw_rad = self._place_yaw_rad if is_near else None
            self.target = Target(Kind.POSITION, (north, east, self._down_m), yaw_rad)
        elif self._leg in (Leg.SINK, Leg.WAIT):
            self.target = Target(Kind.HOLD, over, self._place_yaw_rad)
            if self._leg is Leg.WAIT and self._parameters["RTL_LAND_DELAY"] < 0.0:
                self._say("RTL: completed, loitering")
        elif self._leg is Leg.GO_OVER:
            self.target = Target(Kind.POSITION, over, self._place_yaw_rad)
        elif self._leg is Leg.LAND:
            self.target = Target(Kind.LAND, self._place_ned_m, self._place_yaw_rad)
            self._say("RTL: land at destination")
        else:
            self.target = Target(Kind.IDLE, view.position_ned_m)

    def _acceptance(self) -> Acceptance:
        parameters = self._parameters
        horizontal_m, vertical_m = parameters["NAV_ACC_RAD"], parameters["NAV_MC_ALT_RAD"]
        if self._leg is Leg.WAIT:
            wait_s = parameters["RTL_LAND_DELAY"]
            return Acceptance(math.inf, math.inf, inside_s=wait_s if wait_s >= 0.0 else math.inf)
        vertical_m = math.inf if self._leg is Leg.GO_OVER else vertical_m
        yaw_rad = None if self._leg is Leg.CLIMB else self.target.yaw_rad
        return Acceptance(horizontal_m, vertical_m, yaw_rad=yaw_rad)

    def _choose_place(self, view: View, rally: tuple[MissionItem, ...]) -> None:
        """Home, or the rally point that is nearer."""
        only_rally = self._parameters["RTL_TYPE"] == _ONLY_RALLY_POINTS
        self._place_ned_m, self._place_yaw_rad = view.home_ned_m, view.home_yaw_rad
        nearest_m = math.inf if only_rally else view.distance_m(view.home_ned_m)
        if only_rally:
            self._place_ned_m, self._place_yaw_rad = view.position_ned_m, None
        for item in rally:
            if item.command != mission_items.RALLY_POINT:
                continue
            place = place_of(item, self._origin, view.home_ned_m)
            from_home_m = math.hypot(place[0] - view.home_ned_m[0], place[1] - view.home_ned_m[1])
            distance_m = view.distance_m(place)
            is_another = only_rally or from_home_m > _SAME_AS_HOME_M
            if is_another and distance_m + _NEARER_BY_M < nearest_m:
                nearest_m = distance_m
                self._place_ned_m, self._place_yaw_rad = place, None

    def _say(self, text: str) -> None:
        self.texts.append(StatusText(Severity.INFO, text))


def place_of(item: MissionItem, origin: Origin, home_ned_m: Vector3) -> Vector3:
    """Where an item with a place lies."""
    north, east, down = origin.position_of(Place(item.latitude_deg, item.longitude_deg, item.altitude_m))
    return north, east, home_ned_m[2] - item.altitude_m if item.is_relative else down


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
