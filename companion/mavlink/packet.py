"""Where a MAVLink packet is, version 1 and 2 (mavlink.io, "Serialization"), and what its header says."""

from collections.abc import Iterator

from fastcrc.crc16 import mcrf4xx
from pymavlink.dialects.v20 import development as dialect

from companion.messages import MessageId

MAGIC_V1, MAGIC_V2 = 0xFE, 0xFD
HEADER_V1, HEADER_V2, CHECKSUM, SIGNATURE = 6, 10, 2, 13
FLAG_SIGNED = 0x01
# What the checksum counts beside the packet: CRC_EXTRA, by message id. Packets with other ids have one that cannot be
# checked.
_CRC_EXTRA = {number: bytes((message.crc_extra,)) for number, message in dialect.mavlink_map.items()}
_CRC_EXTRA[MessageId.EKF_STATUS_REPORT] = bytes((71,))  # ArduPilot's (see readers)
KNOWN_IDS = frozenset(_CRC_EXTRA)


class Stray(bytes):
    """Bytes in which no packet was found."""


def packet_length(data: bytes, start: int = 0) -> int:
    """Length of the packet that may begin at ``start``: 0 when none can, 1 over the end when not yet known."""
    magic = data[start]
    if magic == MAGIC_V2:
        if len(data) < start + 3:
            return len(data) - start + 1
        flags = data[start + 2]
        if flags & ~FLAG_SIGNED:
            return 0
        return HEADER_V2 + data[start + 1] + CHECKSUM + (SIGNATURE if flags else 0)
    if magic == MAGIC_V1:
        if len(data) < start + 2:
            return len(data) - start + 1
        return HEADER_V1 + data[start + 1] + CHECKSUM
    return 0


def whole_packets(data: bytes) -> Iterator[bytes]:
    """Those that bytes begin with."""
    start = 0
    while start < len(data):
        length = packet_length(data, start)
        if length == 0 or start + length > len(data):
            return
        yield data[start : start + length]
        start += length


def source_of(packet: bytes) -> tuple[int, int]:
    """System and component that sent a whole packet."""
    return (packet[5], packet[6]) if packet[0] == MAGIC_V2 else (packet[3], packet[4])


def sequence_of(packet: bytes) -> int:
    """The sender counts its packets in one byte."""
    return packet[4] if packet[0] == MAGIC_V2 else packet[2]


def has_signature(packet: bytes) -> bool:
    return packet[0] == MAGIC_V2 and packet[2] & FLAG_SIGNED != 0


def message_id_of(packet: bytes) -> int:
    return packet[7] | packet[8] << 8 | packet[9] << 16 if packet[0] == MAGIC_V2 else packet[5]


def payload_of(packet: bytes) -> bytes:
    """MAVLink 2 leaves out the zeros at its end."""
    start = HEADER_V2 if packet[0] == MAGIC_V2 else HEADER_V1
    return packet[start : start + packet[1]]


def checksum_holds(data: bytes, start: int, length: int) -> bool:
    """Whether the packet's own checksum holds; of a message that is not in the dialect, whether it ends where another
    packet begins.
    """
    packet, end = data[start : start + length], start + length
    crc_extra = _CRC_EXTRA.get(message_id_of(packet))
    if crc_extra is None:
        return end == len(data) or data[end] in (MAGIC_V1, MAGIC_V2)
    checked = (HEADER_V2 if packet[0] == MAGIC_V2 else HEADER_V1) + packet[1]
    checksum: int = mcrf4xx(packet[1:checked] + crc_extra)
    return packet[checked : checked + CHECKSUM] == checksum.to_bytes(CHECKSUM, "little")
