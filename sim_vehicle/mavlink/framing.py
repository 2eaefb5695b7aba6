"""The messages that are sent dozens of times a second, framed without pymavlink's header and checksum objects.

Their fields and their layout are pymavlink's; only the frame of an unsigned MAVLink 2 packet is made here.
"""

import struct
from typing import Any

from fastcrc.crc16 import mcrf4xx
from pymavlink.dialects.v20 import development as dialect

# Length, two flag bytes, sequence, system, component, message id in three bytes; the magic byte comes before.
_HEADER = struct.Struct("<BBBBBBHB")
_MAGIC = b"\xfd"


class _Framed:
    """Takes the place of pymavlink's `_pack` before a message class of its."""

    _header: Any

    def _pack(self, mav: Any, crc_extra: int, payload: bytes, force_mavlink1: bool = False) -> bytes:
        if force_mavlink1 or mav.signing.sign_outgoing:
            packet: bytes = super()._pack(mav, crc_extra, payload, force_mavlink1)  # type: ignore[misc]
            return packet
        # Zeros at the end of a payload are left out, but for its first byte.
        sent = payload.rstrip(b"\0") or payload[:1]
        number = self._header.msgId
        header = _HEADER.pack(len(sent), 0, 0, mav.seq, mav.srcSystem, mav.srcComponent, number & 0xFFFF, number >> 16)
        framed = header + sent
        checksum: int = mcrf4xx(framed + bytes((crc_extra,)))
        return _MAGIC + framed + checksum.to_bytes(2, "little")


class HighresImu(_Framed, dialect.MAVLink_highres_imu_message):  # type: ignore[misc]
    pass


class Attitude(_Framed, dialect.MAVLink_attitude_message):  # type: ignore[misc]
    pass


class AttitudeQuaternion(_Framed, dialect.MAVLink_attitude_quaternion_message):  # type: ignore[misc]
    pass


class AttitudeTarget(_Framed, dialect.MAVLink_attitude_target_message):  # type: ignore[misc]
    pass


class LocalPositionNed(_Framed, dialect.MAVLink_local_position_ned_message):  # type: ignore[misc]
    pass


class GlobalPositionInt(_Framed, dialect.MAVLink_global_position_int_message):  # type: ignore[misc]
    pass


class Odometry(_Framed, dialect.MAVLink_odometry_message):  # type: ignore[misc]
    pass
