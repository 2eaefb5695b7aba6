"""RETURN: climb, fly home, and land there.

Sources: PX4's navigator rtl.cpp and rtl_direct.cpp for multicopters, with RTL_TYPE 0, no landing in the mission and no
rally points: they are stored, and nothing leads there.
"""

import math
from enum import Enum, auto

from sim_vehicle.autopilot.flight_tasks.target import Acceptance, Arrival, Kind, NavigatorTarget, View
from sim_vehicle.autopilot.messages import Severity, Texts
from sim_vehicle.geography import Origin
from sim_vehicle.parameters.store import Parameters


class ReturnLeg(Enum):
    """RtlDirect's states."""

    CLIMB = auto()
    GO = auto()
    LAND = auto()
    """Or nothing, on the ground."""


class Return:
    """The stages of one return."""

    def __init__(self, parameters: Parameters, origin: Origin, texts: Texts) -> None:
        self._parameters = parameters
        self._origin = origin
        self._arrival = Arrival()
        self._leg = ReturnLeg.LAND
        self._down_m = 0.0
        self.target = NavigatorTarget(Kind.IDLE, (0.0, 0.0, 0.0))
        self._texts = texts

    def begin(self, view: View) -> None:
        """Choose how high, and start."""
        return_height_m = return_height_over(view.height_m, view.distance_m(view.home_ned_m), self._parameters)
        self._down_m = view.home_ned_m[2] - return_height_m
        altitude_m = self._origin.place.altitude_m - self._down_m
        heights = f"{math.ceil(altitude_m)} m ({math.ceil(return_height_m)} m above destination)"
        self._texts.say(Severity.INFO, f"RTL: start return at {heights}")
        if view.landed:
            self._leg, self.target = ReturnLeg.LAND, NavigatorTarget(Kind.IDLE, view.position_ned_m)
            return
        self._leg = ReturnLeg.CLIMB if view.height_m < return_height_m else ReturnLeg.GO
        self._enter(view)

    def update(self, view: View) -> None:
        """Go on to the next leg where this one is over."""
        if self._leg is ReturnLeg.LAND:
            return
        if self._arrival.is_reached(self.target, self._acceptance(), view, self._parameters):
            self._leg = ReturnLeg.GO if self._leg is ReturnLeg.CLIMB else ReturnLeg.LAND
            self._enter(view)

    def _enter(self, view: View) -> None:
        self._arrival.begin()
        north, east, _ = home = view.home_ned_m
        if self._leg is ReturnLeg.CLIMB:
            here = (view.position_ned_m[0], view.position_ned_m[1], self._down_m)
            self.target = NavigatorTarget(Kind.HOLD, here, view.yaw_rad)
        elif self._leg is ReturnLeg.GO:
            is_near = view.distance_m(home) < self._parameters["RTL_MIN_DIST"]
            yaw_rad = view.home_yaw_rad if is_near else None
            self.target = NavigatorTarget(Kind.POSITION, (north, east, self._down_m), yaw_rad)
        else:
            self.target = NavigatorTarget(Kind.LAND, home, view.home_yaw_rad)
            self._texts.say(Severity.INFO, "RTL: land at destination")

    def _acceptance(self) -> Acceptance:
        yaw_rad = None if self._leg is ReturnLeg.CLIMB else self.target.yaw_rad
        return Acceptance(self._parameters["NAV_ACC_RAD"], self._parameters["NAV_MC_ALT_RAD"], yaw_rad=yaw_rad)


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
