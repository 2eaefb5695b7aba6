"""Packets as names and fields in JSON, as MAVSDK hands messages over and takes them; NaN is null."""

import json
import math
import struct
from typing import Any

from pymavlink.dialects.v20 import development as dialect

from companion.mavlink.moves import REQUEST_IDS, SETPOINT_IDS
from companion.mavlink.readers import GUARD_READERS

# Of these a guard looks at something; all others cost nothing.
_LOOKED_AT = map(dialect.mavlink_map.__getitem__, {*GUARD_READERS, *SETPOINT_IDS, *REQUEST_IDS})
_KINDS = {kind.msgname: kind for kind in _LOOKED_AT}


def packet_from(name: str, source: tuple[int, int], fields_json: bytes) -> bytes:
    """Empty where a guard looks at nothing of it, or the fields are not of this dialect.

    An answer to a command is taken as one to ours: who asked is not told apart here.
    """
    kind = _KINDS.get(name)
    if kind is None:
        return b""
    try:
        fields = json.loads(fields_json)
        values = {field: _packed(fields[field]) for field in kind.fieldnames if field in fields}
        if name == "COMMAND_ACK":
            values["target_system"] = values["target_component"] = 0
        return bytes(kind(**values).pack(dialect.MAVLink(None, *source)))
    except (struct.error, OverflowError, TypeError, ValueError):
        return b""


def named(packet: bytes) -> tuple[str, str]:
    """Name and fields of one of the guard's own."""
    message = dialect.MAVLink(None).decode(bytearray(packet))
    fields = {field: getattr(message, field) for field in message.fieldnames}
    return message.get_type(), json.dumps({field: None if value != value else value for field, value in fields.items()})


def _packed(value: Any) -> Any:
    if isinstance(value, list):
        return [_packed(one) for one in value]
    return math.nan if value is None else value.encode() if isinstance(value, str) else value
