"""Random packets: of every kind that there is, with senseless content."""

import random
from typing import Any

from pymavlink.dialects.v20 import development as dialect

KINDS = tuple(dialect.mavlink_map.values())
# What changes the vehicle when it is addressed to it. Everything else must leave it as it is.
OBEYED = frozenset({11, 20, 21, 23, 43, 44, 45, 47, 51, 69, 73, 75, 76, 82, 84, 144, 256})


def packet(kind: Any, payload: bytes, link: dialect.MAVLink, v1: bool = False) -> bytes:
    """A packet of ``kind`` whose checksum is right, whatever its payload."""
    message = kind.__new__(kind)
    dialect.MAVLink_message.__init__(message, kind.id, kind.msgname)
    raw: bytes = message._pack(link, kind.crc_extra, payload, force_mavlink1=v1 and kind.id < 256)
    link.seq = (link.seq + 1) % 256
    return raw


def random_payload(kind: type, chance: random.Random) -> bytes:
    """Noise, now and then with the special numbers of floats in it."""
    payload = bytearray(chance.randbytes(kind.unpacker.size))
    for _ in range(chance.randrange(3)):
        if len(payload) >= 4:
            at = 4 * chance.randrange(len(payload) // 4)
            payload[at : at + 4] = chance.choice((b"\0\0\xc0\x7f", b"\0\0\x80\x7f", b"\0\0\x80\xff", b"\0\0\0\0"))
    return bytes(payload)


def addressed_to(kind: type, payload: bytes, system: int, component: int) -> bytes:
    """The payload with these targets, where the message has any."""
    values = list(kind.unpacker.unpack(payload))
    for name, value in (("target_system", system), ("target_component", component), ("target", system)):
        if name in kind.fieldnames:
            # Fields before the targets may be arrays of several numbers each
            place = 0
            for field in kind.ordered_fieldnames:
                if field == name:
                    break
                index = kind.fieldnames.index(field)
                count = kind.array_lengths[kind.ordered_fieldnames.index(field)]
                place += count if count and kind.fieldtypes[index] != "char" else 1
            values[place] = value
    packed: bytes = kind.unpacker.pack(*values)
    return packed
