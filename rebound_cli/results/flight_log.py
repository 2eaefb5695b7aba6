"""A telemetry log as arrays: what was measured and what was asked for."""

import math
import struct
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt

from companion.mavlink.decode import Decoder
from companion.mavlink.packet import message_id_of, payload_of, source_of
from companion.mavlink.readers import ARDUPILOT_READERS, READERS
from companion.messages import Attitude, AttitudeTarget, ImuSample, LocalPosition, MessageId, PositionTarget, Sample
from companion.shell.tlog import read_tlog
from rebound_cli.logs.log import position_target

Floats = npt.NDArray[np.float64]

_SET_ATTITUDE_TARGET = 82
_SET_POSITION_TARGET_LOCAL_NED = 84
_STATUSTEXT = 253
_MEASURED = (
    *(MessageId.HIGHRES_IMU, MessageId.RAW_IMU, MessageId.LOCAL_POSITION_NED),
    *(MessageId.ATTITUDE_QUATERNION, MessageId.ATTITUDE_TARGET),
)

# SET_POSITION_TARGET_LOCAL_NED begins with time_boot_ms, then north, east, down.
_PLACE = struct.Struct("<4x3f")
# SET_ATTITUDE_TARGET: the same, then the attitude, three rates, the thrust.
_ATTITUDE = struct.Struct("<4x4f12xf")
# STATUSTEXT: severity, 50 bytes of text; a longer text goes on in packets of the same id that is not 0.
_TEXT = struct.Struct("<B50sHB")


@dataclass(frozen=True, slots=True)
class FlightLog:
    """Times are the log's own, microseconds since the epoch, unless named boot times. NED, FRD, SI."""

    imu_at_us: Floats
    imu_time_boot_us: Floats
    specific_force_frd_m_s2: Floats
    angular_velocity_frd_rad_s: Floats
    position_at_us: Floats
    position_time_boot_us: Floats
    position_ned_m: Floats
    velocity_ned_m_s: Floats
    attitude_at_us: Floats
    attitude_wxyz: Floats
    setpoint_at_us: Floats
    setpoint_ned_m: Floats  # NaN where a setpoint asked for no place
    target_at_us: Floats
    target: Floats  # of the vehicle's own attitude control: w, x, y, z, NaN where it told none; thrust as a share
    wanted_at_us: Floats
    wanted: Floats  # of the setpoints by attitude that were sent, alike
    texts: tuple[tuple[int, str], ...]  # STATUSTEXT, when and what


def read_flight_log(path: Path) -> FlightLog:
    """Read what figures, the report and the table of results need from a log."""
    return flight_log_of_packets(read_tlog(path))


def flight_log_of_packets(packets: Iterable[tuple[int, bytes]]) -> FlightLog:
    """The same of packets with their stamps: what the companion hears of them, what it asked for, and all texts."""
    decoder = Decoder(READERS | ARDUPILOT_READERS, is_packet=lambda *_: True)
    heard, texts, wanted = list[tuple[int, Sample]](), list[tuple[int, bytes]](), list[Any]()
    for at_us, packet in packets:
        message_id = message_id_of(packet)
        if message_id in _MEASURED:
            decoder.listen_to(*source_of(packet))
            heard += ((at_us, sample) for _, sample in decoder.feed(packet) if sample is not None)
        elif message_id == _SET_POSITION_TARGET_LOCAL_NED:
            place = _PLACE.unpack_from(payload_of(packet).ljust(_PLACE.size, b"\0"))
            heard.append((at_us, position_target(place, math.nan)))
        elif message_id == _SET_ATTITUDE_TARGET:
            wanted.append((at_us, *_ATTITUDE.unpack_from(payload_of(packet).ljust(_ATTITUDE.size, b"\0"))))
        elif message_id == _STATUSTEXT:
            texts.append((at_us, packet))
    return flight_log_of(heard, wanted, _texts(texts))


def _texts(stamped: Iterable[tuple[int, bytes]]) -> list[tuple[int, str]]:
    """Whole ones: parts with one number belong together."""
    texts: list[tuple[int, int, bytes]] = []
    for at_us, packet in stamped:
        _, text, number, part = _TEXT.unpack_from(payload_of(packet).ljust(_TEXT.size, b"\0"))
        text = text.rstrip(b"\0")
        if number and part and texts and texts[-1][1] == number:
            text = texts[-1][2] + text
            at_us = texts.pop()[0]
        texts.append((at_us, number, text))
    return [(at_us, text.decode("utf-8", "replace")) for at_us, _, text in texts]


def flight_log_of(
    samples: Iterable[tuple[int, Sample]], wanted: Sequence[Any] = (), texts: Iterable[tuple[int, str]] = ()
) -> FlightLog:
    """The same of samples that were decoded already; setpoints as the vehicle tells them."""
    imu, moved, turned, asked, target = (list[Any]() for _ in range(5))
    for at_us, sample in samples:
        match sample:
            case ImuSample(boot_us, force, rates):
                imu.append((at_us, boot_us, *force, *rates))
            case LocalPosition(boot_us, position, velocity):
                moved.append((at_us, boot_us, *position, *velocity))
            case Attitude(_, turn):
                turned.append((at_us, *turn))
            case AttitudeTarget(_, thrust, turn):
                target.append((at_us, *(turn or (np.nan,) * 4), thrust))
            case PositionTarget(position):
                asked.append((at_us, *(position or (np.nan, np.nan, np.nan))))
    widths = ((imu, 8), (moved, 8), (turned, 5), (asked, 4), (target, 6), (wanted, 6))
    i, m, t, a, c, w = (np.array(rows, np.float64).reshape(-1, width) for rows, width in widths)
    return FlightLog(
        *(i[:, 0], i[:, 1], i[:, 2:5], i[:, 5:8], m[:, 0], m[:, 1], m[:, 2:5], m[:, 5:8]),
        *(t[:, 0], t[:, 1:5], a[:, 0], a[:, 1:4]),
        *(c[:, 0], c[:, 1:6], w[:, 0], w[:, 1:6]),
        tuple(texts),
    )
