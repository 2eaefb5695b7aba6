"""MISSION: which item is flown, when it is over, and what comes next.

Source: PX4's navigator mission_base.cpp, mission.cpp and mission_block.cpp, for multicopters. Items for cameras,
gimbals and other payload are passed at once: this vehicle has none.
"""

import math
from collections.abc import Sequence
from enum import Enum, auto

from sim_vehicle.autopilot.flight_tasks.smoothing import stop_point
from sim_vehicle.autopilot.flight_tasks.target import (
    Acceptance,
    Arrival,
    Kind,
    NavigatorTarget,
    View,
    takeoff_acceptance,
)
from sim_vehicle.autopilot.messages import Severity, Texts
from sim_vehicle.autopilot.mission_protocol import mission_items as kinds
from sim_vehicle.autopilot.mission_protocol.mission_items import StoredItem, place_of
from sim_vehicle.autopilot.mission_protocol.mission_store import MissionStore
from sim_vehicle.autopilot.navigator.geofence import Geofence
from sim_vehicle.geography import Origin
from sim_vehicle.parameters.store import Parameters
from sim_vehicle.quantities import Vector3


class Work(Enum):
    """What has to be done before the item itself."""

    ITEM = auto()
    CLIMB = auto()
    MOVE_TO_LAND = auto()


class MissionFlight:
    """The run through the stored items."""

    def __init__(self, store: MissionStore, parameters: Parameters, origin: Origin, texts: Texts) -> None:
        self._store = store
        self._parameters = parameters
        self._origin = origin
        self._arrival = Arrival()
        self._work = Work.ITEM
        self._climb_down_m: float | None = None
        self._was_disarmed = False
        self._was_flown = False
        self.runs = False
        """An item is being flown."""
        self.target = NavigatorTarget(Kind.IDLE, (0.0, 0.0, 0.0))
        self._texts = texts
        self.commands: list[StoredItem] = []
        """Items that give a command; the commander and the navigator see to it."""
        self._given: list[StoredItem] = []

    # --- beginning and ending ----------------------------------------------------------------------------------

    def begin(self, view: View) -> None:
        """The mode was entered: from the item that is current, or from the first if the mission is over."""
        store = self._store
        if self._was_disarmed and self._was_flown and store.current + 1 == len(store.mission):
            store.current = 0
        self._was_disarmed, self._was_flown = False, True
        self._announce(view)
        self._plan_climb(view)
        self._set_item(view)

    def changed(self, view: View) -> None:
        """Another mission, or another current item, while the mode flies."""
        self._announce(view)
        self._set_item(view)

    def end(self) -> None:
        """The mode was left: what was begun begins anew when it comes back."""
        self._work, self._climb_down_m = Work.ITEM, None
        self.runs, self._given = False, []
        self._store.progress.reached = -1

    def forget(self) -> None:
        """Another mission was uploaded while the mode does not fly."""
        self._was_flown = False

    def disarmed(self) -> None:
        """The vehicle was disarmed while another mode flew, or this one was over."""
        self._was_disarmed = True

    def _announce(self, view: View) -> None:
        self._work = Work.ITEM
        progress = self._store.progress
        progress.reached, progress.finished = -1, False
        if self._store.mission and progress.valid:
            if not self.runs:
                self._texts.say(Severity.INFO, "Executing Mission")
            self.runs = True
            return
        self.runs = False
        what = "refusing takeoff" if view.landed else "loitering"
        self._texts.say(Severity.CRITICAL, f"No valid mission available, {what}")

    def _plan_climb(self, view: View) -> None:
        """From below the first place it climbs before it goes there."""
        self._climb_down_m = None
        for item in self._store.mission[self._store.current :]:
            if item.command in kinds.WITH_POSITION:
                down_m = place_of(item, self._origin, view.home_ned_m)[2]
                if view.position_ned_m[2] - down_m > self._parameters["NAV_MC_ALT_RAD"]:
                    self._climb_down_m = down_m
                return

    # --- going on ----------------------------------------------------------------------------------------------

    def update(self, view: View) -> None:
        """Go on where the item is over; call it at the navigator's rate."""
        if self._given:
            # A command acts when its item counts as reached: a return at the end finds the mission finished
            self.commands += self._given
            self._given = []
        if not self.runs:
            return
        item = self._store.mission[self._store.current]
        if not self._is_over(item, view):
            return
        if self._work is not Work.CLIMB:
            self._store.progress.reached = self._store.current
        if not item.autocontinue:
            return
        if self._work is Work.ITEM and not self._advance():
            self._finish(view)
            return
        self._set_item(view)

    def _is_over(self, item: StoredItem, view: View) -> bool:
        command = item.command
        if self._work is Work.ITEM:
            if command == kinds.LAND:
                return view.landed
            if command == kinds.DELAY:
                stays = Acceptance(math.inf, math.inf, inside_s=max(item.params[0], 0.0))
                return self._arrival.is_reached(self.target, stays, view, self._parameters)
            if command not in kinds.WITH_POSITION:
                return True
            if command == kinds.LOITER_UNLIMITED or not math.isfinite(item.place.altitude_m):
                return False
        return self._arrival.is_reached(self.target, self._acceptance(item, view), view, self._parameters)

    def _acceptance(self, item: StoredItem, view: View) -> Acceptance:
        horizontal_m, vertical_m = self._parameters["NAV_ACC_RAD"], self._parameters["NAV_MC_ALT_RAD"]
        if self.target.kind is Kind.TAKEOFF:
            return takeoff_acceptance(self.target, view, self._parameters)
        if self._work is not Work.ITEM:
            return Acceptance(horizontal_m, vertical_m)
        if item.command == kinds.WAYPOINT and math.isfinite(item.params[1]) and item.params[1] > 0.0:
            horizontal_m = item.params[1]
        stays = item.command in (kinds.WAYPOINT, kinds.LOITER_TIME)
        return Acceptance(
            horizontal_m, vertical_m, inside_s=max(item.params[0], 0.0) if stays else 0.0, yaw_rad=self.target.yaw_rad
        )

    def _advance(self) -> bool:
        """On to the next item; False behind the last."""
        if self._store.current + 1 >= len(self._store.mission):
            return False
        self._store.current += 1
        return True

    def _finish(self, view: View) -> None:
        self.runs = False
        self._store.progress.finished = True
        self._texts.say(Severity.INFO, "Mission finished, landed" if view.landed else "Mission finished, loitering")
        if view.landed:
            self.target = NavigatorTarget(Kind.IDLE, view.position_ned_m)
        elif self.target.kind in (Kind.POSITION, Kind.HOLD):
            self.target = NavigatorTarget(Kind.HOLD, self.target.position_ned_m, self.target.yaw_rad)
        else:
            self.target = NavigatorTarget(Kind.HOLD, view.position_ned_m)

    # --- what an item means ------------------------------------------------------------------------------------

    def _set_item(self, view: View) -> None:
        self._arrival.begin()
        if not self.runs:
            here = stop_point(view.position_ned_m, view.velocity_ned_m_s, self._parameters)
            self.target = NavigatorTarget(Kind.IDLE if view.landed else Kind.HOLD, here)
            return
        item = self._store.mission[self._store.current]
        if item.command in kinds.WITH_POSITION:
            self._fly_to(item, view)
            return
        self._work = Work.ITEM
        if self.target.kind in (Kind.TAKEOFF, Kind.IDLE, Kind.LAND) and not view.landed:
            self.target = NavigatorTarget(Kind.HOLD, self.target.position_ned_m, self.target.yaw_rad)
        elif view.landed:
            self.target = NavigatorTarget(Kind.IDLE, view.position_ned_m)
        self._given.append(item)

    def _fly_to(self, item: StoredItem, view: View) -> None:
        place = place_of(item, self._origin, view.home_ned_m)
        north, east, _ = view.position_ned_m
        before, self._work = self._work, Work.ITEM
        if not math.isfinite(place[2]):
            self.target, self._climb_down_m = NavigatorTarget(Kind.HOLD, view.position_ned_m), None  # FlightTaskAuto
        elif before is Work.ITEM and self._climb_down_m is not None:
            self._work = Work.CLIMB
            height_m = view.home_ned_m[2] - self._climb_down_m
            self._texts.say(Severity.INFO, f"Climb to {height_m:.1f} meters above home")
            kind = Kind.TAKEOFF if view.landed else Kind.HOLD
            self.target = NavigatorTarget(kind, (north, east, self._climb_down_m))
            self._climb_down_m = None
        elif item.command == kinds.LAND:
            self._land_at(place, before, view)
        elif item.command in (kinds.LOITER_UNLIMITED, kinds.LOITER_TIME):
            self.target = NavigatorTarget(Kind.HOLD, place, item.yaw_rad)
        elif item.command == kinds.TAKEOFF:
            self.target = NavigatorTarget(Kind.TAKEOFF if view.landed else Kind.POSITION, place)
        else:
            self.target = NavigatorTarget(Kind.POSITION, place, item.yaw_rad)

    def _land_at(self, place: Vector3, before: Work, view: View) -> None:
        is_far = view.distance_m(place) > self._parameters["NAV_ACC_RAD"]
        if not view.landed and is_far and before is not Work.MOVE_TO_LAND:
            self._work = Work.MOVE_TO_LAND
            height = self.target.position_ned_m if self.target.kind is Kind.POSITION else view.position_ned_m
            self.target = NavigatorTarget(Kind.POSITION, (place[0], place[1], height[2]))
        else:
            self.target = NavigatorTarget(Kind.LAND, place)


def problem_of(items: Sequence[StoredItem], origin: Origin, fence: Geofence, view: View) -> str | None:
    """Why an uploaded mission may not be flown, in PX4's words; None where it may (FeasibilityChecker.cpp)."""
    if items and items[0].command == kinds.LAND and view.landed:
        return "Mission rejected: starts with landing"
    home, has_place = view.home_ned_m, False
    for number, item in enumerate(items, start=1):
        if item.command not in kinds.WITH_POSITION:
            continue
        place = place_of(item, origin, home)
        if item.command == kinds.TAKEOFF and place[2] >= home[2]:
            return "Mission rejected: Takeoff altitude below home altitude!"
        if item.command == kinds.TAKEOFF and has_place:
            return "Mission rejected: takeoff not first waypoint item"
        if not fence.allows(place):
            return f"Geofence violation for waypoint {number}"
        has_place = True
    return None
