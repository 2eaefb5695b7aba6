"""A telemetry log as arrays: what was measured and what was asked for."""

import struct
from collections.abc import Iterable
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import numpy.typing as npt

from companion.mavlink.decode import Decoder
from companion.mavlink.packet import message_id_of, payload_of, source_of
from companion.messages import Attitude, ImuSample, LocalPosition, MessageId
from companion.motion.strapdown import Strapdown
from companion.shell.tlog import read_tlog
from rebound_cli.logs.log import Demand, Told

Floats = npt.NDArray[np.float64]

# Only these are decoded; a log holds many more.
_DECODED = (MessageId.HIGHRES_IMU, MessageId.LOCAL_POSITION_NED, MessageId.ATTITUDE_QUATERNION)
_SET_POSITION_TARGET_LOCAL_NED = 84
_STATUSTEXT = 253

# SET_POSITION_TARGET_LOCAL_NED's payload: time_boot_ms, then x, y, z in metres; MAVLink 2 leaves out
# the zeros at the end of a payload, which is 53 bytes long in full.
_SETPOINT_POSITION = struct.Struct("<4x3f")
_SETPOINT_LENGTH = 53
# STATUSTEXT: severity, 50 bytes of text; a longer text goes on in packets of the same id that is not 0.
_TEXT = struct.Struct("<B50sHB")


@dataclass(frozen=True, slots=True)
class FlightLog:
    """Times are the log's own, microseconds since the epoch, unless named boot times. NED, FRD, SI."""

    imu_at_us: Floats
    imu_time_boot_us: Floats
    specific_force_frd_m_s2: Floats
    angular_velocity_frd_rad_s: Floats
    accelerated_ned_m_s: Floats  # what the accelerometer has summed up to by each of its samples; from any velocity
    position_at_us: Floats
    position_time_boot_us: Floats
    position_ned_m: Floats
    velocity_ned_m_s: Floats
    attitude_at_us: Floats
    attitude_wxyz: Floats
    setpoint_at_us: Floats
    setpoint_ned_m: Floats  # NaN where a setpoint asked for no place
    texts: tuple[tuple[int, str], ...]  # STATUSTEXT, when and what


def read_flight_log(path: Path) -> FlightLog:
    """Read what figures, the report and the table of results need from a log."""
    return flight_log_of_packets(read_tlog(path))


def flight_log_of_packets(packets: Iterable[tuple[int, bytes]]) -> FlightLog:
    """The same of packets with their stamps."""
    decoder, rows = Decoder(), _Rows()
    for at_us, packet in packets:
        message_id = message_id_of(packet)
        if message_id == _SET_POSITION_TARGET_LOCAL_NED:
            payload = payload_of(packet).ljust(_SETPOINT_LENGTH, b"\0")
            rows.setpoints.append((at_us, *_SETPOINT_POSITION.unpack_from(payload)))
        elif message_id == _STATUSTEXT:
            rows.take_text(at_us, payload_of(packet))
        elif message_id in _DECODED:
            decoder.listen_to(*source_of(packet))
            for _, sample in decoder.feed(packet):
                if sample is not None:
                    rows.take(at_us, sample)
    return rows.log()


def flight_log_of(samples: Iterable[tuple[int, Told]]) -> FlightLog:
    """The same of samples that were decoded already; setpoints as the vehicle tells them."""
    rows = _Rows()
    for at_us, sample in samples:
        rows.take(at_us, sample)
    return rows.log()


class _Rows:
    """Grow as the log is read."""

    def __init__(self) -> None:
        self._strapdown = Strapdown()
        self._imu: list[tuple[float, ...]] = []
        self._positions: list[tuple[float, ...]] = []
        self._attitudes: list[tuple[float, ...]] = []
        self.setpoints: list[tuple[float, ...]] = []
        self._texts: list[tuple[int, int, bytes]] = []

    def take(self, at_us: int, sample: Told) -> None:
        if isinstance(sample, ImuSample):
            force, rates = sample.specific_force_frd_m_s2, sample.angular_velocity_frd_rad_s
            self._strapdown.imu(sample.time_boot_us, force, rates)
            self._imu.append((at_us, sample.time_boot_us, *force, *rates, *self._strapdown.sum_ned_m_s))
        elif isinstance(sample, Attitude):
            self._strapdown.attitude(sample.time_boot_us, sample.attitude_wxyz)
            self._attitudes.append((at_us, *sample.attitude_wxyz))
        elif isinstance(sample, LocalPosition):
            moved = (*sample.position_ned_m, *sample.velocity_ned_m_s)
            self._positions.append((at_us, sample.time_boot_us, *moved))
        elif isinstance(sample, Demand):
            self.setpoints.append((at_us, *(sample.position_ned_m or (np.nan, np.nan, np.nan))))

    def take_text(self, at_us: int, payload: bytes) -> None:
        _, text, number, part = _TEXT.unpack_from(payload.ljust(_TEXT.size, b"\0"))
        before = self._texts[-1] if self._texts else None
        if number and part and before is not None and before[1] == number:
            self._texts[-1] = (before[0], number, before[2] + text.rstrip(b"\0"))
        else:
            self._texts.append((at_us, number, text.rstrip(b"\0")))

    def log(self) -> FlightLog:
        imu, moved, attitudes, asked = (
            np.array(rows, np.float64).reshape(-1, width)
            for rows, width in ((self._imu, 11), (self._positions, 8), (self._attitudes, 5), (self.setpoints, 4))
        )
        return FlightLog(
            *(imu[:, 0], imu[:, 1], imu[:, 2:5], imu[:, 5:8], imu[:, 8:11]),
            *(moved[:, 0], moved[:, 1], moved[:, 2:5], moved[:, 5:8]),
            *(attitudes[:, 0], attitudes[:, 1:5], asked[:, 0], asked[:, 1:4]),
            tuple((at_us, text.decode("utf-8", "replace")) for at_us, _, text in self._texts),
        )
