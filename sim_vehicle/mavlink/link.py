"""One MAVLink connection: packets, streams, texts, services. The links of a vehicle know nothing of each other."""

from collections.abc import Callable, Iterable, Sequence

from pymavlink.dialects.v20 import development as dialect

from sim_vehicle.autopilot.messages import EVERY_ID, CommandAck, StatusText
from sim_vehicle.mavlink import encode
from sim_vehicle.mavlink.decode import Decoder, ForeignPacket
from sim_vehicle.mavlink.encode import Encoder, Message
from sim_vehicle.mavlink.services.command_service import CommandService
from sim_vehicle.mavlink.services.file_service import FileService
from sim_vehicle.mavlink.services.mission_service import MissionService
from sim_vehicle.mavlink.services.mission_transfer import MissionTransfer
from sim_vehicle.mavlink.services.parameter_service import ParameterService
from sim_vehicle.mavlink.services.service import Board, Channel, Handler, Service
from sim_vehicle.mavlink.services.setpoint_service import SetpointService
from sim_vehicle.mavlink.services.texts import TextLink
from sim_vehicle.mavlink.signing import OPTIONAL
from sim_vehicle.mavlink.streams.stream_rates import LinkKind
from sim_vehicle.mavlink.streams.streams import HEARTBEAT_ID, Streams

# What every link offers, a line a protocol, in the order in which they are brought up to date in an interval.
SERVICES: tuple[Callable[[Channel, Board], Service], ...] = (
    CommandService,
    SetpointService,
    ParameterService,
    MissionService,
    MissionTransfer,
    FileService,
)


class Link:
    """Bytes in, packets out. ``number`` tells the links of a vehicle apart in signatures."""

    def __init__(self, kind: LinkKind, board: Board, number: int, seed: int) -> None:
        self.kind = kind
        self._number = number
        self._waiting = b""
        self.now_us = board.telemetry.sample.time_boot_us
        self._board = board
        self._signing = board.signing.of_link()
        self._encoder = Encoder(board.identity)
        self.streams = Streams(board.telemetry, board.topics, self._encoder, self.kind, seed)
        self._texts = TextLink()
        self._services = tuple(service(self, board) for service in SERVICES)
        self.handlers: dict[int, Handler] = {
            HEARTBEAT_ID: self._hear_heartbeat,
            4: self._answer_ping,
            111: self._answer_timesync,
        }
        for service in self._services:
            self.handlers.update(service.handlers)
        self._decoder = Decoder(board.identity, self.handlers, self._signing)

    def introduce(self) -> None:
        """Send HEARTBEAT now, and not only when its first second is over."""
        self.streams.send_now(HEARTBEAT_ID)

    def push(self, data: bytes) -> None:
        """Bytes have arrived; they are read at the vehicle's next step."""
        self._waiting = self._waiting + data if self._waiting else data

    def take(self) -> tuple[bytes, ...]:
        """The packets to send, in order."""
        return self._encoder.take()

    # --- what services need ------------------------------------------------------------------------------

    def send(self, message: Message) -> None:
        """Send something that is no stream."""
        self._encoder.send(message)

    # --- what the vehicle's step calls, in this order ----------------------------------------------------

    def acknowledge(self, acks: Sequence[CommandAck]) -> None:
        """The commander's answers go where whoever asked has been heard."""
        for ack in acks:
            if (ack.target_system, ack.target_component) in self._decoder.sources:
                self.send(encode.command_ack(ack))

    def receive(self) -> list[ForeignPacket]:
        """Act on the packets that the waiting bytes complete; return those for others."""
        if not self._waiting:
            return []
        data, self._waiting = self._waiting, b""
        decoder, parameters = self._decoder, self._board.autopilot.parameters
        decoder.signing_is_optional = parameters["MAV_SIGN_CFG"] == OPTIONAL
        for packet in decoder.push(data):
            self.handlers[packet.get_msgId()](packet)
        return decoder.foreign

    def forward(self, packets: Iterable[ForeignPacket]) -> None:
        """Pass on what came over other links, if somebody here may want it."""
        for packet in packets:
            if self._has_heard(packet.target_system, packet.target_component):
                self._encoder.forward(packet.raw)

    def update(self, now_us: int, texts: Sequence[StatusText]) -> None:
        """Send what is due at the end of the interval."""
        self.now_us = now_us
        if self._signing.key is not None:
            self._encoder.sign(self._signing.key, self._number, self._signing.next_stamp)
        for text in texts:
            self._texts.add(text, now_us)
        for message in self._texts.due(now_us):
            self.send(message)
        for service in self._services:
            service.update(now_us)
        self.streams.update()

    def close(self) -> None:
        """Whoever was at the other end has gone."""
        for service in self._services:
            service.close()

    def _has_heard(self, system: int, component: int) -> bool:
        sources = self._decoder.sources
        if system == EVERY_ID:
            return bool(sources)
        return any(source[0] == system and component in (EVERY_ID, source[1]) for source in sources)

    # --- what concerns the link alone --------------------------------------------------------------------

    def _hear_heartbeat(self, packet: dialect.MAVLink_heartbeat_message) -> None:
        if packet.type == dialect.MAV_TYPE_GCS:
            self._texts.heard_us = self.now_us
            self._board.autopilot.ground_station_heard()

    def _answer_ping(self, packet: dialect.MAVLink_ping_message) -> None:
        """One to everybody is sent back."""
        if (packet.target_system, packet.target_component) == (EVERY_ID, EVERY_ID):
            asker = (packet.get_srcSystem(), packet.get_srcComponent())
            self.send(dialect.MAVLink_ping_message(packet.time_usec, packet.seq, *asker))

    def _answer_timesync(self, packet: dialect.MAVLink_timesync_message) -> None:
        """The vehicle's clock, for a request; an answer, to the vehicle's own, has a time in tc1."""
        if packet.tc1 == 0:
            # Bytes arrive anywhere in the interval since the last sample: on average in its middle.
            heard_at_us = self.now_us + self._board.interval_us // 2
            self.send(dialect.MAVLink_timesync_message(heard_at_us * 1000, packet.ts1))
