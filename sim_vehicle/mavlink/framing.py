"""The messages that are sent dozens of times a second, from their fields straight to packets.

Their fields and their layout are pymavlink's; left out are its objects for message, header and checksum, which take
most of the time. Signed packets and those of MAVLink 1 are pymavlink's whole.
"""

import struct
from collections.abc import Callable
from typing import Any, ClassVar

from fastcrc.crc16 import mcrf4xx
from pymavlink.dialects.v20 import development as dialect

# Length, two flag bytes, sequence, system, component, message id in three bytes; the magic byte comes before.
_HEADER = struct.Struct("<BBBBBBHB")
_MAGIC = b"\xfd"


class Packed:
    """A message as its payload alone; `Encoder.packet` takes it like one of pymavlink's.

    Made of the fields in the order of the wire, arrays written out.
    """

    __slots__ = ("_payload",)

    _number: ClassVar[int]
    _name: ClassVar[str]
    _crc_extra: ClassVar[bytes]
    _layout: ClassVar[Callable[..., bytes]]

    def __init_subclass__(cls, of: Any) -> None:
        """``of``: pymavlink's class of the same message."""
        cls._number, cls._name = of.id, of.msgname
        cls._crc_extra, cls._layout = bytes((of.crc_extra,)), of.unpacker.pack

    def __init__(self, *values: float) -> None:
        self._payload = self._layout(*values)

    def get_msgId(self) -> int:  # noqa: N802  # pymavlink's name for it
        """The message's number."""
        return self._number

    def pack(self, mav: Any, force_mavlink1: bool = False) -> bytes:
        """The packet, with the sequence number that is next on ``mav``, the link."""
        payload, number = self._payload, self._number
        if force_mavlink1 or mav.signing.sign_outgoing:
            message = dialect.MAVLink_message(number, self._name)
            packet: bytes = message._pack(mav, self._crc_extra[0], payload, force_mavlink1)
            return packet
        # Zeros at the end of a payload are left out, but for its first byte.
        sent = payload.rstrip(b"\0") or payload[:1]
        header = _HEADER.pack(len(sent), 0, 0, mav.seq, mav.srcSystem, mav.srcComponent, number & 0xFFFF, number >> 16)
        framed = header + sent
        checksum: int = mcrf4xx(framed + self._crc_extra)
        return _MAGIC + framed + checksum.to_bytes(2, "little")


class HighresImu(Packed, of=dialect.MAVLink_highres_imu_message):
    __slots__ = ()


class PackedAttitude(Packed, of=dialect.MAVLink_attitude_message):
    __slots__ = ()


class AttitudeQuaternion(Packed, of=dialect.MAVLink_attitude_quaternion_message):
    __slots__ = ()


class PackedAttitudeTarget(Packed, of=dialect.MAVLink_attitude_target_message):
    __slots__ = ()


class LocalPositionNed(Packed, of=dialect.MAVLink_local_position_ned_message):
    __slots__ = ()


class GlobalPositionInt(Packed, of=dialect.MAVLink_global_position_int_message):
    __slots__ = ()


class PackedOdometry(Packed, of=dialect.MAVLink_odometry_message):
    __slots__ = ()
