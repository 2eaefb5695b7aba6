"""Flights as PX4's own logs (.ulg): docs.px4.io, ULog File Format.

Topics and fields are PX4's own, with what its link has carried of them: `rebound_cli.logs.ulog` reads them back.
"""

import math
import struct
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any, TypeAlias

import numpy as np
import numpy.typing as npt

from companion import messages
from rebound_cli.logs.log import QUADROTOR, Log, LoggedSample
from rebound_cli.logs.ulog import NAV_STATES
from rebound_cli.replay.report import finding_data
from rebound_cli.report.shown_flight import ShownFlight
from rebound_cli.results.run_folder import HIT_KINDS
from rebound_cli.results.truth_match import FlightTruth

Floats = npt.NDArray[np.float64]
# Of a topic: numbers, or several of them, by their names.
Fields: TypeAlias = Mapping[str, Any]

_MAGIC = b"ULog\x01\x12\x35\x01"
_HEAD = struct.Struct("<HB")
_FLAG_BITS_SIZE = 40
# A value's type in the file, and how it is packed. Degrees of latitude and longitude need more than a float.
_KINDS = {bool: ("bool", "?"), int: ("uint64_t", "Q"), float: ("float", "f")}
_DOUBLE, _DOUBLES = ("double", "d"), ("lat", "lon")
# Of a logged message: Linux's levels, as digits.
_WARNING, _INFO = b"4", b"6"
_UNSET = (math.nan,) * 3
# MAV_STATE of a failsafe; vehicle_status.NAVIGATION_STATE_MAX, which is no mode.
_CRITICAL, _NO_MODE = 5, 31


@dataclass(frozen=True, slots=True)
class Row:
    """Of a topic at a time of PX4's clock; or, of no topic, a text and its level."""

    boot_us: int
    topic: str | None
    fields: Fields


def _path(position_ned_m: Sequence[float], velocity_ned_m_s: Sequence[float]) -> dict[str, Any]:
    return dict(zip(("x", "y", "z", "vx", "vy", "vz"), (*position_ned_m, *velocity_ned_m_s), strict=True))


def _topics(sample: messages.Sample) -> Iterator[tuple[str, Fields]]:
    """As PX4 logs it. What the link does not carry is NaN; a place and a velocity that it carries are valid."""
    match sample:
        case messages.ImuSample(_, force, rates):
            yield "sensor_combined", {"gyro_rad": rates, "accelerometer_m_s2": force}
        case messages.LocalPosition(_, position, velocity):
            valid = dict.fromkeys(("xy_valid", "z_valid", "v_xy_valid", "v_z_valid"), True)
            yield "vehicle_local_position", {**_path(position, velocity), **valid}
        case messages.Attitude(_, attitude, rates):
            yield "vehicle_attitude", {"q": attitude}
            yield "vehicle_angular_velocity", {"xyz": rates or _UNSET}
        case messages.AttitudeTarget(_, thrust, attitude):
            asked = attitude or (*_UNSET, math.nan)
            yield "vehicle_attitude_setpoint", {"q_d": asked, "thrust_body": (0.0, 0.0, -thrust)}
        case messages.Odometry(_, position, velocity, resets):
            yield "vehicle_odometry", {"position": position, "velocity": velocity, "reset_counter": resets}
        case messages.Vibration(_, gyro, accel, clipping):
            levels = {"gyro_vibration_metric": gyro, "accel_vibration_metric": accel}
            yield "vehicle_imu_status", {"accel_clipping": clipping, **levels}
        case messages.Heartbeat():
            kind = {"system_type": sample.vehicle_type, "failsafe": sample.system_status == _CRITICAL}
            state = NAV_STATES.get(sample.custom_mode, _NO_MODE)
            yield "vehicle_status", {"arming_state": 2 if sample.armed else 1, "nav_state": state, **kind}
        case messages.ExtendedState():
            yield "vehicle_land_detected", {"landed": sample.landed_state is messages.LandedState.ON_GROUND}
        case messages.GlobalPosition():
            place = {"lat": sample.latitude_deg, "lon": sample.longitude_deg, "alt": sample.altitude_m}
            yield "vehicle_global_position", place
        case messages.Sticks():
            sticks = dict(zip(("pitch", "roll", "throttle", "yaw"), sample.deflections, strict=True))
            yield "manual_control_setpoint", {**sticks, "aux1": math.nan, "aux2": math.nan}
        case messages.MotorOutputs(outputs=outputs):
            eight = [float(output) for output in (*outputs, *[0] * (8 - len(outputs)))]
            yield "actuator_outputs", {"noutputs": len(outputs), "output": eight}
        case messages.Battery():
            unknown = dict.fromkeys(("voltage_v", "current_a", "discharged_mah"), math.nan)
            yield "battery_status", {**unknown, "remaining": 0.01 * sample.remaining_percent}
        case messages.PositionTarget(position, down_m_s):
            velocity = (math.nan, math.nan, math.nan if down_m_s is None else down_m_s)
            yield "vehicle_local_position_setpoint", _path(position or _UNSET, velocity)


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
    for time_us, (_, level, text) in zip(boot_us(log, [at_us for at_us, *_ in texts]), texts, strict=True):
        yield Row(int(time_us), None, {"level": level, "text": text})
    for impact in flight.findings.impacts:
        # Words have no place in a topic: they are in the event's text.
        hit = {name: value for name, value in finding_data(impact).items() if not isinstance(value, str)}
        yield Row(impact.first.impact.sample_time_boot_us, "rebound_hit", hit)
    asked = flight.log
    for time_us, place in zip(boot_us(log, asked.setpoint_at_us), asked.setpoint_ned_m.tolist(), strict=True):
        yield Row(int(time_us), "rebound_setpoint", {"position_ned_m": place})


def new_ulog(flight: ShownFlight, log: Log) -> bytes:
    """A whole log of what was heard on the link, and of what the companion made of it."""
    heard = list(_with_modes(log))
    clock = boot_us(log, [one.at_us for one in heard])
    rows = [
        Row(getattr(one.sample, "time_boot_us", int(time_us)), topic, fields)
        for one, time_us in zip(heard, clock, strict=True)
        for topic, fields in _topics(one.sample)
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
    """As PX4 logs what a simulator knows."""
    if flight.truth is None:
        return
    series = flight.truth.series
    for row in true_rows(flight.truth, log):
        time_us = int(series["time_boot_us"][row])
        path = _path(series["position_ned_m"][row].tolist(), series["velocity_ned_m_s"][row].tolist())
        yield Row(time_us, "vehicle_local_position_groundtruth", path)
        yield Row(time_us, "vehicle_attitude_groundtruth", {"q": series["attitude_wxyz"][row].tolist()})


def written(rows: Sequence[Row], started_us: int, info: Mapping[str, bytes], parameters: Mapping[str, bytes]) -> bytes:
    """A whole log, its rows in the order of time. Keys of `info` and `parameters` begin with the value's type.

    The fields of a topic, and their types, are those of its first row; what is None is NaN.
    """
    head = [_MAGIC, struct.pack("<Q", started_us), _message("B", bytes(_FLAG_BITS_SIZE))]
    head += (_message("I", bytes([len(key)]) + key.encode() + value) for key, value in info.items())
    head += (_message("P", bytes([len(key)]) + key.encode() + value) for key, value in parameters.items())
    added, packers = [], dict[str, tuple[int, struct.Struct]]()
    for row in rows:
        if row.topic is not None and row.topic not in packers:
            kinds = [(name, len(_several(value)), _kind(name, value)) for name, value in row.fields.items()]
            fields = "".join(f"{kind}{f'[{n}]' if n > 1 else ''} {name};" for name, n, (kind, _) in kinds)
            head.append(_message("F", f"{row.topic}:uint64_t timestamp;{fields}".encode()))
            added.append(_message("A", struct.pack("<BH", 0, len(packers)) + row.topic.encode()))
            letters = "".join(f"{n}{letter}" for _, n, (_, letter) in kinds)
            packers[row.topic] = len(packers), struct.Struct(f"<HQ{letters}")
    data = (_data(row, packers) for row in sorted(rows, key=lambda row: row.boot_us))
    return b"".join([*head, *added, *data])


def _kind(name: str, value: Any) -> tuple[str, str]:
    return _DOUBLE if name in _DOUBLES else _KINDS.get(type(_several(value)[0]), _KINDS[float])


def _several(value: Any) -> Sequence[Any]:
    return value if isinstance(value, list | tuple) else (value,)


def _message(kind: str, content: bytes) -> bytes:
    return _HEAD.pack(len(content), ord(kind)) + content


def _data(row: Row, packers: Mapping[str, tuple[int, struct.Struct]]) -> bytes:
    if row.topic is None:
        return _message(
            "L", row.fields["level"] + struct.pack("<Q", row.boot_us) + row.fields["text"].encode("utf-8", "replace")
        )
    number, packer = packers[row.topic]
    values = (math.nan if one is None else one for value in row.fields.values() for one in _several(value))
    return _message("D", packer.pack(number, row.boot_us, *values))
