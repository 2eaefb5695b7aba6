"""Message signing: packets of the vehicle signed, others' packets accepted only if they are.

Source: MAVLink 2's message signing and PX4's mavlink/mavlink_sign_control.cpp. Two ways to be given a key:

    any link   SETUP_SIGNING on every link gives all of them the key at once; time stamps follow the vehicle's clock
    PX4 1.17   SETUP_SIGNING over USB alone, and the other links read it from the SD card when the vehicle starts; each
               link has a time stamp of its own, which begins at the card's and goes on with what is sent and heard
"""

import hashlib
import hmac
from dataclasses import dataclass, field

# MAV_SIGN_CFG: where unsigned packets are accepted although there is a key.
_OPTIONAL, _OPTIONAL_OVER_USB = 0, 1
# Accepted unsigned in any case: RADIO_STATUS, ADSB_VEHICLE, COLLISION.
ALWAYS_ACCEPTED = frozenset({109, 246, 247})
SETUP_SIGNING_ID = 256

# Time stamps count ten microseconds since the first of January 2015; a new stream may be a minute behind.
_UNIX_AT_2015_US = 1_420_070_400_000_000
_MAY_LAG = 60 * 100_000
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
    """The key and what was accepted with it; nothing is signed or asked for while there is no key.

    The vehicle's own; of PX4 1.17 it is what the SD card holds, and each link has its own besides.
    """

    key: bytes | None = None
    is_px4_1_17: bool = False
    refused: Refused = field(default_factory=Refused)
    _newest: int = 0
    _streams: dict[tuple[int, int, int], int] = field(default_factory=dict)
    _card: "Signing | None" = None

    def boot(self) -> None:
        """Before the links are; what PX4 1.17 has heard it has no memory of."""
        if self.is_px4_1_17:
            self._streams.clear()

    def of_link(self) -> "Signing":
        """For a link that is started now."""
        if not self.is_px4_1_17:
            return self
        return Signing(self.key, True, self.refused, self._newest, self._streams, self)

    def hear_setup(self, key: bytes, time_stamp: int, is_usb: bool) -> None:
        """SETUP_SIGNING has come over a link."""
        if self._card is None:
            self.set_up(key, time_stamp)
        elif is_usb:
            for each in (self, self._card):
                each.set_up(key, time_stamp)

    def set_up(self, key: bytes, time_stamp: int) -> None:
        """SETUP_SIGNING: a key of zeros with a time of zero ends signing."""
        self.key = key if any(key) or time_stamp else None
        self._newest = time_stamp
        self._streams.clear()

    def next_stamp(self, unix_us: int) -> int:
        """What the next packet of a link has at least: later than all that was heard, and by the clock if there is one.

        A link that has used it goes on after it by itself.
        """
        if not self.is_px4_1_17:
            self._newest = max(self._newest, (unix_us - _UNIX_AT_2015_US) // 10)
        return self._newest + 1

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


def is_optional(mav_sign_cfg: float, is_usb: bool) -> bool:
    """Whether unsigned packets are accepted on a link although there is a key."""
    return mav_sign_cfg == _OPTIONAL or (mav_sign_cfg == _OPTIONAL_OVER_USB and is_usb)
