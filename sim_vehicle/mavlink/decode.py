"""Bytes to messages: whatever arrives, the step goes on."""

import math
import re
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import TypeAlias

from pymavlink.dialects.v20 import development as dialect

from sim_vehicle.autopilot.messages import (
    EVERY_ID,
    Command,
    Identity,
    PeerHeartbeat,
    PingRequest,
    SetMode,
    SigningSetup,
    TimeSyncRequest,
)
from sim_vehicle.mavlink import framing
from sim_vehicle.mavlink.services import file_service, mission_service, parameter_service, setpoint_service
from sim_vehicle.mavlink.signing import SETUP_SIGNING_ID, Signing

_MARKER = re.compile(rb"[\xfd\xfe]")
_MARKER_V2 = 0xFD
# Header and checksum around the payload, for MAVLink 2 and 1, and what a signature adds.
_AROUND_V2, _AROUND_V1, _SIGNATURE = 12, 8, 13
_SIGNED_FLAG = 0x01

_DO_SET_MODE = 176
# Its target is a system, too, under another name.
_MANUAL_CONTROL_ID = 69
_GREATEST_INT32 = 2**31 - 1


@dataclass(frozen=True, slots=True)
class ForeignPacket:
    """A packet and whom it is for."""

    raw: bytes
    target_system: int
    target_component: int


class Decoder:
    """Finds the packets in a stream of bytes that may be split, damaged or anything else."""

    def __init__(
        self, us: Identity, signing: Signing | None = None, readers: "Mapping[int, Reader] | None" = None
    ) -> None:
        """``readers``: of other messages than those that a vehicle reads."""
        self._us = us
        self._signing = signing or Signing()
        self._readers = READERS if readers is None else readers
        self.signing_is_optional = False
        """MAV_SIGN_CFG = 0: unsigned packets are read although there is a key."""
        self._rest = b""
        self.sources: set[tuple[int, int]] = set()
        """System and component of everybody who was heard here."""
        self.heard_mavlink_2 = False
        self.foreign: list[ForeignPacket] | None = None
        """Where set: packets that are not for this vehicle alone, for other links to pass on."""

    def push(self, data: bytes) -> list[object]:
        """The messages completed by ``data``, in order; what this vehicle does not read or is not meant for is dropped.

        A packet with a wrong checksum is skipped by one byte only, and an incomplete one holds up nothing that follows:
        its start may have been noise.
        """
        if not data:
            return []
        buffer = self._rest + data if self._rest else data
        messages: list[object] = []
        kept = len(buffer)
        position = 0
        while (found := _MARKER.search(buffer, position)) is not None:
            start = found.start()
            end = _end_of_packet(buffer, start)
            if end is None or end > len(buffer):
                kept = min(kept, start)
                position = start + 1
                continue
            packet = self._decode(buffer[start:end])
            if packet is None:
                position = start + 1
                continue
            kept, position = len(buffer), end
            self._hear(packet, buffer[start:end])
            message = self._read(packet)
            if message is not None:
                messages.append(message)
        self._rest = buffer[kept:]
        return messages

    def _decode(self, packet: bytes) -> dialect.MAVLink_message | None:
        if packet[0] == _MARKER_V2 and packet[2] & ~_SIGNED_FLAG:
            return None
        message = framing.read(packet)
        if message is None:
            return None
        is_signed = packet[0] == _MARKER_V2 and bool(packet[2] & _SIGNED_FLAG)
        source = message.get_srcSystem(), message.get_srcComponent()
        accepted = self._signing.accepts(packet, is_signed, source, message.get_msgId(), self.signing_is_optional)
        return message if accepted else None

    def _hear(self, packet: dialect.MAVLink_message, raw: bytes) -> None:
        self.sources.add((packet.get_srcSystem(), packet.get_srcComponent()))
        self.heard_mavlink_2 |= raw[0] == _MARKER_V2
        if self.foreign is None:
            return
        is_addressed = hasattr(packet, "target_system") or packet.id == _MANUAL_CONTROL_ID
        target = _target(packet) if is_addressed else (EVERY_ID, EVERY_ID)
        if target != self._us:
            self.foreign.append(ForeignPacket(raw, *target))

    def _read(self, packet: dialect.MAVLink_message) -> object | None:
        message_id: int = packet.get_msgId()
        read = self._readers.get(message_id)
        if read is None or (message_id in _ADDRESSED and not self._us.is_addressed(*_target(packet))):
            return None
        return read(packet)


def _end_of_packet(buffer: bytes, start: int) -> int | None:
    """Where the packet that may begin at ``start`` ends; None while its header is not complete."""
    if len(buffer) < start + 3:
        return None
    length = buffer[start + 1]
    if buffer[start] != _MARKER_V2:
        return start + length + _AROUND_V1
    signature = _SIGNATURE if buffer[start + 2] & _SIGNED_FLAG else 0
    return start + length + _AROUND_V2 + signature


def _target(packet: dialect.MAVLink_message) -> tuple[int, int]:
    """Whom it addresses; a message without a component is for all of them."""
    system = packet.target if packet.id == _MANUAL_CONTROL_ID else packet.target_system
    return system, getattr(packet, "target_component", EVERY_ID)


def _heartbeat(packet: dialect.MAVLink_heartbeat_message) -> PeerHeartbeat:
    return PeerHeartbeat(packet.get_srcSystem(), packet.get_srcComponent(), packet.type)


def _timesync(packet: dialect.MAVLink_timesync_message) -> TimeSyncRequest | None:
    return TimeSyncRequest(packet.ts1) if packet.tc1 == 0 else None


def _ping(packet: dialect.MAVLink_ping_message) -> PingRequest | None:
    if (packet.target_system, packet.target_component) != (EVERY_ID, EVERY_ID):
        return None
    return PingRequest(packet.time_usec, packet.seq, packet.get_srcSystem(), packet.get_srcComponent())


def _set_mode(packet: dialect.MAVLink_set_mode_message) -> SetMode:
    main, sub = packet.custom_mode >> 16 & 0xFF, packet.custom_mode >> 24
    source, target = (packet.get_srcSystem(), packet.get_srcComponent()), (packet.target_system, EVERY_ID)
    return SetMode(Command(*source, *target, _DO_SET_MODE, packet.base_mode, main, sub))


def _setup_signing(packet: dialect.MAVLink_setup_signing_message) -> SigningSetup:
    return SigningSetup(bytes(packet.secret_key), packet.initial_timestamp)


def _command_long(packet: dialect.MAVLink_command_long_message) -> Command:
    return _command(packet, packet.param5, packet.param6, packet.param7, packet.confirmation, None)


def _command_int(packet: dialect.MAVLink_command_int_message) -> Command:
    """x and y are divided by 10^7 whatever they mean, as PX4 does; both at their greatest mean none."""
    unset = packet.x == _GREATEST_INT32 and packet.y == _GREATEST_INT32
    param5, param6 = (math.nan, math.nan) if unset else (packet.x / 1e7, packet.y / 1e7)
    return _command(packet, param5, param6, packet.z, 0, packet.frame)


def _command(
    packet: dialect.MAVLink_command_long_message | dialect.MAVLink_command_int_message,
    param5: float,
    param6: float,
    param7: float,
    confirmation: int,
    frame: int | None,
) -> Command:
    return Command(
        source_system=packet.get_srcSystem(),
        source_component=packet.get_srcComponent(),
        target_system=packet.target_system,
        target_component=packet.target_component,
        command=packet.command,
        param1=packet.param1,
        param2=packet.param2,
        param3=packet.param3,
        param4=packet.param4,
        param5=param5,
        param6=param6,
        param7=param7,
        confirmation=confirmation,
        frame=frame,
    )


Reader: TypeAlias = Callable[[dialect.MAVLink_message], object | None]
"""A packet's value; None where it says nothing to this vehicle."""

# By message id. What is in no table is dropped.
READERS: dict[int, Reader] = {
    0: _heartbeat,
    4: _ping,
    11: _set_mode,
    SETUP_SIGNING_ID: _setup_signing,
    75: _command_int,
    76: _command_long,
    111: _timesync,
    **parameter_service.READERS,
    **file_service.READERS,
    **setpoint_service.READERS,
    **mission_service.READERS,
}

# Commands may go to other components and still be answered, and who is pinged is the one thing that a PING says.
_NOT_ADDRESSED = (4, 75, 76)
_ADDRESSED = frozenset(
    number
    for number in READERS
    if ("target_system" in dialect.mavlink_map[number].fieldnames or number == _MANUAL_CONTROL_ID)
    and number not in _NOT_ADDRESSED
)
