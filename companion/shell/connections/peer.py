"""Who may speak on a UDP port that anybody can send to: the vehicle's address, pinned by its heartbeat.

    open      packets from anybody; answers go to whoever sent the last whole packet
    pinned    a heartbeat of an autopilot has come: its address alone is heard and answered
    moved     a heartbeat of the same system and component has come from another address, as when a router was
              restarted: that one is pinned, and nobody else is heard, once the old one has been silent for RELEASED_US.
              A heartbeat from the old one takes it back: it was a gap, and who filled it was another

An address can be forged where the network lets it be; what keeps such packets out is MAVLink's signing. With it only
genuine packets pin, hold and move an address. Before, whoever has the key is answered, even with an old time stamp:
the vehicle learns the time from what it is sent.
"""

from collections import deque
from collections.abc import Iterator
from dataclasses import dataclass
from itertools import islice
from typing import TypeAlias

from companion.autopilot.known import defaults
from companion.link.vehicle import AUTOPILOT_COMPONENT_ID
from companion.mavlink.packet import KNOWN_IDS, checksum_holds, message_id_of, source_of, whole_packets
from companion.mavlink.signing import Signing
from companion.messages import MessageId

Address: TypeAlias = tuple[str, int]

# Half of the time for which the last setpoint is flown on, for the silence: a vehicle that has moved is answered within
# the other half, and streams that fly one come twenty times as often.
RELEASED_US = defaults.LOSS_US // 2
# As often it is looked at whether what the pinned address sends is the vehicle's, which costs a checksum: its silence
# is known to a tenth.
LOOKED_AT_US = RELEASED_US // 10


@dataclass(slots=True)
class LinkCounts:
    """What summary.json says of a connection, under these names."""

    reconnects: int = 0
    stranger_datagrams: int = 0


class Peer:
    """Changed by `accepts` alone; times in microseconds, any epoch.

    A vehicle that came back from another address counts as reconnected. `only` is the host, or the host and port, that
    the person named: nobody else is heard, pinned or not.
    """

    def __init__(self, only: tuple[str, int | None] | None = None, signing: Signing | None = None) -> None:
        """Without `signing` all packets are genuine."""
        self._only, self._signing = only, signing
        self._pinned: Address | None = None
        self._moved: Address | None = None  # sent the vehicle's heartbeat since the pinned one last spoke
        self._before: Address | None = None  # pinned until the last move
        self._vehicle: tuple[int, int] | None = None  # system and component
        self._last_us = 0
        self._told: set[Address] = set()
        self.news = deque[str]()  # a stranger that was turned away for the first time, and where the vehicle has gone
        self.answered: Address | None = None
        self.counts = LinkCounts()

    def accepts(self, datagram: bytes, sender: Address, now_us: int) -> bool:
        if self._is_heard(datagram, sender, now_us):
            return True
        self.counts.stranger_datagrams += 1
        # An attacker has sixty thousand ports; the first few tell all there is to tell.
        if sender not in self._told and len(self._told) < 3:
            self._told.add(sender)
            self.news.append(f"{sender[0]}:{sender[1]} sends to this port, too; it is not listened to")
        return False

    def _is_heard(self, datagram: bytes, sender: Address, now_us: int) -> bool:
        if self._only is not None and (sender[0] != self._only[0] or self._only[1] not in (None, sender[1])):
            return False
        if sender == self._pinned:
            is_due = self._moved is not None or now_us - self._last_us >= LOOKED_AT_US
            if is_due and any(map(self._is_genuine, _packets(datagram))):
                self._last_us, self._moved = now_us, None
            return True
        is_released = self._pinned is None or now_us - self._last_us > RELEASED_US or sender == self._before
        # Of a flood beside a vehicle that is heard the first packet is enough to look at.
        for packet in islice(_packets(datagram), None if is_released else 1):
            source = source_of(packet)
            if self._vehicle is None and (self._signing is None or self._signing.is_signed(packet)):
                self.answered = sender
            is_vehicle = source[1] == AUTOPILOT_COMPONENT_ID and self._vehicle in (None, source)
            if message_id_of(packet) == MessageId.HEARTBEAT and is_vehicle and self._is_genuine(packet):
                self._vehicle, self._moved = source, sender
        if is_released and sender == self._moved:
            self._pin(sender, now_us)
        return self._vehicle is None or sender == self._pinned

    def _is_genuine(self, packet: bytes) -> bool:
        return self._signing is None or self._signing.refusal(packet) is None

    def _pin(self, sender: Address, now_us: int) -> None:
        if self._pinned is not None:
            self.counts.reconnects += 1
            self.news.append(f"the vehicle now sends from {sender[0]}:{sender[1]}, and answers go there")
        self._before = None if sender == self._before else self._pinned
        self._pinned = self.answered = sender
        self._last_us, self._moved = now_us, None


def _packets(datagram: bytes) -> Iterator[bytes]:
    """The packets of known messages in a datagram, up to one whose checksum is wrong."""
    for packet in whole_packets(datagram):
        if not checksum_holds(packet, 0, len(packet)):
            return
        if message_id_of(packet) in KNOWN_IDS:
            yield packet
