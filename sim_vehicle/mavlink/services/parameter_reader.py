"""The parameter protocol's messages, read from bytes."""

import struct
from collections.abc import Callable
from dataclasses import dataclass

from pymavlink.dialects.v20 import development as dialect

_FLOAT, _WHOLE = struct.Struct("<f"), struct.Struct("<i")
# PARAM_SET's value comes first after the header, of MAVLink 2 and 1.
_MARKER_V2, _HEADER_V2, _HEADER_V1 = 0xFD, 10, 6


@dataclass(frozen=True, slots=True)
class ParameterList:
    """PARAM_REQUEST_LIST."""

    target_system: int


@dataclass(frozen=True, slots=True)
class ParameterRead:
    """PARAM_REQUEST_READ; a negative index stands for none: the name counts."""

    target_system: int
    name: str
    index: int


@dataclass(frozen=True, slots=True)
class ParameterSet:
    """PARAM_SET: the four bytes of its value mean a float or a whole number, as `is_whole` says."""

    target_system: int
    name: str
    value: float
    is_whole: bool | None
    """None for a type that PX4 has not."""


def _list(packet: dialect.MAVLink_param_request_list_message) -> ParameterList:
    return ParameterList(packet.target_system)


def _read(packet: dialect.MAVLink_param_request_read_message) -> ParameterRead:
    return ParameterRead(packet.target_system, packet.param_id, packet.param_index)


def _set(packet: dialect.MAVLink_param_set_message) -> ParameterSet:
    # From the bytes: as a Python float some whole numbers would come back changed (signalling NaNs).
    raw = packet.get_msgbuf()
    begin = _HEADER_V2 if raw[0] == _MARKER_V2 else _HEADER_V1
    is_whole = _IS_WHOLE.get(packet.param_type)
    value = (_WHOLE if is_whole else _FLOAT).unpack_from(raw, begin)[0]
    return ParameterSet(packet.target_system, packet.param_id, value, is_whole)


_IS_WHOLE = {dialect.MAV_PARAM_TYPE_INT32: True, dialect.MAV_PARAM_TYPE_REAL32: False}

READERS: dict[int, Callable[[dialect.MAVLink_message], object | None]] = {20: _read, 21: _list, 23: _set}
