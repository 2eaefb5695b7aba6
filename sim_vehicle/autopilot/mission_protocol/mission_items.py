"""The items of missions, geofences and rally points: their numbers, and what the vehicle keeps of each."""

import math
from dataclasses import dataclass
from enum import IntEnum

from sim_vehicle.geography import Origin, Place
from sim_vehicle.quantities import Vector3

FRAME_GLOBAL, FRAME_MISSION, FRAME_GLOBAL_RELATIVE = 0, 2, 3
FRAME_GLOBAL_INT, FRAME_GLOBAL_RELATIVE_INT = 5, 6

WAYPOINT = 16
LOITER_UNLIMITED = 17
LOITER_TIME = 19
RETURN_TO_LAUNCH = 20
LAND = 21
TAKEOFF = 22
DELAY = 93
DO_CHANGE_SPEED = 178
DO_LAND_START = 189
DO_SET_ROI_LOCATION, DO_SET_ROI_WPNEXT_OFFSET, DO_SET_ROI_NONE = 195, 196, 197
ARM_DISARM = 400
FENCE_RETURN_POINT = 5000
FENCE_POLYGON_INCLUSION, FENCE_POLYGON_EXCLUSION = 5001, 5002
FENCE_CIRCLE_INCLUSION, FENCE_CIRCLE_EXCLUSION = 5003, 5004
RALLY_POINT = 5100
FENCE_POLYGONS = (FENCE_POLYGON_INCLUSION, FENCE_POLYGON_EXCLUSION)
FENCE_CIRCLES = (FENCE_CIRCLE_INCLUSION, FENCE_CIRCLE_EXCLUSION)
NOT_IN_A_MISSION = (*FENCE_POLYGONS, *FENCE_CIRCLES, RALLY_POINT)

WITH_POSITION = frozenset({WAYPOINT, LOITER_UNLIMITED, LOITER_TIME, LAND, TAKEOFF})
"""Items to fly to; the others act where the vehicle is."""
# Cameras, gimbals and other payload that this vehicle has none of: PX4 stores their items and flies on past them.
PAYLOAD = frozenset(
    {
        *(187, 200, 203, 204, 205, 206, 211, 214, 260, 530, 532, 534, 1000, 1001, 2000, 2001, 2003, 2500, 2501),
        *(3000, 42600),
    }
)


WITHOUT_POSITION = PAYLOAD | {
    *(DELAY, DO_CHANGE_SPEED, DO_LAND_START, RETURN_TO_LAUNCH, ARM_DISARM),
    *(DO_SET_ROI_WPNEXT_OFFSET, DO_SET_ROI_NONE),
}
"""Items that act where the vehicle is."""


class MissionType(IntEnum):
    """MAV_MISSION_TYPE."""

    MISSION = 0
    FENCE = 1
    RALLY = 2
    ALL = 255


@dataclass(frozen=True, slots=True)
class StoredItem:
    """A stored item: what PX4 keeps of what it was sent."""

    frame: int
    command: int
    autocontinue: int
    params: tuple[float, float, float, float, float, float, float]
    """The fifth and sixth are latitude and longitude in degrees where the frame is global; the seventh is metres."""

    @property
    def place(self) -> Place:
        """Where the frame is global; the altitude from home, where it `is_relative`."""
        *_, latitude_deg, longitude_deg, altitude_m = self.params
        return Place(latitude_deg, longitude_deg, altitude_m)

    @property
    def is_relative(self) -> bool:
        """The altitude counts from home, not from the sea."""
        return self.frame in (3, 6)

    @property
    def yaw_rad(self) -> float | None:
        """The fourth parameter as a heading; None where it is not given."""
        return math.radians(self.params[3]) if math.isfinite(self.params[3]) else None


def place_of(item: StoredItem, origin: Origin, home_ned_m: Vector3) -> Vector3:
    """Where an item with a place lies."""
    north, east, down = origin.position_of(item.place)
    return north, east, home_ned_m[2] - item.place.altitude_m if item.is_relative else down
