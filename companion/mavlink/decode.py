"""MAVLink bytes to packets and typed samples.

Packets are found by their header here, so that the many the companion has no use for cost no decoding; the
rest, checksums included, is pymavlink's.
"""

import math
import struct
from collections.abc import Callable, Mapping
from dataclasses import replace
from typing import Any

from fastcrc.crc16 import mcrf4xx
from pymavlink.dialects.v20 import development as dialect

from companion.mavlink.encode import COMPONENT_ID
from companion.mavlink.frequent import FREQUENT
from companion.mavlink.packet import (
    HEADER_V1,
    HEADER_V2,
    MAGIC_V1,
    MAGIC_V2,
    message_id_of,
    packet_length,
    payload_of,
    source_of,
)
from companion.messages import (
    ANGULAR_VELOCITY_RAD_S,
    POSITION_M,
    SPECIFIC_FORCE_M_S2,
    THRUST_FRACTION,
    TIME_US,
    Attitude,
    AttitudeTarget,
    AutopilotVersion,
    Battery,
    CommandAck,
    CommandResult,
    CurrentMode,
    EstimatorStatus,
    ExtendedState,
    GlobalPosition,
    Heartbeat,
    ImuSample,
    LandedState,
    LocalPosition,
    Parameter,
    PositionTarget,
    Refused,
    Sample,
    Sticks,
    TimeSyncAnswer,
    TimeSyncRequest,
    Vibration,
    is_rotation,
    within,
)

Frame = tuple[bytes, Sample | None]

# time_boot_ms has 32 bits: it begins again after 49.7 days.
WRAP_US = (1 << 32) * 1000
# Stamps of one boot differ by as much as their messages are apart, which is far less than an hour.
SAME_BOOT_US = 3_600_000_000
# POSITION_TARGET_TYPEMASK: x, y or z.
POSITION_IGNORED = 0x7


def _heartbeat(m: Any) -> Heartbeat:
    armed = bool(m.base_mode & dialect.MAV_MODE_FLAG_SAFETY_ARMED)
    return Heartbeat(
        m.get_srcSystem(), m.get_srcComponent(), m.type, m.autopilot, armed, m.custom_mode, m.system_status
    )


def _attitude_target(m: Any) -> AttitudeTarget | Refused | None:
    if m.type_mask & dialect.ATTITUDE_TARGET_TYPEMASK_THROTTLE_IGNORE:
        return None
    if not 0.0 <= m.thrust <= THRUST_FRACTION:
        return Refused("ATTITUDE_TARGET", f"thrust {m.thrust:g}")
    w, x, y, z = m.q
    given = not m.type_mask & dialect.ATTITUDE_TARGET_TYPEMASK_ATTITUDE_IGNORE and is_rotation(w, x, y, z)
    return AttitudeTarget(m.time_boot_ms * 1000, m.thrust, (w, x, y, z) if given else None)


def _vibration(m: Any) -> Vibration | Refused:
    # How much a sample may differ from the one before: no more than the ranges.
    within_ranges = within(2.0 * ANGULAR_VELOCITY_RAD_S, m.vibration_y) and within(
        2.0 * SPECIFIC_FORCE_M_S2, m.vibration_z
    )
    if not within_ranges or m.time_usec >= TIME_US:
        return Refused("VIBRATION", f"{m.vibration_y:g} rad/s, {m.vibration_z:g} m/s^2")
    counts = (m.clipping_0, m.clipping_1, m.clipping_2)
    return Vibration(m.time_usec, m.vibration_y, m.vibration_z, counts)


def _battery(m: Any) -> Battery | None:
    # -1: the autopilot does not know.
    return Battery(m.battery_remaining) if 0 <= m.battery_remaining <= 100 else None


def _extended_state(m: Any) -> ExtendedState | None:
    known = m.landed_state in LandedState.__members__.values()
    return ExtendedState(LandedState(m.landed_state)) if known else None


def _current_mode(m: Any) -> CurrentMode:
    # 0 stands for "not known" in the intended mode.
    return CurrentMode(m.custom_mode, m.intended_custom_mode or None)


def _command_ack(m: Any) -> CommandAck | None:
    # PX4 names whom it answers; other components' conversations pass over the same link.
    ours = m.target_component in (0, COMPONENT_ID)
    known = m.result in CommandResult.__members__.values()
    return CommandAck(m.command, CommandResult(m.result)) if ours and known else None


def _timesync(m: Any) -> TimeSyncRequest | TimeSyncAnswer:
    return TimeSyncRequest(m.ts1) if m.tc1 == 0 else TimeSyncAnswer(m.ts1, m.tc1)


def _parameter(m: Any) -> Parameter | None:
    # PX4 has two kinds; the bytes of a whole number travel in the float's place.
    if m.param_type == dialect.MAV_PARAM_TYPE_INT32:
        return Parameter(m.param_id, struct.unpack("<i", struct.pack("<f", m.param_value))[0])
    is_real = m.param_type == dialect.MAV_PARAM_TYPE_REAL32 and math.isfinite(m.param_value)
    return Parameter(m.param_id, m.param_value) if is_real else None


def _estimator_status(m: Any) -> EstimatorStatus | Refused:
    ratios = (m.vel_ratio, m.pos_horiz_ratio, m.pos_vert_ratio)
    if any(map(math.isinf, ratios)):
        return Refused("ESTIMATOR_STATUS", "ratios {:g} {:g} {:g}".format(*ratios))
    return EstimatorStatus(
        # NaN is PX4's word for what no sensor measures: the velocity, by motion capture.
        tuple(ratio for ratio in ratios if not math.isnan(ratio)),
        bool(m.flags & dialect.ESTIMATOR_VELOCITY_HORIZ),
        bool(m.flags & dialect.ESTIMATOR_ACCEL_ERROR),
    )


def _autopilot_version(m: Any) -> AutopilotVersion:
    # major, minor, patch, type: one byte each, from the top
    version = m.flight_sw_version
    return AutopilotVersion((version >> 24 & 0xFF, version >> 16 & 0xFF, version >> 8 & 0xFF))


CONVERTERS: dict[int, Callable[[Any], Sample | None]] = {
    dialect.MAVLINK_MSG_ID_HEARTBEAT: _heartbeat,
    dialect.MAVLINK_MSG_ID_ATTITUDE_TARGET: _attitude_target,
    dialect.MAVLINK_MSG_ID_VIBRATION: _vibration,
    dialect.MAVLINK_MSG_ID_SYS_STATUS: _battery,
    dialect.MAVLINK_MSG_ID_EXTENDED_SYS_STATE: _extended_state,
    dialect.MAVLINK_MSG_ID_CURRENT_MODE: _current_mode,
    dialect.MAVLINK_MSG_ID_COMMAND_ACK: _command_ack,
    dialect.MAVLINK_MSG_ID_TIMESYNC: _timesync,
    dialect.MAVLINK_MSG_ID_PARAM_VALUE: _parameter,
    dialect.MAVLINK_MSG_ID_ESTIMATOR_STATUS: _estimator_status,
    dialect.MAVLINK_MSG_ID_AUTOPILOT_VERSION: _autopilot_version,
}


def _position_target(m: Any) -> PositionTarget:
    known = not m.type_mask & POSITION_IGNORED and within(POSITION_M, m.x, m.y, m.z)
    return PositionTarget((m.x, m.y, m.z) if known else None)


def _global_position(m: Any) -> GlobalPosition | Refused:
    if not (within(90e7, m.lat) and within(180e7, m.lon)):
        return Refused("GLOBAL_POSITION_INT", f"latitude {m.lat}, longitude {m.lon} (1e-7 deg)")
    return GlobalPosition(m.lat * 1e-7, m.lon * 1e-7, m.alt * 1e-3)


def _sticks(m: Any) -> Sticks | Refused:
    # The throttle goes from 0 to 1000 (PX4's streams/MANUAL_CONTROL.hpp).
    if not (max(abs(m.x), abs(m.y), abs(m.r)) <= 1000 and 0 <= m.z <= 1000):
        return Refused("MANUAL_CONTROL", f"sticks {m.x} {m.y} {m.z} {m.r}")
    return Sticks((m.x / 1000.0, m.y / 1000.0, m.z / 500.0 - 1.0, m.r / 1000.0))


# What only a guard looks at: another's setpoints and the pilot's hands.
GUARD_CONVERTERS: dict[int, Callable[[Any], Sample | None]] = {
    **CONVERTERS,
    dialect.MAVLINK_MSG_ID_POSITION_TARGET_LOCAL_NED: _position_target,
    dialect.MAVLINK_MSG_ID_MANUAL_CONTROL: _sticks,
}

# And one on a link of its own, which cannot always send setpoints: where on earth that is.
LONE_GUARD_CONVERTERS: dict[int, Callable[[Any], Sample | None]] = {
    **GUARD_CONVERTERS,
    dialect.MAVLINK_MSG_ID_GLOBAL_POSITION_INT: _global_position,
}


# Packets with other ids have a checksum that cannot be checked.
KNOWN_IDS = frozenset(dialect.mavlink_map)


class Decoder:
    """A byte stream in any chunks, with any damage, to packets; never raises on what it is fed.

    What no vehicle can truly say becomes `Refused` (see messages).

    Until `listen_to` names the vehicle only heartbeats are converted; then only what that component sent.
    """

    def __init__(
        self,
        converters: Mapping[int, Callable[[Any], Sample | None]] = CONVERTERS,
        is_packet: Callable[[bytes, int, int], bool] | None = None,
    ) -> None:
        """`is_packet`: whether bytes, from a start on and of a length, are a packet; by default the checksum tells."""
        self._converters, self._is_packet = converters, is_packet or checksum_holds
        self._mavlink = dialect.MAVLink(None)
        self._pending = b""
        self._vehicle: tuple[int, int] | None = None
        self._boot_us = 0  # newest 64-bit stamp
        self.bad_bytes = 0

    def listen_to(self, system_id: int, component_id: int) -> None:
        self._vehicle = (system_id, component_id)

    def feed(self, received: bytes) -> list[Frame]:
        """All packets complete by now, with their samples; bytes that are no packet come as they are, with None."""
        data = self._pending + received if self._pending else received
        frames: list[Frame] = []
        start = bad_start = 0
        end = len(data)
        while start < end:
            length = packet_length(data, start)
            if length == 0 or (start + length <= end and not self._is_packet(data, start, length)):
                start += 1
                continue
            if start + length > end:
                break
            if bad_start < start:
                self._note_bad(data[bad_start:start], frames)
            packet = data[start : start + length]
            frames.append((packet, self._sample(packet)))
            start = bad_start = start + length
        if bad_start < start:
            self._note_bad(data[bad_start:start], frames)
        self._pending = data[start:]
        return frames

    def _note_bad(self, bad: bytes, frames: list[Frame]) -> None:
        self.bad_bytes += len(bad)
        frames.append((bad, None))

    def _sample(self, packet: bytes) -> Sample | None:
        message_id = message_id_of(packet)
        frequent, converter = FREQUENT.get(message_id), self._converters.get(message_id)
        if frequent is None and converter is None:
            return None
        is_from_vehicle = source_of(packet) == self._vehicle
        if not is_from_vehicle and (self._vehicle is not None or message_id != dialect.MAVLINK_MSG_ID_HEARTBEAT):
            return None
        if converter is not None:
            sample = self._converted(converter, packet)
        else:
            assert frequent is not None
            sample = frequent.sample(payload_of(packet))
        if isinstance(sample, ImuSample):
            self._boot_us = sample.time_boot_us
        elif self._boot_us > WRAP_US // 2 and isinstance(sample, LocalPosition | Attitude | AttitudeTarget):
            wraps = round((self._boot_us - sample.time_boot_us) / WRAP_US)
            stamp_us = sample.time_boot_us + wraps * WRAP_US
            # Far from the newest one it has not wrapped: the vehicle has rebooted.
            return replace(sample, time_boot_us=stamp_us) if abs(stamp_us - self._boot_us) < SAME_BOOT_US else sample
        return sample

    def _converted(self, converter: Callable[[Any], Sample | None], packet: bytes) -> Sample | None:
        try:
            return converter(self._mavlink.decode(bytearray(packet)))
        except dialect.MAVError:
            return None


def checksum_holds(data: bytes, start: int, length: int) -> bool:
    """Whether the packet's own checksum holds; for messages that are not in the dialect, always."""
    if data[start] == MAGIC_V2:
        message_id = data[start + 7] | data[start + 8] << 8 | data[start + 9] << 16
        end = start + HEADER_V2 + data[start + 1]
    else:
        message_id = data[start + 5]
        end = start + HEADER_V1 + data[start + 1]
    message = dialect.mavlink_map.get(message_id)
    if message is None:
        return start + length == len(data) or data[start + length] in (MAGIC_V1, MAGIC_V2)
    expected: int = mcrf4xx(data[start + 1 : end] + bytes((message.crc_extra,)))
    return expected == data[end] | data[end + 1] << 8
