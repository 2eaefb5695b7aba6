"""Bytes to packets: whatever arrives, the step goes on."""

import re
from collections.abc import Container
from dataclasses import dataclass

from pymavlink.dialects.v20 import development as dialect

from sim_vehicle.autopilot.messages import EVERY_ID, Identity
from sim_vehicle.faults.wire import MAVLINK_2, SIGNED, packet_size
from sim_vehicle.mavlink import framing
from sim_vehicle.mavlink.signing import Signing

_MARKER = re.compile(rb"[\xfd\xfe]")

# Its target is a system, too, under another name.
_MANUAL_CONTROL_ID = 69
# PING, COMMAND_INT and COMMAND_LONG: commands may go to other components and still be answered, and who is pinged is
# the one thing that a PING says.
_READ_BY_ALL = (4, 75, 76)


@dataclass(frozen=True, slots=True)
class ForeignPacket:
    """A packet and whom it is for."""

    raw: bytes
    target_system: int
    target_component: int


class Decoder:
    """Finds the packets in a stream of bytes that may be split, damaged or anything else."""

    def __init__(self, us: Identity, read: Container[int], signing: Signing | None = None) -> None:
        """``read``: the ids of the messages that are worth reading."""
        self._us, self._read = us, read
        self._signing = signing or Signing()
        self.signing_is_optional = False
        """MAV_SIGN_CFG = 0: unsigned packets are read although there is a key."""
        self._rest = b""
        self.sources: set[tuple[int, int]] = set()
        """System and component of everybody who was heard here."""
        self.foreign: list[ForeignPacket] = []
        """Of the last push: packets that are not for this vehicle alone, for other links to pass on."""

    def push(self, data: bytes) -> list[dialect.MAVLink_message]:
        """The messages completed by ``data``, in order; what is not read here or is meant for others is dropped.

        A packet with a wrong checksum is skipped by one byte only, and an incomplete one holds up nothing that follows:
        its start may have been noise.
        """
        self.foreign = []
        if not data:
            return []
        buffer = self._rest + data if self._rest else data
        messages: list[dialect.MAVLink_message] = []
        kept = len(buffer)
        position = 0
        while (found := _MARKER.search(buffer, position)) is not None:
            start = found.start()
            size = packet_size(buffer, start)
            end = start + (size or 0)
            if size is None or end > len(buffer):
                kept = min(kept, start)
                position = start + 1
                continue
            packet = self._decode(buffer[start:end])
            if packet is None:
                position = start + 1
                continue
            kept, position = len(buffer), end
            self._hear(packet, buffer[start:end])
            if packet.get_msgId() in self._read and self._is_for_us(packet):
                messages.append(packet)
        self._rest = buffer[kept:]
        return messages

    def _decode(self, packet: bytes) -> dialect.MAVLink_message | None:
        if packet[0] == MAVLINK_2 and packet[2] & ~SIGNED:
            return None
        message = framing.read(packet)
        if message is None:
            return None
        is_signed = packet[0] == MAVLINK_2 and bool(packet[2] & SIGNED)
        source = message.get_srcSystem(), message.get_srcComponent()
        accepted = self._signing.accepts(packet, is_signed, source, message.get_msgId(), self.signing_is_optional)
        return message if accepted else None

    def _hear(self, packet: dialect.MAVLink_message, raw: bytes) -> None:
        self.sources.add((packet.get_srcSystem(), packet.get_srcComponent()))
        target = _target(packet)
        if target != self._us:
            self.foreign.append(ForeignPacket(raw, *target))

    def _is_for_us(self, packet: dialect.MAVLink_message) -> bool:
        return packet.get_msgId() in _READ_BY_ALL or self._us.is_addressed(*_target(packet))


def _target(packet: dialect.MAVLink_message) -> tuple[int, int]:
    """Whom it addresses; a message without a system is for everybody, one without a component for all of them."""
    system = "target" if packet.get_msgId() == _MANUAL_CONTROL_ID else "target_system"
    return getattr(packet, system, EVERY_ID), getattr(packet, "target_component", EVERY_ID)
