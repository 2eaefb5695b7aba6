"""Mission items on the wire: which PX4 takes, what it keeps of them, and how they come back.

Source: PX4's mavlink_mission.cpp, parse_mavlink_mission_item and format_mavlink_mission_item. An item with a place must
be global; one without must be in MAV_FRAME_MISSION. What PX4 does not keep comes back as zero.
"""

import math
from enum import IntEnum
from typing import TypeAlias

from pymavlink.dialects.v20 import development as dialect

from sim_vehicle.autopilot.mission_protocol import mission_items as kinds
from sim_vehicle.autopilot.mission_protocol.mission_items import MissionType, StoredItem
from sim_vehicle.mavlink.encode import Message

ItemPacket: TypeAlias = dialect.MAVLink_mission_item_int_message

_GLOBAL_FRAMES = (kinds.FRAME_GLOBAL, kinds.FRAME_GLOBAL_RELATIVE)
_GLOBAL_INT_FRAMES = (kinds.FRAME_GLOBAL_INT, kinds.FRAME_GLOBAL_RELATIVE_INT)
_INT_FRAME = dict(zip(_GLOBAL_FRAMES, _GLOBAL_INT_FRAMES, strict=True))
# Of the first four parameters of a global item: kept as they are (k), as whether they are positive (b), as a
# heading within 0 to 360 degrees (h), as a whole number (n), or not at all (-).
_KEPT: dict[int, str] = {
    kinds.WAYPOINT: "kk-h",
    kinds.LOITER_UNLIMITED: "--kh",
    kinds.LOITER_TIME: "kbkb",
    kinds.LAND: "-k-h",
    kinds.TAKEOFF: "---h",
    kinds.DO_SET_ROI_LOCATION: "----",
    kinds.FENCE_RETURN_POINT: "----",
    kinds.FENCE_POLYGON_INCLUSION: "n---",
    kinds.FENCE_POLYGON_EXCLUSION: "n---",
    kinds.FENCE_CIRCLE_INCLUSION: "k---",
    kinds.FENCE_CIRCLE_EXCLUSION: "k---",
    kinds.RALLY_POINT: "----",
    kinds.ARM_DISARM: "n---",
}
_DEGREES_PER_UNIT = 1e-7


class MissionResult(IntEnum):
    """MAV_MISSION_RESULT, as far as PX4 uses it."""

    ACCEPTED = 0
    ERROR = 1
    UNSUPPORTED_FRAME = 2
    UNSUPPORTED = 3
    NO_SPACE = 4
    CANCELLED = 15


def parse(packet: ItemPacket) -> StoredItem | MissionResult:
    """The item as it is stored, or why it is refused."""
    if packet.frame in (*_GLOBAL_FRAMES, *_GLOBAL_INT_FRAMES):
        rules, scale = _KEPT.get(packet.command), _DEGREES_PER_UNIT
    elif packet.frame == kinds.FRAME_MISSION:
        rules, scale = ("kkkk" if packet.command in kinds.WITHOUT_POSITION else None), 1
    else:
        return MissionResult.UNSUPPORTED_FRAME
    if rules is None:
        return MissionResult.UNSUPPORTED
    p1, p2, p3, p4 = map(_kept, rules, (packet.param1, packet.param2, packet.param3, packet.param4))
    params = (p1, p2, p3, p4, packet.x * scale, packet.y * scale, packet.z)
    return StoredItem(packet.frame, packet.command, packet.autocontinue, params)


def _kept(rule: str, value: float) -> float:
    if rule == "k":
        return value
    if rule == "b":
        return float(value > 0)
    if rule == "h":
        return value % 360.0 if math.isfinite(value) else math.nan
    if rule == "n":
        return float(int(value + 0.5)) if math.isfinite(value) else -1.0
    return 0.0


def fits(item: StoredItem, kind: int) -> bool:
    """Whether the item may be in a list of this MAV_MISSION_TYPE."""
    if kind == MissionType.MISSION:
        return item.command not in kinds.NOT_IN_A_MISSION
    has_too_few_corners = item.command in kinds.FENCE_POLYGONS and item.params[0] < 3
    return kind != MissionType.FENCE or not has_too_few_corners


def item_message(item: StoredItem, peer: tuple[int, int], number: int, is_current: bool, kind: int) -> Message:
    """MISSION_ITEM_INT."""
    *params, x, y, z = item.params
    around = (item.command, int(is_current), item.autocontinue)
    scale = 1 if item.frame == kinds.FRAME_MISSION else 1e7
    frame = _INT_FRAME.get(item.frame, item.frame)
    place = (round(x * scale), round(y * scale))
    return dialect.MAVLink_mission_item_int_message(*peer, number, frame, *around, *params, *place, z, kind)
