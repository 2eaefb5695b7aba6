"""The messages that are sent dozens of times a second, from their fields straight to packets.

Their fields and their layout are pymavlink's; left out are its objects for message, header and checksum, which take
most of the time. Signed packets and those of MAVLink 1 are pymavlink's whole.
"""

import struct
from typing import Any

from fastcrc.crc16 import mcrf4xx
from pymavlink.dialects.v20 import development as dialect

# Length, two flag bytes, sequence, system, component, message id in three bytes; the magic byte comes before.
_HEADER = struct.Struct("<BBBBBBHB")
_MAGIC = b"\xfd"


class Packed:
    """A message whose fields are bytes already; `Encoder.packet` takes it like one of pymavlink's."""

    __slots__ = ("_kind", "_payload")

    def __init__(self, kind: "Kind", payload: bytes) -> None:
        self._kind = kind
        self._payload = payload

    def get_msgId(self) -> int:  # noqa: N802  # pymavlink's name for it
        """The number of the message's kind."""
        return self._kind.number

    def pack(self, mav: Any, force_mavlink1: bool = False) -> bytes:
        """The packet, with the sequence number that is next on ``mav``, the link."""
        kind, payload = self._kind, self._payload
        if force_mavlink1 or mav.signing.sign_outgoing:
            message = dialect.MAVLink_message(kind.number, kind.name)
            packet: bytes = message._pack(mav, kind.crc_extra[0], payload, force_mavlink1)
            return packet
        # Zeros at the end of a payload are left out, but for its first byte.
        sent = payload.rstrip(b"\0") or payload[:1]
        number = kind.number
        header = _HEADER.pack(len(sent), 0, 0, mav.seq, mav.srcSystem, mav.srcComponent, number & 0xFFFF, number >> 16)
        framed = header + sent
        checksum: int = mcrf4xx(framed + kind.crc_extra)
        return _MAGIC + framed + checksum.to_bytes(2, "little")


class Kind:
    """One kind of message; called with its fields in the order of the wire, arrays written out, it makes one."""

    __slots__ = ("_pack", "crc_extra", "name", "number")

    def __init__(self, message: Any) -> None:
        self.number: int = message.id
        self.name: str = message.msgname
        self.crc_extra = bytes((message.crc_extra,))
        self._pack = message.unpacker.pack

    def __call__(self, *values: float) -> Packed:
        return Packed(self, self._pack(*values))


HIGHRES_IMU = Kind(dialect.MAVLink_highres_imu_message)
ATTITUDE = Kind(dialect.MAVLink_attitude_message)
ATTITUDE_QUATERNION = Kind(dialect.MAVLink_attitude_quaternion_message)
ATTITUDE_TARGET = Kind(dialect.MAVLink_attitude_target_message)
LOCAL_POSITION_NED = Kind(dialect.MAVLink_local_position_ned_message)
GLOBAL_POSITION_INT = Kind(dialect.MAVLink_global_position_int_message)
ODOMETRY = Kind(dialect.MAVLink_odometry_message)
