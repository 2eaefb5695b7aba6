"""One MAVLink connection: packets, streams, texts, services. The links of a vehicle know nothing of each other."""

from collections.abc import Sequence

from sim_vehicle.autopilot.messages import CommandAck, PeerHeartbeat, StatusText
from sim_vehicle.mavlink import encode
from sim_vehicle.mavlink.board import Board
from sim_vehicle.mavlink.decode import Decoder
from sim_vehicle.mavlink.encode import Encoder, Message
from sim_vehicle.mavlink.service import Handler
from sim_vehicle.mavlink.services import SERVICES
from sim_vehicle.mavlink.stream_rates import LinkKind
from sim_vehicle.mavlink.streams import Streams
from sim_vehicle.mavlink.texts import TextLink


class Link:
    """Bytes in, packets out."""

    def __init__(self, kind: LinkKind, board: Board, seed: int) -> None:
        self.kind = kind
        self.now_us = board.telemetry.sample.time_boot_us
        self._waiting = b""
        self._decoder = Decoder(board.identity)
        self.streams = Streams(board.telemetry, board.topics, Encoder(board.identity), kind, seed)
        self._texts = TextLink()
        self._services = tuple(service(self, board) for service in SERVICES)
        self._handlers: dict[type, Handler] = {PeerHeartbeat: self._hear_heartbeat}
        for service in self._services:
            self._handlers.update(service.handlers)

    def push(self, data: bytes) -> None:
        """Bytes have arrived; they are read at the vehicle's next step."""
        self._waiting = self._waiting + data if self._waiting else data

    def take(self) -> tuple[bytes, ...]:
        """The packets to send, in order."""
        return self.streams.take()

    # --- what services need ------------------------------------------------------------------------------

    def send(self, message: Message) -> None:
        """Send something that is no stream."""
        self.streams.send(message)

    def burst(self, fast: int, serial: int) -> int:
        """How many packets of a long answer may be sent in this interval: ``serial`` on a serial line."""
        return fast

    # --- what the vehicle's step calls, in this order ----------------------------------------------------

    def acknowledge(self, acks: Sequence[CommandAck]) -> None:
        """The commander's answers go where whoever asked has been heard."""
        for ack in acks:
            if (ack.target_system, ack.target_component) in self._decoder.sources:
                self.send(encode.command_ack(ack))

    def receive(self) -> None:
        """Act on the packets that the waiting bytes complete."""
        data, self._waiting = self._waiting, b""
        for message in self._decoder.push(data):
            self._handlers[type(message)](message)

    def update(self, now_us: int, texts: Sequence[StatusText]) -> None:
        """Send what is due at the end of the interval."""
        self.now_us = now_us
        for text in texts:
            self._texts.add(text, now_us)
        for message in self._texts.due(now_us):
            self.send(message)
        for service in self._services:
            service.update(now_us)
        self.streams.update()

    def _hear_heartbeat(self, heartbeat: PeerHeartbeat) -> None:
        self._texts.heard(heartbeat, self.now_us)
