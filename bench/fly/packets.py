"""Packets as somebody on the wire reads, changes and forges them."""

import math
from collections.abc import Callable
from typing import Any

from pymavlink.dialects.v20 import development as dialect

from companion.flight.machine import FlightCore
from companion.mavlink.packet import message_id_of, payload_of

HEARTBEAT, MODE, COMMAND, SETPOINT = 0, 436, 76, 84
ARM, SET_MODE = 400, 176
# Which of two messages of the same kind is whose.
VEHICLE, GROUND_STATION = (1, 1), (255, 190)
_link = dialect.MAVLink(None)
# Single precision, and the fence's own nearest place.
_ROUNDING = 1.001
_ROUNDING_M = 0.01
_GRAVITY_M_S2 = 9.81
# POSITION_TARGET_TYPEMASK.
_XY, _Z, _VELOCITY, _ACCELERATION, _YAW = 0x003, 0x004, 0x038, 0x1C0, 0x400
_VALUES = ("x", "y", "z", "vx", "vy", "vz", "afx", "afy", "afz")


def number_of(name: str) -> int:
    """Of the message of that name."""
    number: int = getattr(dialect, f"MAVLINK_MSG_ID_{name}")
    return number


def decoded(frame: bytes) -> Any | None:
    """The message; None for what is no packet of this dialect."""
    try:
        return _link.decode(bytearray(frame))
    except dialect.MAVError:
        return None


def changed(frame: bytes, change: Callable[[Any], None]) -> bytes:
    """The packet with some fields changed, of the same sender and number."""
    message = decoded(frame)
    if message is None:
        return frame
    change(message)
    link = dialect.MAVLink(None, message.get_srcSystem(), message.get_srcComponent())
    link.seq = message.get_seq()
    packed: bytes = message.pack(link)
    return packed


def made(name: str, fields: dict[str, Any], sender: tuple[int, int] = VEHICLE, number: int = 0) -> bytes:
    """A packet of the message of that name; what is not given is 0."""
    kind = getattr(dialect, f"MAVLink_{name.lower()}_message")
    message = kind(*[_nothing(kind, index) for index in range(len(kind.fieldnames))])
    for field, value in fields.items():
        setattr(message, field, value)
    link = dialect.MAVLink(None, *sender)
    link.seq = number
    packed: bytes = message.pack(link)
    return packed


def _nothing(kind: Any, index: int) -> Any:
    # Lengths are in the order of the wire, names in that of the definition.
    length = kind.array_lengths[kind.ordered_fieldnames.index(kind.fieldnames[index])]
    if kind.fieldtypes[index] == "char":
        return b""
    return [0] * length if length else 0


def custom_mode(frame: bytes) -> int | None:
    """The mode that a packet of the vehicle's says."""
    if message_id_of(frame) not in (HEARTBEAT, MODE):
        return None
    # In both messages the mode's four bytes stand first.
    return int.from_bytes(payload_of(frame)[:4], "little")


def outside(core: FlightCore, frame: bytes) -> str | None:
    """What is wrong with a setpoint; None for one inside, and for what is none."""
    message = decoded(frame) if message_id_of(frame) == SETPOINT else None
    if message is None:
        return None
    mask, fence, limits = message.type_mask, core.flight.mission.fence, core.flight.mission.limits
    origin = core.flight.origin_ned_m
    if origin is not None:
        # A reset of the vehicle's estimate moves its frame under what stands still.
        n, e, d = (o + s for o, s in zip(origin, core.resets.shift_ned_m, strict=True))
        origin = (n, e, d)
    asked = [getattr(message, name) for bit, name in enumerate(_VALUES) if not mask >> bit & 1]
    if not asked or not all(map(math.isfinite, asked)):
        return "not finite"
    if not mask & _YAW and not abs(message.yaw) <= math.pi * _ROUNDING:
        return f"yaw {message.yaw:g} rad"
    if not mask & _ACCELERATION:
        sideways = math.hypot(message.afx, message.afy)
        if sideways > _GRAVITY_M_S2 * math.tan(math.radians(limits.max_tilt_deg)) * _ROUNDING:
            return f"{sideways:.1f} m/s2 sideways"
        if abs(message.afz) > _GRAVITY_M_S2:
            return f"{message.afz:.1f} m/s2 up or down"
    speed_m_s = 0.0 if mask & _VELOCITY else math.hypot(message.vx, message.vy, message.vz)
    if speed_m_s > limits.max_speed_m_s * _ROUNDING:
        return f"{speed_m_s:.1f} m/s"
    if origin is None:
        return None
    if not mask & _XY and not fence.contains((message.x - origin[0]) * 0.999, (message.y - origin[1]) * 0.999):
        return "outside the fence"
    height_m = origin[2] - message.z
    if not mask & _Z and not -_ROUNDING_M <= height_m <= fence.max_height_m + _ROUNDING_M:
        return f"{height_m:.1f} m high"
    return None
