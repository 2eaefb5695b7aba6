"""Packets that wait to be sent over one link, in order."""

from sim_vehicle.mavlink.encode import Encoder, Message
from sim_vehicle.mavlink.line import Buffer


class Outbox:
    """Messages in, packets out; what a full serial line cannot take is lost, as in a real transmit buffer."""

    def __init__(self, encoder: Encoder, buffer: Buffer) -> None:
        self._encoder = encoder
        self._buffer = buffer
        self._loses = not buffer.is_endless
        self._packets: list[bytes] = []

    def send(self, message: Message) -> None:
        """Make a packet of the message."""
        packet = self._encoder.packet(message)
        if packet is None or (self._loses and not self._buffer.take(len(packet))):
            return
        self._packets.append(packet)

    def forward(self, packet: bytes) -> None:
        """Send somebody else's packet as it is."""
        if self._buffer.take(len(packet)):
            self._packets.append(packet)

    def has_room(self, count: int) -> bool:
        """Whether so many bytes more would not be lost."""
        return self._buffer.has_room(count)

    def take(self) -> tuple[bytes, ...]:
        """All packets since the last call, in order."""
        packets = tuple(self._packets)
        self._packets.clear()
        return packets
