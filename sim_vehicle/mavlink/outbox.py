"""What a link is about to send."""

from sim_vehicle.mavlink.encode import Encoder, Message


class Outbox:
    """Messages in, packets out."""

    def __init__(self, encoder: Encoder) -> None:
        self._encoder = encoder
        self._packets: list[bytes] = []

    def send(self, message: Message) -> None:
        """Make a packet of the message."""
        self._packets.append(self._encoder.packet(message))

    def forward(self, packet: bytes) -> None:
        """Send a packet as it is, somebody else's."""
        self._packets.append(packet)

    def take(self) -> tuple[bytes, ...]:
        """All packets since the last call, in order."""
        packets = tuple(self._packets)
        self._packets.clear()
        return packets
