"""What a MAVLink packet's header says, version 1 and 2 (mavlink.io, "Serialization"), without its dialect."""

from collections.abc import Iterator

MAGIC_V1, MAGIC_V2 = 0xFE, 0xFD
HEADER_V1, HEADER_V2, CHECKSUM, SIGNATURE = 6, 10, 2, 13
FLAG_SIGNED = 0x01


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
