"""A link over a wire on which a mission asks for faults, and the packets of a vehicle whose clock has jumped."""

from collections.abc import Sequence
from typing import Any

from pymavlink.dialects.v20 import development as dialect

from sim_vehicle.errors import FaultError
from sim_vehicle.faults.spec import ClockJump, Fault, ImuDropout, WireFault
from sim_vehicle.faults.wire import MAVLINK_2, SIGNED, Wire, packet_size, split
from sim_vehicle.mavlink import framing
from sim_vehicle.mavlink.decode import ForeignPacket
from sim_vehicle.mavlink.link import Link
from sim_vehicle.mavlink.services.service import Board
from sim_vehicle.mavlink.streams.stream_rates import LinkKind

# HIGHRES_IMU, SCALED_IMU, RAW_IMU and the second and third sensor's SCALED_IMU2 and 3.
_INERTIAL = (105, 26, 27, 116, 129)
# So that the two directions do not share their luck.
_INBOUND_SEED = 0x1B
# Times since boot, by field and its unit in microseconds.
_STAMPS_US = {"time_boot_ms": 1000, "time_usec": 1}
# The narrow ones wrap as the vehicle's own counters would; SERVO_OUTPUT_RAW counts microseconds in 32 bits.
_MASKS = {"uint32_t": 0xFFFFFFFF, "uint64_t": 0xFFFFFFFFFFFFFFFF}
# Of TIMESYNC's nanoseconds, 64 bits with a sign.
_SIGN = 1 << 63


class FaultyLink(Link):
    """The same link; between it and whoever is at the other end lies the wire."""

    def __init__(self, kind: LinkKind, board: Board, number: int, seed: int, faults: Sequence[Fault]) -> None:
        super().__init__(kind, board, number, seed)
        self._outbound = Wire((), seed)
        self._inbound = Wire((), seed ^ _INBOUND_SEED)
        self._on_wire: list[tuple[Fault, Wire, WireFault]] = []
        self._jumps: list[ClockJump] = []
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
        now_s = self.now_us / 1e6
        self._jumps = [jump for jump in self._jumps if jump is not fault or jump.window_s[0] < now_s]

    def receive(self) -> list[ForeignPacket]:
        """Act on what has arrived: bytes that were pushed do when the wire lets them."""
        self._waiting = b"".join(self._inbound.carry(split(self._waiting), self.now_us))
        return super().receive()

    def take(self) -> tuple[bytes, ...]:
        """The packets that arrive at the other end now, in order."""
        packets = super().take()
        offset_us = round(1e6 * sum(jump.jump_s for jump in self._jumps if jump.window_s[0] <= self.now_us / 1e6))
        if offset_us:
            us = bytes(self._board.identity)  # others' packets, which are passed on, keep their stamps
            packets = tuple(restamped(packet, offset_us) if packet[5:7] == us else packet for packet in packets)
        return self._outbound.carry(packets, self.now_us)


def needs_faulty_link(faults: Sequence[Fault]) -> bool:
    """Whether any of the faults is one of the wire."""
    return any(isinstance(fault, WireFault | ImuDropout | ClockJump) for fault in faults)


def _as_wire_fault(fault: Fault, direction: str) -> WireFault | None:
    """What a fault does to packets in one direction, if anything; its messages by number."""
    if isinstance(fault, WireFault) and fault.direction in (direction, "both"):
        return fault.model_copy(update={"messages": tuple(map(message_number, fault.messages))})
    if isinstance(fault, ImuDropout) and direction == "to_companion":
        return WireFault(kind="wire", between_s=fault.window_s, loss=1.0, messages=_INERTIAL)
    return None


def restamped(frame: bytes, offset_us: int) -> bytes:
    """The packet with every time stamp of the vehicle's clock moved; as it was if it has none, is signed or damaged."""
    if packet_size(frame, 0) != len(frame) or (frame[0] == MAVLINK_2 and frame[2] & SIGNED):
        return frame
    message = framing.read(frame)
    if message is None or not _move(message, offset_us):
        return frame
    link = dialect.MAVLink(None, message.get_srcSystem(), message.get_srcComponent())
    link.seq = frame[4] if frame[0] == MAVLINK_2 else frame[2]
    packed: bytes = message.pack(link, force_mavlink1=frame[0] != MAVLINK_2)
    return packed


def _move(message: Any, offset_us: int) -> bool:
    """Whether it has stamps to move."""
    name = message.get_type()
    if name == "PING" and message.target_system:
        # An answer carries the asker's time.
        return False
    stamps = [field for field in _STAMPS_US if hasattr(message, field)]
    for field in stamps:
        mask = _MASKS[message.fieldtypes[message.fieldnames.index(field)]]
        setattr(message, field, (getattr(message, field) + offset_us // _STAMPS_US[field]) & mask)
    if name == "TIMESYNC":
        # An answer has the vehicle's time in tc1, a request of its own in ts1.
        field = "tc1" if message.tc1 else "ts1"
        setattr(message, field, (getattr(message, field) + 1000 * offset_us + _SIGN) % (2 * _SIGN) - _SIGN)
    return bool(stamps) or name == "TIMESYNC"


def message_number(name: int | str) -> int:
    """The number of a message by its name or number; raises FaultError for a name that there is not."""
    if isinstance(name, int):
        return name
    number = getattr(dialect, f"MAVLINK_MSG_ID_{name.upper()}", None)
    if number is None:
        raise FaultError(f"no MAVLink message is called {name!r}.")
    return int(number)


def check_messages(fault: Fault) -> None:
    """Raise FaultError if a fault of the wire names a message that there is not."""
    for message in fault.messages if isinstance(fault, WireFault) else ():
        message_number(message)
