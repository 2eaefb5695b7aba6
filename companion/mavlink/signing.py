"""MAVLink 2's message signing: only packets signed with the key are heard, and all that is sent is signed.

Source: mavlink.io/en/guide/message_signing.html. Bytes and the Unix time in, bytes out. What passes has lost its
signature, so that whoever reads it, now or in a log, needs no key.
"""

import hashlib
import hmac

from fastcrc.crc16 import mcrf4xx
from pymavlink.dialects.v20 import development as dialect

from companion.link.refusals import Refusals
from companion.mavlink.decode import Decoder
from companion.mavlink.packet import (
    FLAG_SIGNED,
    HEADER_V2,
    MAGIC_V2,
    SIGNATURE,
    checksum_holds,
    has_signature,
    message_id_of,
    packet_length,
    source_of,
)

KEY_LENGTH = 32
# Time stamps count ten microseconds since the first of January 2015.
UNIX_AT_2015_US = 1_420_070_400_000_000
# So much may the first packet of a stream be behind, and so often at least is the time stamp to be kept.
MINUTE = 60 * 100_000
# Beyond it there is no time stamp: the year 2104.
LAST_STAMP = (1 << 48) - 1

# The signature's own part of the block at the end of a packet; before it one byte for the link, six for the stamp.
_HASH = 6
_LINK_ID = 0  # a companion has one link
# Radios and transponders cannot sign, so PX4 takes these as they are. Nothing here reads them: they are no news.
_FROM_RADIOS = frozenset(
    {dialect.MAVLINK_MSG_ID_RADIO_STATUS, dialect.MAVLINK_MSG_ID_ADSB_VEHICLE, dialect.MAVLINK_MSG_ID_COLLISION}
)

UNSIGNED, FORGED, REPLAYED, OLD = "unsigned", "forged", "replayed", "old"
_TEXTS = {
    UNSIGNED: "packets without a signature are refused",
    FORGED: "packets that were signed with another key, or changed, are refused",
    REPLAYED: "packets that were signed before ones already heard are refused",
    OLD: "packets that were signed more than a minute ago are refused",
}


def stamp_at(unix_us: int) -> int:
    """The time stamp of a moment; negative before 2015."""
    return (unix_us - UNIX_AT_2015_US) // 10


class Signing:
    """The key, and what was accepted and sent with it. Its text holds no key."""

    def __init__(self, key: bytes, stamp: int) -> None:
        """`stamp` is later than all that this key was used for before."""
        self._key = key
        self._framer = Decoder({}, self._is_packet)
        self._streams: dict[tuple[int, int, int], int] = {}  # newest stamp by link, system and component
        self._refusals = Refusals()
        self.refused = self._refusals.counts  # packets, by reason
        self._news: dict[str, str] = {}  # by reason
        self.stamp = stamp

    def news(self) -> str | None:
        """That packets have been refused for a while, once a run of them."""
        return self._news.pop(next(iter(self._news))) if self._news else None

    def opened(self, received: bytes, now_us: int) -> bytes:
        """The genuine packets that are complete by now, without their signatures, and no other byte."""
        self.stamp = max(self.stamp, stamp_at(now_us))
        genuine: list[bytes] = []
        for packet, _ in self._framer.feed(received):
            if packet_length(packet) != len(packet):
                continue
            reason = self.refusal(packet)
            if reason is None:
                stamp = self._streams[_stream(packet)] = _stamp(packet)
                self.stamp = max(self.stamp, stamp)
                genuine.append(_plain(packet))
            elif reason != UNSIGNED or message_id_of(packet) not in _FROM_RADIOS:
                self._count(reason, packet, now_us)
        return b"".join(genuine)

    def signed(self, packet: bytes, now_us: int) -> bytes:
        """An unsigned packet of MAVLink 2 with a signature that is later than all before."""
        self.stamp = min(max(self.stamp, stamp_at(now_us)) + 1, LAST_STAMP)
        content = _with_flags(packet, FLAG_SIGNED) + bytes((_LINK_ID,)) + self.stamp.to_bytes(6, "little")
        return content + self._hash(content)

    def _is_packet(self, data: bytes, start: int, length: int) -> bool:
        """Of a message that the dialect does not have the signature alone tells; without it, it may be stray bytes
        round genuine packets."""
        if not checksum_holds(data, start, length):
            return False
        packet = data[start : start + length]
        return message_id_of(packet) in dialect.mavlink_map or self.is_signed(packet)

    def is_signed(self, packet: bytes) -> bool:
        """Whether it was signed with the key, at whatever time."""
        return has_signature(packet) and hmac.compare_digest(self._hash(packet[:-_HASH]), packet[-_HASH:])

    def refusal(self, packet: bytes) -> str | None:
        """Why `opened` would not let it through, or None; nothing changes."""
        if not has_signature(packet):
            return UNSIGNED
        # Signature first: the stamp of a forged packet means nothing.
        if not self.is_signed(packet):
            return FORGED
        stamp, newest = _stamp(packet), self._streams.get(_stream(packet))
        if newest is None:
            return OLD if stamp + MINUTE < self.stamp else None
        return REPLAYED if stamp <= newest else None

    def _hash(self, content: bytes) -> bytes:
        """The specification's: a plain SHA-256, and no HMAC."""
        return hashlib.sha256(self._key + content).digest()[:_HASH]

    def _count(self, reason: str, packet: bytes, now_us: int) -> None:
        message_id, (system, component) = message_id_of(packet), source_of(packet)
        message = dialect.mavlink_map.get(message_id)
        last = f"{message.msgname if message else message_id} of system {system}, component {component}"
        if self._refusals.add(reason, now_us):
            self._news[reason] = f"{_TEXTS[reason]}: {self.refused[reason]} so far, the last {last}"


def _stamp(packet: bytes) -> int:
    return int.from_bytes(packet[1 - SIGNATURE : -_HASH], "little")


def _stream(packet: bytes) -> tuple[int, int, int]:
    return (packet[-SIGNATURE], *source_of(packet))


def _plain(packet: bytes) -> bytes:
    """Of a message that the dialect does not have, the checksum cannot be made anew: it keeps its signature."""
    return _with_flags(packet, 0) if message_id_of(packet) in dialect.mavlink_map else packet


def _with_flags(packet: bytes, flags: int) -> bytes:
    """The packet up to its checksum, with these incompatibility flags."""
    content = bytes((packet[1], flags)) + packet[3 : HEADER_V2 + packet[1]]
    crc_extra = dialect.mavlink_map[message_id_of(packet)].crc_extra
    checksum: int = mcrf4xx(content + bytes((crc_extra,)))
    return bytes((MAGIC_V2,)) + content + checksum.to_bytes(2, "little")
