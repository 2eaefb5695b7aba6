"""The layouts of the messages that are sent dozens of times a second: from their fields straight to a payload.

Fields and layout are pymavlink's; left out are its objects for message, header and checksum, which take most of the
time (see encode.Encoder).
"""

import struct
from typing import Any, TypeAlias

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


Packed: TypeAlias = tuple[Layout, bytes]
"""A message as its payload alone, zeros at its end included."""

HIGHRES_IMU = Layout(dialect.MAVLink_highres_imu_message)
ATTITUDE = Layout(dialect.MAVLink_attitude_message)
ATTITUDE_QUATERNION = Layout(dialect.MAVLink_attitude_quaternion_message)
ATTITUDE_TARGET = Layout(dialect.MAVLink_attitude_target_message)
LOCAL_POSITION_NED = Layout(dialect.MAVLink_local_position_ned_message)
GLOBAL_POSITION_INT = Layout(dialect.MAVLink_global_position_int_message)
ODOMETRY = Layout(dialect.MAVLink_odometry_message)
