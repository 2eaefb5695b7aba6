"""Between fields and packets without pymavlink's own parser and framing, which take most of the time.

Fields and layout are pymavlink's. The messages that are sent dozens of times a second go from their fields straight to
a payload, and `encode.Encoder` makes the packet; whatever arrives is read here.
"""

import struct
from collections.abc import Callable
from functools import cache
from operator import attrgetter, itemgetter
from typing import Any

from fastcrc.crc16 import mcrf4xx
from pymavlink.dialects.v20 import development as dialect

MAGIC = b"\xfd"
# Length, two bytes of flags, sequence, system, component; the magic byte comes before, the message's number after.
HEADER = struct.Struct("<BHBBB")


class Layout:
    """One message: `pack` takes its fields in the order of the wire, arrays written out."""

    __slots__ = ("checked", "name", "number", "number_bytes", "pack")

    def __init__(self, of: Any) -> None:
        """``of``: pymavlink's class of the same message."""
        self.number, self.name, self.pack = int(of.id), str(of.msgname), of.unpacker.pack
        self.number_bytes = self.number.to_bytes(3, "little")
        self.checked = bytes((of.crc_extra,))
        """What the checksum counts beside the packet: CRC_EXTRA."""


HIGHRES_IMU = Layout(dialect.MAVLink_highres_imu_message)
ATTITUDE = Layout(dialect.MAVLink_attitude_message)
ATTITUDE_QUATERNION = Layout(dialect.MAVLink_attitude_quaternion_message)
ATTITUDE_TARGET = Layout(dialect.MAVLink_attitude_target_message)
LOCAL_POSITION_NED = Layout(dialect.MAVLink_local_position_ned_message)
GLOBAL_POSITION_INT = Layout(dialect.MAVLink_global_position_int_message)
ODOMETRY = Layout(dialect.MAVLink_odometry_message)
HIL_SENSOR = Layout(dialect.MAVLink_hil_sensor_message)


@cache
def flattened(kind: Any) -> tuple[Layout, Callable[[Any], tuple[Any, ...]]] | None:
    """How a message of pymavlink's becomes its payload; None for texts, arrays and a single field."""
    names = kind.ordered_fieldnames
    if len(names) == 1 or "char" in kind.fieldtypes or any(kind.array_lengths):
        return None
    return Layout(kind), attrgetter(*names)


def read(packet: bytes) -> Any:
    """A packet of the right length as pymavlink's message of its kind; None where the checksum is wrong, or cannot be
    judged: the dialect does not have the message.
    """
    if packet[0] == MAGIC[0]:
        start, number, source = 10, packet[7] | packet[8] << 8 | packet[9] << 16, packet[5:7]
    else:
        start, number, source = 6, packet[5], packet[3:5]
    kind = dialect.mavlink_map.get(number)
    if kind is None:
        return None
    end = start + packet[1]
    checksum: int = mcrf4xx(packet[1:end] + bytes((kind.crc_extra,)))
    if checksum != packet[end] | packet[end + 1] << 8:
        return None
    unpacker = kind.unpacker
    # Zeros at the end of a payload are left out; fields that a newer dialect has put there are passed over.
    values = unpacker.unpack(packet[start:end].ljust(unpacker.size, b"\0")[: unpacker.size])
    message = kind(*_arranged(kind)(values))
    message._msgbuf, header = packet, message._header
    header.srcSystem, header.srcComponent = source
    return message


@cache
def _arranged(kind: Any) -> Any:
    """From the values in the order of the wire to the fields in that of the definition, arrays as one."""
    places: dict[str, int | slice] = {}
    count = 0
    for name, length in zip(kind.ordered_fieldnames, kind.lengths, strict=True):
        places[name] = count if length == 1 else slice(count, count + length)
        count += length
    ordered = [places[name] for name in kind.fieldnames]
    return itemgetter(*ordered) if len(ordered) > 1 else lambda values: (values[ordered[0]],)
