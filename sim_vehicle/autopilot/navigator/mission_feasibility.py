"""Whether an uploaded mission may be flown, and if not, in which words PX4 refuses it.

Source: PX4's navigator/MissionFeasibility/FeasibilityChecker.cpp and mission_feasibility_checker.cpp.
"""

from collections.abc import Sequence

from sim_vehicle.autopilot.flight_tasks.target import View
from sim_vehicle.autopilot.mission_protocol import mission_items as kinds
from sim_vehicle.autopilot.mission_protocol.mission_items import StoredItem, place_of
from sim_vehicle.autopilot.navigator.geofence import Geofence
from sim_vehicle.geography import Origin


def problem_of(items: Sequence[StoredItem], origin: Origin, fence: Geofence, view: View) -> str | None:
    """The first thing that is wrong with the items; None where nothing is."""
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
        if not fence.allows(place, home):
            return f"Geofence violation for waypoint {number}"
        has_place = True
    return None
