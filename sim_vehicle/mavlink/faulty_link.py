"""A link over a wire on which a mission asks for faults."""

from collections.abc import Sequence

from sim_vehicle.faults.spec import ClockJump, Fault, ImuDropout, WireFault
from sim_vehicle.faults.wire import Wire, split
from sim_vehicle.mavlink.decode import ForeignPacket
from sim_vehicle.mavlink.link import Link
from sim_vehicle.mavlink.restamp import Restamper, message_number
from sim_vehicle.mavlink.services.service import Board
from sim_vehicle.mavlink.streams.stream_rates import LinkKind

# HIGHRES_IMU, SCALED_IMU, RAW_IMU and the second and third sensor's SCALED_IMU2 and 3.
_INERTIAL = (105, 26, 27, 116, 129)
# So that the two directions do not share their luck.
_INBOUND_SEED = 0x1B


class FaultyLink(Link):
    """The same link; between it and whoever is at the other end lies the wire."""

    def __init__(self, kind: LinkKind, board: Board, number: int, seed: int, faults: Sequence[Fault]) -> None:
        super().__init__(kind, board, number, seed)
        self._outbound = Wire((), seed, message_number)
        self._inbound = Wire((), seed ^ _INBOUND_SEED, message_number)
        self._on_wire: list[tuple[Fault, Wire, WireFault]] = []
        self._jumps: list[ClockJump] = []
        self._restamper = Restamper()
        self._arriving = b""
        for fault in faults:
            self.add(fault)

    def add(self, fault: Fault) -> None:
        """One more fault; what is none of the wire changes nothing here."""
        for direction, wire in (("to_companion", self._outbound), ("to_vehicle", self._inbound)):
            wire_fault = _as_wire_fault(fault, direction)
            if wire_fault is not None:
                wire.add(wire_fault)
                self._on_wire.append((fault, wire, wire_fault))
        if isinstance(fault, ClockJump):
            self._jumps.append(fault)

    def remove(self, fault: Fault) -> None:
        """The very fault that was added is over; a clock that has jumped stays where it is."""
        for added, wire, wire_fault in self._on_wire:
            if added is fault:
                wire.remove(wire_fault)
        self._on_wire = [row for row in self._on_wire if row[0] is not fault]
        now_s = self._world_us / 1e6
        self._jumps = [jump for jump in self._jumps if jump is not fault or jump.window_s[0] < now_s]

    @property
    def _world_us(self) -> int:
        return self.now_us + self._board.booted_at_us

    def push(self, data: bytes) -> None:
        """Bytes have been sent; they arrive when the wire lets them."""
        self._arriving += data

    def receive(self, collects_foreign: bool = False) -> list[ForeignPacket]:
        """Act on what has arrived."""
        frames, self._arriving = split(self._arriving), b""
        super().push(b"".join(self._inbound.carry(frames, self._world_us)))
        return super().receive(collects_foreign)

    def take(self) -> tuple[bytes, ...]:
        """The packets that arrive at the other end now, in order."""
        packets = super().take()
        offset_us = round(1e6 * sum(jump.jump_s for jump in self._jumps if jump.window_s[0] <= self._world_us / 1e6))
        if offset_us:
            packets = tuple(self._restamper.restamp(packet, offset_us) for packet in packets)
        return self._outbound.carry(packets, self._world_us)


def needs_faulty_link(faults: Sequence[Fault]) -> bool:
    """Whether any of the faults is one of the wire."""
    return any(isinstance(fault, WireFault | ImuDropout | ClockJump) for fault in faults)


def _as_wire_fault(fault: Fault, direction: str) -> WireFault | None:
    """What a fault does to packets in one direction, if anything."""
    if isinstance(fault, WireFault) and fault.direction in (direction, "both"):
        return fault
    if isinstance(fault, ImuDropout) and direction == "to_companion":
        return WireFault(kind="wire", between_s=fault.window_s, loss=1.0, messages=_INERTIAL)
    return None
