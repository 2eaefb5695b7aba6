"""What goes over a link about missions, geofences and rally points, as values."""

import math
import struct
import zlib
from dataclasses import dataclass
from enum import IntEnum
from typing import TypeAlias


class MissionType(IntEnum):
    """MAV_MISSION_TYPE."""

    MISSION = 0
    FENCE = 1
    RALLY = 2
    ALL = 255


class MissionResult(IntEnum):
    """MAV_MISSION_RESULT, as far as PX4 uses it."""

    ACCEPTED = 0
    ERROR = 1
    UNSUPPORTED_FRAME = 2
    UNSUPPORTED = 3
    NO_SPACE = 4
    INVALID = 5
    INVALID_PARAM1 = 6
    CANCELLED = 15


@dataclass(frozen=True, slots=True)
class MissionPeer:
    """Who sent a message, or is to get one."""

    system: int
    component: int


@dataclass(frozen=True, slots=True)
class WireItem:
    """MISSION_ITEM or MISSION_ITEM_INT as it came: the two differ in the fifth and sixth parameter."""

    number: int
    frame: int
    command: int
    current: bool
    autocontinue: int
    params: tuple[float, float, float, float]
    x: float
    """The degrees or units themselves in MISSION_ITEM, 1e-7 degrees or whole units in MISSION_ITEM_INT."""
    y: float
    z: float
    is_int: bool

    def checksum(self, before: int) -> int:
        """PX4's CRC-32 over the items, continued from ``before`` (mavlink_mission.cpp, crc32part)."""
        kinds = "ii" if self.is_int else "ff"
        place = (int(self.x), int(self.y)) if self.is_int else (self.x, self.y)
        raw = struct.pack(
            f"<BHB4f{kinds}f", self.frame, self.command, self.autocontinue & 0xFF, *self.params, *place, self.z
        )
        return zlib.crc32(raw, before ^ 0xFFFFFFFF) ^ 0xFFFFFFFF


@dataclass(frozen=True, slots=True)
class StoredItem:
    """A stored item: what PX4 keeps of what it was sent."""

    frame: int
    command: int
    autocontinue: int
    params: tuple[float, float, float, float, float, float, float]
    """The fifth and sixth are latitude and longitude in degrees where the frame is global; the seventh is metres."""

    @property
    def latitude_deg(self) -> float:
        return self.params[4]

    @property
    def longitude_deg(self) -> float:
        return self.params[5]

    @property
    def altitude_m(self) -> float:
        return self.params[6]

    @property
    def is_relative(self) -> bool:
        """The altitude counts from home, not from the sea."""
        return self.frame in (3, 6)

    @property
    def yaw_rad(self) -> float | None:
        """The fourth parameter as a heading; None where it is not given."""
        return math.radians(self.params[3]) if math.isfinite(self.params[3]) else None


@dataclass(frozen=True, slots=True)
class RequestList:
    peer: MissionPeer
    type: int


@dataclass(frozen=True, slots=True)
class RequestItem:
    peer: MissionPeer
    number: int
    type: int
    is_int: bool


@dataclass(frozen=True, slots=True)
class Count:
    peer: MissionPeer
    count: int
    type: int


@dataclass(frozen=True, slots=True)
class SentItem:
    peer: MissionPeer
    item: WireItem
    type: int


@dataclass(frozen=True, slots=True)
class Ack:
    peer: MissionPeer
    result: int
    type: int


@dataclass(frozen=True, slots=True)
class ClearAll:
    peer: MissionPeer
    type: int


@dataclass(frozen=True, slots=True)
class SetCurrent:
    peer: MissionPeer
    number: int


MissionMessage: TypeAlias = RequestList | RequestItem | Count | SentItem | Ack | ClearAll | SetCurrent


@dataclass(frozen=True, slots=True)
class SendCount:
    peer: MissionPeer
    count: int
    type: int


@dataclass(frozen=True, slots=True)
class SendItem:
    peer: MissionPeer
    number: int
    item: StoredItem
    is_current: bool
    type: int
    is_int: bool


@dataclass(frozen=True, slots=True)
class SendRequest:
    peer: MissionPeer
    number: int
    type: int
    is_int: bool


@dataclass(frozen=True, slots=True)
class SendAck:
    peer: MissionPeer
    result: MissionResult
    type: int


@dataclass(frozen=True, slots=True)
class SendCurrent:
    """MISSION_CURRENT."""

    number: int
    total: int
    state: int
    mode: int


@dataclass(frozen=True, slots=True)
class SendReached:
    """MISSION_ITEM_REACHED."""

    number: int


MissionAnswer: TypeAlias = SendCount | SendItem | SendRequest | SendAck | SendCurrent | SendReached
