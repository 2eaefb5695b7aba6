"""Which mission items PX4 takes, what it keeps of them, and what they are.

Source: PX4's mavlink_mission.cpp, parse_mavlink_mission_item and format_mavlink_mission_item. An item with a place must
be global; one without must be in MAV_FRAME_MISSION. What PX4 does not keep comes back as zero.
"""

import math

from sim_vehicle.autopilot.mission_protocol.mission_messages import MissionResult, MissionType, StoredItem, WireItem
from sim_vehicle.geography import Origin
from sim_vehicle.hil.messages import Place
from sim_vehicle.setpoint import Vector3

FRAME_GLOBAL, FRAME_MISSION, FRAME_GLOBAL_RELATIVE = 0, 2, 3
FRAME_GLOBAL_INT, FRAME_GLOBAL_RELATIVE_INT = 5, 6
_GLOBAL_FRAMES = (FRAME_GLOBAL, FRAME_GLOBAL_RELATIVE)
_GLOBAL_INT_FRAMES = (FRAME_GLOBAL_INT, FRAME_GLOBAL_RELATIVE_INT)

WAYPOINT = 16
LOITER_UNLIMITED = 17
LOITER_TIME = 19
RETURN_TO_LAUNCH = 20
LAND = 21
TAKEOFF = 22
LOITER_TO_ALTITUDE = 31
ROI = 80
VTOL_TAKEOFF, VTOL_LAND = 84, 85
DELAY = 93
CONDITION_DELAY, CONDITION_DISTANCE = 112, 114
DO_JUMP = 177
DO_CHANGE_SPEED = 178
DO_SET_HOME = 179
DO_LAND_START = 189
DO_SET_ROI_LOCATION, DO_SET_ROI_WPNEXT_OFFSET, DO_SET_ROI_NONE, DO_SET_ROI = 195, 196, 197, 201
DO_AUTOTUNE_ENABLE = 212
ARM_DISARM = 400
CONDITION_GATE = 4501
FENCE_RETURN_POINT = 5000
FENCE_POLYGON_INCLUSION, FENCE_POLYGON_EXCLUSION = 5001, 5002
FENCE_CIRCLE_INCLUSION, FENCE_CIRCLE_EXCLUSION = 5003, 5004
RALLY_POINT = 5100
FENCE_POLYGONS = (FENCE_POLYGON_INCLUSION, FENCE_POLYGON_EXCLUSION)
FENCE_CIRCLES = (FENCE_CIRCLE_INCLUSION, FENCE_CIRCLE_EXCLUSION)
NOT_IN_A_MISSION = (*FENCE_POLYGONS, *FENCE_CIRCLES, RALLY_POINT)

ROI_NONE, ROI_WPNEXT, ROI_WPINDEX, ROI_LOCATION = 0, 1, 2, 3

WITH_POSITION = frozenset(
    {WAYPOINT, LOITER_UNLIMITED, LOITER_TIME, LAND, TAKEOFF, LOITER_TO_ALTITUDE, VTOL_TAKEOFF, VTOL_LAND}
)
"""Items to fly to; the others act where the vehicle is."""

# Of the first four parameters of a global item: kept as they are (k), as whether they are positive (b), as a
# heading within 0 to 360 degrees (h), as a whole number (n), or not at all (-).
_KEPT: dict[int, str] = {
    WAYPOINT: "kk-h",
    LOITER_UNLIMITED: "--kh",
    LOITER_TIME: "kbkb",
    LAND: "-k-h",
    TAKEOFF: "---h",
    LOITER_TO_ALTITUDE: "bk-b",
    ROI: "----",
    DO_SET_ROI: "----",
    DO_SET_ROI_LOCATION: "----",
    VTOL_TAKEOFF: "---h",
    VTOL_LAND: "---h",
    CONDITION_GATE: "----",
    FENCE_RETURN_POINT: "----",
    FENCE_POLYGON_INCLUSION: "n---",
    FENCE_POLYGON_EXCLUSION: "n---",
    FENCE_CIRCLE_INCLUSION: "k---",
    FENCE_CIRCLE_EXCLUSION: "k---",
    RALLY_POINT: "----",
    ARM_DISARM: "n---",
    DO_AUTOTUNE_ENABLE: "nn--",
}
# Cameras, gimbals and other payload that this vehicle has none of: PX4 stores their items and flies on past them.
PAYLOAD = frozenset(
    {
        *(187, 200, 203, 204, 205, 206, 211, 214, 260, 530, 532, 534, 1000, 1001, 2000, 2001, 2003, 2500, 2501),
        *(3000, 42600),
    }
)
_WITHOUT_PLACE = PAYLOAD | {
    *(DO_JUMP, ROI, DO_SET_ROI, DO_CHANGE_SPEED, DO_SET_HOME, DO_LAND_START, DELAY, RETURN_TO_LAUNCH),
    *(DO_SET_ROI_WPNEXT_OFFSET, DO_SET_ROI_NONE, CONDITION_DELAY, CONDITION_DISTANCE, DO_AUTOTUNE_ENABLE, ARM_DISARM),
}
_DEGREES_PER_UNIT = 1e-7


def parse(wire: WireItem) -> StoredItem | MissionResult:
    """The item as it is stored, or why it is refused."""
    if wire.frame in _GLOBAL_FRAMES or (wire.is_int and wire.frame in _GLOBAL_INT_FRAMES):
        return _with_place(wire)
    if wire.frame == FRAME_MISSION:
        return _without_place(wire)
    return MissionResult.UNSUPPORTED_FRAME


def _with_place(wire: WireItem) -> StoredItem | MissionResult:
    kept = _KEPT.get(wire.command)
    if kept is None:
        return MissionResult.UNSUPPORTED
    params = tuple(_kept(rule, value) for rule, value in zip(kept, wire.params, strict=True))
    if wire.command in (ROI, DO_SET_ROI):
        mode = _whole(wire.params[0])
        if mode not in (ROI_LOCATION, ROI_NONE):
            return MissionResult.INVALID_PARAM1
        params = (float(mode), *params[1:])
    scale = _DEGREES_PER_UNIT if wire.is_int else 1.0
    return _item(wire, params, wire.x * scale, wire.y * scale)


def _without_place(wire: WireItem) -> StoredItem | MissionResult:
    if wire.command not in _WITHOUT_PLACE:
        return MissionResult.UNSUPPORTED
    if wire.command in (ROI, DO_SET_ROI) and _whole(wire.params[0]) not in (ROI_NONE, ROI_WPNEXT, ROI_WPINDEX):
        return MissionResult.INVALID_PARAM1
    return _item(wire, wire.params, wire.x, wire.y)


def _item(wire: WireItem, params: tuple[float, ...], x: float, y: float) -> StoredItem:
    p1, p2, p3, p4 = params
    command = DO_SET_ROI if wire.command == ROI else wire.command
    return StoredItem(wire.frame, command, wire.autocontinue, (p1, p2, p3, p4, x, y, wire.z))


def _kept(rule: str, value: float) -> float:
    if rule == "k":
        return value
    if rule == "b":
        return float(value > 0)
    if rule == "h":
        return value % 360.0 if math.isfinite(value) else math.nan
    return float(_whole(value)) if rule == "n" else 0.0


def _whole(value: float) -> int:
    return int(value + 0.5) if math.isfinite(value) else -1


def fits(item: StoredItem, kind: int) -> bool:
    """Whether the item may be in a list of this MAV_MISSION_TYPE."""
    if kind == MissionType.MISSION:
        return item.command not in NOT_IN_A_MISSION
    has_too_few_corners = item.command in FENCE_POLYGONS and item.params[0] < 3
    return kind != MissionType.FENCE or not has_too_few_corners


def place_of(item: StoredItem, origin: Origin, home_ned_m: Vector3) -> Vector3:
    """Where an item with a place lies."""
    north, east, down = origin.position_of(Place(item.latitude_deg, item.longitude_deg, item.altitude_m))
    return north, east, home_ned_m[2] - item.altitude_m if item.is_relative else down
