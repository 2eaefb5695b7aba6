"""Packets as somebody on the wire reads, changes and forges them."""

from collections.abc import Callable
from typing import Any

from pymavlink.dialects.v20 import development as dialect

from companion.mavlink.packet import message_id_of, payload_of

HEARTBEAT, ATTITUDE, POSITION, COMMAND_ACK = 0, 31, 32, 77
IMU, EXTENDED_STATE, ODOMETRY, MODE = 105, 245, 331, 436
COMMAND, SETPOINT = 76, 84
ARM, SET_MODE = 400, 176
# Which of two messages of the same kind is whose.
VEHICLE, GROUND_STATION = (1, 1), (255, 190)

_link = dialect.MAVLink(None)


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
    return packed_by(message)


def packed_by(message: Any) -> bytes:
    """The message as its own sender would send it, of the same number."""
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
