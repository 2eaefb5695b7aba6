"""A telemetry log as arrays: what was measured and what was asked for."""

import struct
from collections import defaultdict
from collections.abc import Iterable
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt

from companion import messages
from companion.mavlink.columns import columns_of
from companion.mavlink.decode import SAME_BOOT_US, WRAP_US
from companion.mavlink.packet import message_id_of, payload_of
from companion.mavlink.readers import ACCELEROMETER_UPDATED
from companion.messages import Attitude, ImuSample, LocalPosition, MessageId
from companion.shell.tlog import read_tlog
from rebound_cli.logs.log import Demand, Told

Floats = npt.NDArray[np.float64]

_SET_POSITION_TARGET_LOCAL_NED = 84
_STATUSTEXT = 253

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
    attitude_time_boot_us: Floats
    attitude_wxyz: Floats
    setpoint_at_us: Floats
    setpoint_ned_m: Floats  # NaN where a setpoint asked for no place
    texts: tuple[tuple[int, str], ...]  # STATUSTEXT, when and what


def read_flight_log(path: Path) -> FlightLog:
    """Read what figures, the report and the table of results need from a log."""
    return flight_log_of_packets(read_tlog(path))


def flight_log_of_packets(packets: Iterable[tuple[int, bytes]]) -> FlightLog:
    """The same of packets with their stamps; without what no vehicle can truly say (see messages)."""
    sorted_by_id: dict[int, list[tuple[int, bytes]]] = defaultdict(list)
    for stamped in packets:
        sorted_by_id[message_id_of(stamped[1])].append(stamped)

    def table(message_id: int, names: str) -> tuple[Floats, Floats, npt.NDArray[Any]]:
        """Stamps, the fields of these names in columns, and all fields."""
        stamped = sorted_by_id[message_id]
        rows = columns_of(message_id, (packet for _, packet in stamped))
        at_us = np.array([stamp_us for stamp_us, _ in stamped], np.float64)
        # A damaged payload may hold a NaN of any kind.
        with np.errstate(invalid="ignore"):
            return at_us, np.column_stack([rows[name] for name in names.split()]).astype(np.float64), rows

    imu_at_us, imu, rows = table(MessageId.HIGHRES_IMU, "time_usec xacc yacc zacc xgyro ygyro zgyro")
    force = np.linalg.norm(imu[:, 1:4], axis=1)
    good = (force > messages.ZERO_G_OFFSET_M_S2) & (force <= messages.SPECIFIC_FORCE_M_S2)
    good &= _within(messages.ANGULAR_VELOCITY_RAD_S, imu[:, 4:7]) & (imu[:, 0] < messages.TIME_US)
    good &= rows["fields_updated"] & ACCELEROMETER_UPDATED == ACCELEROMETER_UPDATED
    imu_at_us, imu = imu_at_us[good], imu[good]

    moved_at_us, moved, _ = table(MessageId.LOCAL_POSITION_NED, "time_boot_ms x y z vx vy vz")
    good = _within(messages.POSITION_M, moved[:, 1:4]) & _within(messages.VELOCITY_M_S, moved[:, 4:7])
    moved_at_us, moved = moved_at_us[good], moved[good]

    names = "time_boot_ms q1 q2 q3 q4 rollspeed pitchspeed yawspeed"
    turned_at_us, turned, _ = table(MessageId.ATTITUDE_QUATERNION, names)
    good = np.abs((turned[:, 1:5] ** 2).sum(axis=1) - 1.0) <= messages.QUATERNION_ERROR
    good &= _within(messages.ANGULAR_VELOCITY_RAD_S, turned[:, 5:8])
    turned_at_us, turned = turned_at_us[good], turned[good]

    asked_at_us, asked, _ = table(_SET_POSITION_TARGET_LOCAL_NED, "x y z")
    clock = (imu_at_us, imu[:, 0])
    return FlightLog(
        *(imu_at_us, imu[:, 0], imu[:, 1:4], imu[:, 4:7]),
        *(moved_at_us, _unwrapped(moved_at_us, 1e3 * moved[:, 0], *clock), moved[:, 1:4], moved[:, 4:7]),
        *(turned_at_us, _unwrapped(turned_at_us, 1e3 * turned[:, 0], *clock), turned[:, 1:5], asked_at_us, asked),
        tuple(_texts(sorted_by_id[_STATUSTEXT])),
    )


def _within(most: float, vectors: Floats) -> npt.NDArray[np.bool_]:
    within: npt.NDArray[np.bool_] = np.linalg.norm(vectors, axis=1) <= most
    return within


def _unwrapped(at_us: Floats, boot_us: Floats, imu_at_us: Floats, imu_boot_us: Floats) -> Floats:
    """Stamps of 32 bits of milliseconds, after 49.7 days, by those of 64 bits that came last before them."""
    if not len(imu_boot_us):
        return boot_us
    newest_us = imu_boot_us[np.maximum(np.searchsorted(imu_at_us, at_us, "right") - 1, 0)]
    later_us = boot_us + np.round((newest_us - boot_us) / WRAP_US) * WRAP_US
    # Far from the newest one it has not wrapped: the vehicle has rebooted.
    return np.where(np.abs(later_us - newest_us) < SAME_BOOT_US, later_us, boot_us)


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


def flight_log_of(samples: Iterable[tuple[int, Told]]) -> FlightLog:
    """The same of samples that were decoded already; setpoints as the vehicle tells them."""
    imu, moved, turned, asked = list[Any](), list[Any](), list[Any](), list[Any]()
    for at_us, sample in samples:
        match sample:
            case ImuSample(boot_us, force, rates):
                imu.append((at_us, boot_us, *force, *rates))
            case LocalPosition(boot_us, position, velocity):
                moved.append((at_us, boot_us, *position, *velocity))
            case Attitude(boot_us, turn):
                turned.append((at_us, boot_us, *turn))
            case Demand():
                asked.append((at_us, *(sample.position_ned_m or (np.nan, np.nan, np.nan))))
    widths = ((imu, 8), (moved, 8), (turned, 6), (asked, 4))
    i, m, t, a = (np.array(rows, np.float64).reshape(-1, width) for rows, width in widths)
    return FlightLog(
        *(i[:, 0], i[:, 1], i[:, 2:5], i[:, 5:8], m[:, 0], m[:, 1], m[:, 2:5], m[:, 5:8]),
        *(t[:, 0], t[:, 1], t[:, 2:6], a[:, 0], a[:, 1:4], ()),
    )
