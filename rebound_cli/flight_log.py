"""A telemetry log as arrays: what was measured and what was asked for."""

import struct
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import numpy.typing as npt

from companion.estimate.strapdown import Strapdown
from companion.mavlink.decode import Decoder
from companion.mavlink.packet import message_id_of, payload_of, source_of
from companion.messages import Attitude, ImuSample, LocalPosition, MessageId
from companion.shell.tlog import read_tlog

Floats = npt.NDArray[np.float64]

# Only these are decoded; a log holds many more.
_DECODED = (MessageId.HIGHRES_IMU, MessageId.LOCAL_POSITION_NED, MessageId.ATTITUDE_QUATERNION)
_SET_POSITION_TARGET_LOCAL_NED = 84

# SET_POSITION_TARGET_LOCAL_NED's payload: time_boot_ms, then x, y, z in metres; MAVLink 2 leaves out
# the zeros at the end of a payload, which is 53 bytes long in full.
_SETPOINT_POSITION = struct.Struct("<4x3f")
_SETPOINT_LENGTH = 53


@dataclass(frozen=True, slots=True)
class FlightLog:
    """Times are the log's own, microseconds since the epoch, unless named boot times. NED, FRD, SI."""

    imu_at_us: Floats
    imu_time_boot_us: Floats
    specific_force_frd_m_s2: Floats
    accelerated_ned_m_s: Floats  # what the accelerometer has summed up to by each of its samples; from any velocity
    position_at_us: Floats
    position_ned_m: Floats
    velocity_ned_m_s: Floats
    setpoint_at_us: Floats
    setpoint_ned_m: Floats  # NaN where a setpoint asked for no place


def read_flight_log(path: Path) -> FlightLog:
    """Read what the figure and the table of results need from a log."""
    decoder = Decoder()
    imu: list[tuple[float, ...]] = []
    positions: list[tuple[float, ...]] = []
    setpoints: list[tuple[float, ...]] = []
    strapdown = Strapdown()
    for at_us, packet in read_tlog(path):
        message_id = message_id_of(packet)
        if message_id == _SET_POSITION_TARGET_LOCAL_NED:
            payload = payload_of(packet).ljust(_SETPOINT_LENGTH, b"\0")
            setpoints.append((at_us, *_SETPOINT_POSITION.unpack_from(payload)))
        elif message_id in _DECODED:
            decoder.listen_to(*source_of(packet))
            for _, sample in decoder.feed(packet):
                if isinstance(sample, ImuSample):
                    force, rates = sample.specific_force_frd_m_s2, sample.angular_velocity_frd_rad_s
                    strapdown.imu(sample.time_boot_us, force, rates)
                    imu.append((at_us, sample.time_boot_us, *force, *strapdown.sum_ned_m_s))
                elif isinstance(sample, Attitude):
                    strapdown.attitude(sample.time_boot_us, sample.attitude_wxyz)
                elif isinstance(sample, LocalPosition):
                    positions.append((at_us, *sample.position_ned_m, *sample.velocity_ned_m_s))
    widths = ((imu, 8), (positions, 7), (setpoints, 4))
    imu_rows, position_rows, setpoint_rows = (np.array(rows, np.float64).reshape(-1, width) for rows, width in widths)
    return FlightLog(
        *(imu_rows[:, 0], imu_rows[:, 1], imu_rows[:, 2:5], imu_rows[:, 5:8]),
        *(position_rows[:, 0], position_rows[:, 1:4], position_rows[:, 4:7]),
        *(setpoint_rows[:, 0], setpoint_rows[:, 1:4]),
    )
