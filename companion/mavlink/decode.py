"""MAVLink bytes to packets and typed samples.

Packets are found by their header here, so that the many the companion has no use for cost no decoding.
"""

from collections.abc import Callable, Mapping
from dataclasses import replace

from pymavlink.dialects.v20 import development as dialect

from companion.autopilot.interface import Autopilot
from companion.autopilot.known import ASSUMED
from companion.mavlink.packet import Stray, checksum_holds, message_id_of, packet_length, payload_of, source_of
from companion.mavlink.readers import ARDUPILOT_READERS, READERS, Reader
from companion.messages import Attitude, AttitudeTarget, AutopilotVersion, ImuSample, LocalPosition, Sample, Sticks

# time_boot_ms has 32 bits: it begins again after 49.7 days.
WRAP_US = (1 << 32) * 1000
# Stamps of one boot differ by as much as their messages are apart, which is far less than an hour.
SAME_BOOT_US = 3_600_000_000


class Decoder:
    """A byte stream in any chunks, with any damage, to packets; never raises on what it is fed.

    What no vehicle can truly say becomes `Refused` (see messages).

    Until `listen_to` names the vehicle only heartbeats are converted; then only what that component sent.
    """

    def __init__(
        self, readers: Mapping[int, Reader] = READERS, is_packet: Callable[[bytes, int, int], bool] = checksum_holds
    ) -> None:
        """`is_packet`: whether bytes, from a start on and of a length, are a packet; by default the checksum tells."""
        self._readers, self._is_packet = readers, is_packet
        self._pending = b""
        self._vehicle: tuple[int, int] | None = None
        self._autopilot = ASSUMED
        self._has_highres_imu = False
        self._boot_us = 0  # newest 64-bit stamp
        self._has_signed_throttle = False

    def listen_to(self, system_id: int, component_id: int, autopilot: Autopilot = ASSUMED) -> None:
        self._vehicle, self._autopilot = (system_id, component_id), autopilot
        if autopilot.casts_whole_numbers:
            self._readers = {**self._readers, **ARDUPILOT_READERS}

    def feed(self, received: bytes) -> list[tuple[bytes, Sample | None]]:
        """All packets complete by now, with their samples; bytes that are no packet come as `Stray`, with None."""
        data = self._pending + received if self._pending else received
        frames: list[tuple[bytes, Sample | None]] = []
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
                frames.append((Stray(data[bad_start:start]), None))
            packet = data[start : start + length]
            frames.append((packet, self._sample(packet)))
            start = bad_start = start + length
        if bad_start < start:
            frames.append((Stray(data[bad_start:start]), None))
        self._pending = data[start:]
        return frames

    def _sample(self, packet: bytes) -> Sample | None:
        message_id = message_id_of(packet)
        reader = self._readers.get(message_id)
        if reader is None:
            return None
        source = source_of(packet)
        if source != self._vehicle and (self._vehicle is not None or message_id != dialect.MAVLINK_MSG_ID_HEARTBEAT):
            return None
        sample = reader.from_payload(payload_of(packet), source)
        if isinstance(sample, ImuSample):
            if message_id == dialect.MAVLINK_MSG_ID_HIGHRES_IMU:
                self._has_highres_imu = True
            elif self._has_highres_imu:
                return None  # somebody else's stream of the same samples
            self._boot_us = sample.time_boot_us
        elif self._boot_us > WRAP_US // 2 and isinstance(sample, LocalPosition | Attitude | AttitudeTarget):
            wraps = round((self._boot_us - sample.time_boot_us) / WRAP_US)
            stamp_us = sample.time_boot_us + wraps * WRAP_US
            # Far from the newest one it has not wrapped: the vehicle has rebooted.
            return replace(sample, time_boot_us=stamp_us) if abs(stamp_us - self._boot_us) < SAME_BOOT_US else sample
        elif isinstance(sample, AutopilotVersion):
            self._has_signed_throttle |= sample.flight_version < self._autopilot.unsigned_throttle_since
        elif isinstance(sample, Sticks):
            pitch, roll, throttle, yaw = sample.deflections
            self._has_signed_throttle |= throttle < -1.0
            return Sticks((pitch, roll, 0.5 * (throttle + 1.0), yaw)) if self._has_signed_throttle else sample
        return sample
