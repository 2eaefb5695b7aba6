"""Message signing: one key for all links, packets of the vehicle signed, others' packets accepted only if they are.

Source: MAVLink 2's message signing and PX4's mavlink/mavlink_sign_control.cpp. Unlike PX4 this vehicle has no USB
port, so it takes SETUP_SIGNING on any link.
"""

import hashlib
import hmac
from dataclasses import dataclass, field

# MAV_SIGN_CFG: whether unsigned packets are accepted although there is a key.
SIGNING_OPTIONAL = 0
# Accepted unsigned in any case: RADIO_STATUS, ADSB_VEHICLE, COLLISION.
ALWAYS_ACCEPTED = frozenset({109, 246, 247})
SETUP_SIGNING_ID = 256

# Time stamps count ten microseconds since the first of January 2015; a new stream may be a minute behind.
_UNIX_AT_2015_US = 1_420_070_400_000_000
_MAY_LAG = 60 * 100_000
# No link sends more in one interval.
_MOST_PACKETS = 1000
# Link number, time stamp and signature at the end of a packet.
_BLOCK, _STAMP, _SIGNATURE = 13, slice(-12, -6), 6


@dataclass(slots=True)
class Refused:
    """How many packets were turned down, and why."""

    unsigned: int = 0
    wrong: int = 0
    """Their signature was made with another key, or for another packet."""
    replayed: int = 0
    """Their time stamp is not newer than one that was already accepted, or more than a minute old."""


@dataclass(slots=True)
class Signing:
    """The key and what was accepted with it; nothing is signed or asked for while there is no key."""

    key: bytes | None = None
    refused: Refused = field(default_factory=Refused)
    _newest: int = 0
    _streams: dict[tuple[int, int, int], int] = field(default_factory=dict)

    def set_up(self, key: bytes, time_stamp: int) -> None:
        """SETUP_SIGNING: a key of zeros with a time of zero ends signing."""
        self.key = key if any(key) or time_stamp else None
        self._newest = time_stamp
        self._streams.clear()

    def next_stamps(self, unix_us: int) -> int:
        """The first time stamp for the packets of one interval of one link: later than all before.

        By the clock where that is ahead of all that was heard.
        """
        self._newest = max(self._newest + _MOST_PACKETS, (unix_us - _UNIX_AT_2015_US) // 10)
        return self._newest

    def accepts(self, packet: bytes, is_signed: bool, source: tuple[int, int], message_id: int, optional: bool) -> bool:
        """Whether the packet may be read; those that may not are counted."""
        if self.key is None:
            return True
        allowed = optional or message_id in ALWAYS_ACCEPTED
        if not is_signed:
            self.refused.unsigned += not allowed
            return allowed
        return self._is_genuine(self.key, packet, source) or allowed

    def _is_genuine(self, key: bytes, packet: bytes, source: tuple[int, int]) -> bool:
        # Signature first: a forged packet must not move the time stamp on for the genuine ones.
        expected = hashlib.sha256(key + packet[:-_SIGNATURE]).digest()[:_SIGNATURE]
        if not hmac.compare_digest(expected, packet[-_SIGNATURE:]):
            self.refused.wrong += 1
            return False
        stamp = int.from_bytes(packet[_STAMP], "little")
        stream = (packet[-_BLOCK], *source)
        newest = self._streams.get(stream)
        if stamp <= newest if newest is not None else stamp + _MAY_LAG < self._newest:
            self.refused.replayed += 1
            return False
        self._streams[stream] = stamp
        self._newest = max(self._newest, stamp)
        return True
