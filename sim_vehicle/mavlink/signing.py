"""Message signing: packets of the vehicle signed, others' packets accepted only if they are.

Source: MAVLink 2's message signing and PX4 1.17's mavlink/mavlink_sign_control.cpp. The key is on the SD card when the
vehicle starts. Each link has a time stamp of its own, which begins at the card's and goes on with what is sent and
heard. SETUP_SIGNING is ignored: PX4 obeys it over USB alone, and no link here is USB.
"""

import hashlib
import hmac
from dataclasses import dataclass, field

# MAV_SIGN_CFG: unsigned packets are accepted although there is a key; with 1 over USB alone.
OPTIONAL = 0
# Accepted unsigned in any case: RADIO_STATUS, ADSB_VEHICLE, COLLISION.
ALWAYS_ACCEPTED = frozenset({109, 246, 247})

# Time stamps count ten microseconds; a new stream may be a minute behind.
_MAY_LAG = 60 * 100_000
# Link number, time stamp and signature at the end of a packet.
_BLOCK, _STAMP, _SIGNATURE = 13, slice(-12, -6), 6


@dataclass(slots=True)
class Signing:
    """The key and what was accepted with it; without a key nothing is signed or asked for.

    The vehicle's own is what the SD card holds; each link has its own besides.
    """

    key: bytes | None = None
    _streams: dict[tuple[int, int, int], int] = field(default_factory=dict)
    _newest: int = 0

    def of_link(self) -> "Signing":
        """For a link that is started now. What all links have heard counts for each."""
        return Signing(self.key, self._streams)

    @property
    def next_stamp(self) -> int:
        """What the next packet of a link has at least. A link that has used it goes on after it by itself."""
        return self._newest + 1

    def accepts(self, packet: bytes, is_signed: bool, source: tuple[int, int], message_id: int, optional: bool) -> bool:
        """Whether the packet may be read."""
        if self.key is None:
            return True
        allowed = optional or message_id in ALWAYS_ACCEPTED
        return (is_signed and self._is_genuine(self.key, packet, source)) or allowed

    def _is_genuine(self, key: bytes, packet: bytes, source: tuple[int, int]) -> bool:
        """Signed with the key, and newer than what was accepted of its stream; a new stream is at most a minute old."""
        # Signature first: a forged packet must not move the time stamp on for the genuine ones.
        expected = hashlib.sha256(key + packet[:-_SIGNATURE]).digest()[:_SIGNATURE]
        if not hmac.compare_digest(expected, packet[-_SIGNATURE:]):
            return False
        stamp = int.from_bytes(packet[_STAMP], "little")
        stream = (packet[-_BLOCK], *source)
        newest = self._streams.get(stream)
        if stamp <= newest if newest is not None else stamp + _MAY_LAG < self._newest:
            return False
        self._streams[stream] = stamp
        self._newest = max(self._newest, stamp)
        return True
