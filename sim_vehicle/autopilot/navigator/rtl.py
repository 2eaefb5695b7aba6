"""RETURN: climb, fly to home or to a rally point that is nearer, and land there.

Sources: PX4's navigator rtl.cpp and rtl_direct.cpp for multicopters, with RTL_TYPE 0 and no landing in the mission.
"""

import math
from enum import Enum, auto

from sim_vehicle.autopilot.flight_tasks.target import Acceptance, Arrival, Kind, NavigatorTarget, View
from sim_vehicle.autopilot.messages import Severity, StatusText
from sim_vehicle.autopilot.mission_protocol import mission_items as kinds
from sim_vehicle.autopilot.mission_protocol.mission_items import place_of
from sim_vehicle.autopilot.mission_protocol.mission_store import MissionStore
from sim_vehicle.geography import Origin
from sim_vehicle.parameters.store import Parameters
from sim_vehicle.setpoint import Vector3

# RTL::findClosestSafePoint: rally points this near to home are home, and one must be nearer by this much.
_SAME_AS_HOME_M = 10.0
_NEARER_BY_M = 2.0


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
        self.target = NavigatorTarget(Kind.IDLE, self._place_ned_m)
        self.texts: list[StatusText] = []

    def begin(self, view: View, missions: MissionStore) -> None:
        """Choose where to and how high, and start."""
        self._choose_place(view, missions)
        place_down_m = self._place_ned_m[2]
        height_m = place_down_m - view.position_ned_m[2]
        return_height_m = return_height_over(height_m, view.distance_m(self._place_ned_m), self._parameters)
        self._down_m = place_down_m - return_height_m
        if view.landed:
            self._leg = ReturnLeg.DONE
        else:
            self._leg = ReturnLeg.CLIMB if height_m < return_height_m else ReturnLeg.GO
        altitude_m = self._origin.place.altitude_m - self._down_m
        self._say(f"RTL: start return at {_metres(altitude_m)} m ({_metres(return_height_m)} m above destination)")
        self._enter(view)

    def update(self, view: View) -> None:
        """Go on to the next leg where this one is over."""
        if self._leg in (ReturnLeg.DONE, ReturnLeg.LAND):
            return
        if self._arrival.is_reached(self.target, self._acceptance(), view, self._parameters):
            self._leg = self._next()
            self._enter(view)

    def _choose_place(self, view: View, missions: MissionStore) -> None:
        """RTL::findRtlDestination."""
        home = view.home_ned_m
        self._place_ned_m, self._place_yaw_rad = home, view.home_yaw_rad
        nearest_m = view.distance_m(home)
        for item in missions.rally.items:
            if item.command != kinds.RALLY_POINT:
                continue
            place = place_of(item, self._origin, home)
            is_another = math.hypot(place[0] - home[0], place[1] - home[1]) > _SAME_AS_HOME_M
            if is_another and view.distance_m(place) + _NEARER_BY_M < nearest_m:
                nearest_m = view.distance_m(place)
                self._place_ned_m, self._place_yaw_rad = place, None

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
