"""Whether an uploaded mission can be flown at all, and if not, in which words PX4 refuses it.

Source: PX4's navigator/MissionFeasibility/FeasibilityChecker.cpp and mission_feasibility_checker.cpp.
"""

import math
from collections.abc import Sequence

from sim_vehicle.autopilot.flight_tasks.target import View
from sim_vehicle.autopilot.mission_protocol import mission_items as kinds
from sim_vehicle.autopilot.mission_protocol.mission_items import StoredItem, place_of
from sim_vehicle.autopilot.navigator.geofence import Geofence
from sim_vehicle.geography import Origin
from sim_vehicle.parameters.store import Parameters

# Stored by the link, yet no item that the navigator could fly.
_NOT_FLOWN = frozenset(
    {kinds.CONDITION_DELAY, kinds.CONDITION_DISTANCE, kinds.CONDITION_GATE, kinds.FENCE_RETURN_POINT}
)
# What may stand before a takeoff: it has no place. Of payload, all but a winch, a gripper and an actuator.
_PLACELESS = frozenset(
    {
        *(kinds.DELAY, kinds.DO_JUMP, kinds.DO_CHANGE_SPEED, kinds.DO_SET_HOME, kinds.DO_LAND_START),
        *(kinds.DO_SET_ROI, kinds.DO_SET_ROI_LOCATION, kinds.DO_SET_ROI_WPNEXT_OFFSET, kinds.DO_SET_ROI_NONE),
        *(kinds.PAYLOAD - {187, 211, 42600}),
    }
)
_FOR_VTOL = (kinds.VTOL_TAKEOFF, kinds.VTOL_LAND, 3000)


class MissionCheck:
    """One pass over the items; `problems` and `warnings` are its texts."""

    def __init__(self, parameters: Parameters, origin: Origin, fence: Geofence, view: View) -> None:
        self._parameters = parameters
        self._origin = origin
        self._fence = fence
        self._view = view
        self.problems: list[str] = []
        self.warnings: list[str] = []

    def passes(self, items: Sequence[StoredItem]) -> bool:
        """Whether the mission may be flown; an empty one may not."""
        self.problems, self.warnings = [], []
        if not items:
            return False
        if self._all_can_be_flown(items):
            self._check_first_place(items)
            self._check_takeoff(items)
        self._check_fence(items)
        return not self.problems

    def _all_can_be_flown(self, items: Sequence[StoredItem]) -> bool:
        for number, item in enumerate(items, start=1):
            if item.command in _NOT_FLOWN:
                self.problems.append(f"Mission rejected: item {number}: unsupported cmd: {item.command}")
                return False
            if item.command in _FOR_VTOL:
                self.problems.append(f"Mission rejected: Item {number - 1} does not fit vehicle type")
                return False
        if items[0].command == kinds.LAND and self._view.landed:
            self.problems.append("Mission rejected: starts with landing")
            return False
        return True

    def _check_first_place(self, items: Sequence[StoredItem]) -> None:
        """MIS_DIST_1WP is only a warning."""
        home, most_m = self._view.home_ned_m, self._parameters["MIS_DIST_1WP"]
        for item in items:
            if item.command in kinds.WITH_POSITION:
                north, east, _ = place_of(item, self._origin, home)
                away_m = math.hypot(north - home[0], east - home[1])
                if 0.0 < most_m <= away_m:
                    text = f"First waypoint far away from home: {int(away_m)}m. Correct mission loaded?"
                    self.warnings.append(text)
                return

    def _check_takeoff(self, items: Sequence[StoredItem]) -> None:
        has_place = False
        for item in items:
            if item.command == kinds.TAKEOFF:
                height_m = self._view.home_ned_m[2] - place_of(item, self._origin, self._view.home_ned_m)[2]
                if height_m <= 0.0:
                    self.problems.append("Mission rejected: Takeoff altitude below home altitude!")
                    return
                if has_place:
                    self.problems.append("Mission rejected: takeoff not first waypoint item")
                    return
            has_place = has_place or item.command not in _PLACELESS

    def _check_fence(self, items: Sequence[StoredItem]) -> None:
        for number, item in enumerate(items, start=1):
            if item.command not in kinds.WITH_POSITION:
                continue
            if not self._fence.allows(place_of(item, self._origin, self._view.home_ned_m), self._view.home_ned_m):
                self.problems.append(f"Geofence violation for waypoint {number}")
                return
