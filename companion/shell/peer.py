"""Who may speak on a UDP port that anybody can send to: the vehicle's address, pinned by its heartbeat.

    open    packets from anybody; answers go to whoever sent the last whole packet
    pinned  a heartbeat of an autopilot has come: its address alone is heard and answered
    open    again, when the pinned address has been silent for RELEASED_US: a router was restarted, an address changed

An address can be forged where the network lets it be; what keeps such packets out is MAVLink's signing.
"""

from collections.abc import Iterator
from typing import TypeAlias

from companion.link.identity import AUTOPILOT_COMPONENT_ID
from companion.mavlink.decode import checksum_holds
from companion.mavlink.packet import message_id_of, packet_length, source_of

Address: TypeAlias = tuple[str, int]

# A vehicle's heartbeat comes once a second, its streams far more often: two missed heartbeats and a half.
RELEASED_US = 2_500_000
HEARTBEAT = 0


class Peer:
    """Changed by `accepts` alone; times in microseconds, any epoch.

    `only` is the host, or the host and port, that the person named: nobody else is heard, pinned or not.
    """

    def __init__(self, only: tuple[str, int | None] | None = None) -> None:
        self._only = only
        self._pinned: Address | None = None
        self._last_us = 0
        self._told: set[Address] = set()
        self._news: str | None = None
        self.answered: Address | None = None
        self.dropped = 0

    def accepts(self, datagram: bytes, sender: Address, now_us: int) -> bool:
        """Whether the datagram is to be heard."""
        if not self._may_speak(sender, now_us):
            self.dropped += 1
            self._note(sender)
            return False
        if sender == self._pinned:
            self._last_us = now_us
            return True
        for packet in _packets(datagram):
            self.answered = sender
            if message_id_of(packet) == HEARTBEAT and source_of(packet)[1] == AUTOPILOT_COMPONENT_ID:
                self._pinned, self._last_us = sender, now_us
        return True

    def news(self) -> str | None:
        """A stranger that has just been turned away for the first time."""
        news, self._news = self._news, None
        return news

    def _may_speak(self, sender: Address, now_us: int) -> bool:
        if self._only is not None and (sender[0] != self._only[0] or self._only[1] not in (None, sender[1])):
            return False
        is_released = self._pinned is None or now_us - self._last_us > RELEASED_US
        return is_released or sender == self._pinned

    def _note(self, sender: Address) -> None:
        # An attacker has sixty thousand ports; the first few tell all there is to tell.
        if sender not in self._told and len(self._told) < 3:
            self._told.add(sender)
            self._news = f"{sender[0]}:{sender[1]} sends to this port, too; it is not listened to"


def _packets(datagram: bytes) -> Iterator[bytes]:
    """The whole packets that a datagram begins with, their checksums right."""
    start = 0
    while start < len(datagram):
        length = packet_length(datagram, start)
        if length == 0 or start + length > len(datagram) or not checksum_holds(datagram, start, length):
            return
        yield datagram[start : start + length]
        start += length
