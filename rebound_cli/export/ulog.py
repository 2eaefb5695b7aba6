"""Flights as PX4's own logs (.ulg): docs.px4.io, ULog File Format.

Topics and fields are PX4's own, with what its link has carried of them: `rebound_cli.logs.ulog` reads them back.
"""

import math
import struct
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
import numpy.typing as npt

from companion import messages
from rebound_cli.logs.log import QUADROTOR, Demand, Log, LoggedSample
from rebound_cli.logs.ulog import NAV_STATES
from rebound_cli.replay.report import finding_data
from rebound_cli.report.shown_flight import ShownFlight
from rebound_cli.results.run_folder import HIT_KINDS
from rebound_cli.results.truth_match import FlightTruth

Floats = npt.NDArray[np.float64]

_MAGIC = b"ULog\x01\x12\x35\x01"
_HEAD = struct.Struct("<HB")
_FLAG_BITS_SIZE = 40
_LETTERS = {"float": "f", "double": "d", "uint8_t": "B", "uint32_t": "I", "uint64_t": "Q", "bool": "?"}
# Of a logged message: Linux's levels, as digits.
_WARNING, _INFO = b"4", b"6"
_UNSET = (math.nan,) * 3
# MAV_STATE of a failsafe; vehicle_status.NAVIGATION_STATE_MAX, which is no mode.
_CRITICAL, _NO_MODE = 5, 31

_POSITION = "float x;float y;float z;float vx;float vy;float vz"
_VALID = "bool xy_valid;bool z_valid;bool v_xy_valid;bool v_z_valid"
# Each sample as PX4 logs it: topic, fields after the timestamp, values. A quaternion turns body to NED. What the link
# does not carry is NaN; a place and a velocity that it carries are valid.
_TOPICS: Sequence[tuple[type, str, str, Any]] = (
    (
        messages.ImuSample,
        "sensor_combined",
        "float[3] gyro_rad;float[3] accelerometer_m_s2",
        lambda s: (*s.angular_velocity_frd_rad_s, *s.specific_force_frd_m_s2),
    ),
    (
        messages.LocalPosition,
        "vehicle_local_position",
        f"{_POSITION};{_VALID}",
        lambda s: (*s.position_ned_m, *s.velocity_ned_m_s, *(True,) * 4),
    ),
    (messages.Attitude, "vehicle_attitude", "float[4] q", lambda s: s.attitude_wxyz),
    (
        messages.Attitude,
        "vehicle_angular_velocity",
        "float[3] xyz",
        lambda s: s.angular_velocity_frd_rad_s or _UNSET,
    ),
    (
        messages.AttitudeTarget,
        "vehicle_attitude_setpoint",
        "float[4] q_d;float[3] thrust_body",
        lambda s: (*(s.attitude_wxyz or (*_UNSET, math.nan)), 0.0, 0.0, -s.thrust_fraction),
    ),
    (
        messages.Odometry,
        "vehicle_odometry",
        "float[3] position;float[3] velocity;uint8_t reset_counter",
        lambda s: (*s.position_ned_m, *s.velocity_ned_m_s, s.reset_counter),
    ),
    (
        messages.Vibration,
        "vehicle_imu_status",
        "uint32_t[3] accel_clipping;float gyro_vibration_metric;float accel_vibration_metric",
        lambda s: (*s.clipping_counts, s.gyroscope_rad_s, s.accelerometer_m_s2),
    ),
    (
        messages.Heartbeat,
        "vehicle_status",
        "uint8_t arming_state;uint8_t nav_state;uint8_t system_type;bool failsafe",
        lambda s: (
            2 if s.armed else 1,
            NAV_STATES.get(s.custom_mode, _NO_MODE),
            s.vehicle_type,
            s.system_status == _CRITICAL,
        ),
    ),
    (
        messages.ExtendedState,
        "vehicle_land_detected",
        "bool landed",
        lambda s: (s.landed_state is messages.LandedState.ON_GROUND,),
    ),
    (
        messages.GlobalPosition,
        "vehicle_global_position",
        "double lat;double lon;float alt",
        lambda s: (s.latitude_deg, s.longitude_deg, s.altitude_m),
    ),
    (
        messages.Sticks,
        "manual_control_setpoint",
        "float pitch;float roll;float throttle;float yaw;float aux1;float aux2",
        lambda s: (*s.deflections, math.nan, math.nan),
    ),
    (
        messages.MotorOutputs,
        "actuator_outputs",
        "uint32_t noutputs;float[8] output",
        lambda s: (len(s.outputs), *s.outputs, *[0.0] * (8 - len(s.outputs))),
    ),
    (
        messages.Battery,
        "battery_status",
        "float voltage_v;float current_a;float discharged_mah;float remaining",
        lambda s: (*_UNSET, 0.01 * s.remaining_percent),
    ),
    (
        Demand,
        "vehicle_local_position_setpoint",
        _POSITION,
        lambda s: (*(s.position_ned_m or _UNSET), *(s.velocity_ned_m_s or _UNSET)),
    ),
)
# As PX4 logs what a simulator knows.
_TRUE_POSITION = ("vehicle_local_position_groundtruth", _POSITION)
_TRUE_ATTITUDE = ("vehicle_attitude_groundtruth", "float[4] q")
_SETPOINT = ("rebound_setpoint", "float[3] position_ned_m")


@dataclass(frozen=True, slots=True)
class Row:
    """Of a topic at a time of PX4's clock; or, of no topic, a text and its level."""

    boot_us: int
    topic: tuple[str, str] | None
    values: Sequence[Any]


def boot_us(log: Log, at_us: Sequence[float] | Floats) -> npt.NDArray[np.int64]:
    """The vehicle's clock at times of the log's: the newest heard IMU sample's, and what went by since."""
    imu = log.imu()
    heard = np.array([heard_us for heard_us, _ in imu], np.int64)
    sampled = np.array([sample.time_boot_us for _, sample in imu], np.int64)
    wanted = np.asarray(at_us).astype(np.int64)
    newest = np.maximum(np.searchsorted(heard, wanted, side="right") - 1, 0)
    times: npt.NDArray[np.int64] = sampled[newest] + wanted - heard[newest]
    return times


def true_rows(truth: FlightTruth, log: Log) -> Sequence[int]:
    """Which rows of the simulator's truth are kept: as many as the vehicle says where it is."""
    times_us = truth.series["time_boot_us"]
    rows = np.unique(np.searchsorted(times_us, boot_us(log, positions_us(log))))
    return [int(row) for row in rows if row < len(times_us)]


def positions_us(log: Log) -> list[int]:
    """When the vehicle said where it is."""
    return [heard.at_us for heard in log.heard if isinstance(heard.sample, messages.LocalPosition)]


def _own_rows(flight: ShownFlight, log: Log) -> Iterator[Row]:
    """What was said, and what the companion knew and PX4 did not: its events, its hits, its setpoints."""
    texts = [(at_us, _INFO, text) for at_us, text in flight.log.texts]
    for event in flight.events:
        level = _WARNING if event["kind"] in HIT_KINDS else _INFO
        texts.append((event["time_us"], level, f"[rebound] {event.get('text', '')}"))
    for time_us, (_, *said) in zip(boot_us(log, [at_us for at_us, *_ in texts]), texts, strict=True):
        yield Row(int(time_us), None, said)
    for impact in flight.findings.impacts:
        # Words have no place in a topic: they are in the event's text.
        hit = {name: value for name, value in finding_data(impact).items() if not isinstance(value, str)}
        fields = ";".join(f"{_kind(value)} {name}" for name, value in hit.items())
        values = [math.nan if v is None else v for value in hit.values() for v in _several(value)]
        yield Row(impact.first.impact.sample_time_boot_us, ("rebound_hit", fields), values)
    asked = flight.log
    for time_us, place in zip(boot_us(log, asked.setpoint_at_us), asked.setpoint_ned_m.tolist(), strict=True):
        yield Row(int(time_us), _SETPOINT, place)


def _kind(value: Any) -> str:
    if isinstance(value, list):
        return f"float[{len(value)}]"
    return "bool" if isinstance(value, bool) else "uint64_t" if isinstance(value, int) else "float"


def _several(value: Any) -> Sequence[Any]:
    return value if isinstance(value, list) else [value]


def new_ulog(flight: ShownFlight, log: Log) -> bytes:
    """A whole log of what was heard on the link, and of what the companion made of it."""
    heard = list(_with_modes(log))
    clock = boot_us(log, [one.at_us for one in heard])
    rows = [
        Row(getattr(one.sample, "time_boot_us", int(time_us)), (name, fields), values(one.sample))
        for one, time_us in zip(heard, clock, strict=True)
        for kind, name, fields, values in _TOPICS
        if type(one.sample) is kind
    ]
    rows += _own_rows(flight, log)
    rows += _true_rows(flight, log)
    kinds = (one.sample.vehicle_type for one in heard if isinstance(one.sample, messages.Heartbeat))
    parameters = {"int32_t MAV_TYPE": struct.pack("<i", next(kinds, QUADROTOR))}
    return written(rows, min(row.boot_us for row in rows), {"char[7] sys_name": b"Rebound"}, parameters)


def _with_modes(log: Log) -> Iterator[LoggedSample]:
    """A mode that is told between two heartbeats is a state of the vehicle like theirs."""
    beat: messages.Heartbeat | None = None
    for heard in log.heard:
        if isinstance(heard.sample, messages.Heartbeat):
            beat = heard.sample
        if isinstance(heard.sample, messages.CurrentMode) and beat is not None:
            beat = replace(beat, custom_mode=heard.sample.custom_mode)
            heard = LoggedSample(heard.at_us, beat)
        yield heard


def _true_rows(flight: ShownFlight, log: Log) -> Iterator[Row]:
    if flight.truth is None:
        return
    series = flight.truth.series
    for row in true_rows(flight.truth, log):
        time_us = int(series["time_boot_us"][row])
        yield Row(time_us, _TRUE_POSITION, (*series["position_ned_m"][row], *series["velocity_ned_m_s"][row]))
        yield Row(time_us, _TRUE_ATTITUDE, series["attitude_wxyz"][row].tolist())


def written(rows: Sequence[Row], started_us: int, info: Mapping[str, bytes], parameters: Mapping[str, bytes]) -> bytes:
    """A whole log, its rows in the order of time. Keys of `info` and `parameters` begin with the value's type."""
    head = [_MAGIC, struct.pack("<Q", started_us), _message("B", bytes(_FLAG_BITS_SIZE))]
    head += (_message("I", bytes([len(key)]) + key.encode() + value) for key, value in info.items())
    head += (_message("P", bytes([len(key)]) + key.encode() + value) for key, value in parameters.items())
    topics = list(dict.fromkeys(row.topic for row in rows if row.topic is not None))
    numbers = {topic: number for number, topic in enumerate(topics)}
    formats = map(_format, topics)
    added = (_message("A", struct.pack("<BH", 0, number) + name.encode()) for (name, _), number in numbers.items())
    data = (_data(row, numbers) for row in sorted(rows, key=lambda row: row.boot_us))
    return b"".join([*head, *formats, *added, *data])


def _message(kind: str, content: bytes) -> bytes:
    return _HEAD.pack(len(content), ord(kind)) + content


def _format(topic: tuple[str, str]) -> bytes:
    name, fields = topic
    return _message("F", f"{name}:uint64_t timestamp;{fields};".encode())


def _data(row: Row, numbers: Mapping[tuple[str, str], int]) -> bytes:
    if row.topic is None:
        level, text = row.values
        return _message("L", level + struct.pack("<Q", row.boot_us) + text.encode("utf-8", "replace"))
    kinds = (field.split()[0].rstrip("]").partition("[") for field in row.topic[1].split(";"))
    letters = "".join((count or "1") + _LETTERS[kind] for kind, _, count in kinds)
    return _message("D", struct.pack("<HQ" + letters, numbers[row.topic], row.boot_us, *row.values))
