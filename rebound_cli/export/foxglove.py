"""A recorded flight for Foxglove: an MCAP file of JSON messages, with Foxglove's own schemas and ours.

Foxglove's scene has z up. Its topics are in two frames: `local` is ENU about the origin of the vehicle's local frame,
`vehicle` is FLU about its centre. Our own topics keep NED and FRD, as their fields' names say.
"""

import heapq
import json
import math
from collections.abc import Iterator, Mapping
from importlib import resources
from operator import itemgetter
from typing import IO, Any, TypeAlias

import numpy as np
from mcap.writer import Writer

from companion.messages import Attitude, GpsFix, ImuSample, LocalPosition, Quaternion, Vector3
from rebound_cli import __version__
from rebound_cli.logs.log import Log
from rebound_cli.replay.listening import FORCES, Numbers
from rebound_cli.replay.watching import Finding
from rebound_cli.report.content import finite, heard_at_us
from rebound_cli.report.shown_flight import ShownFlight
from rebound_cli.results.run_folder import HIT_KINDS

Json: TypeAlias = dict[str, Any]
# When, on which topic, and what.
Message: TypeAlias = tuple[float, str, Json]

# Topics with a schema of Foxglove's. All others have one of ours, named after the topic.
_FOXGLOVE = {
    "/tf": "FrameTransform",
    "/pose": "PoseInFrame",
    "/truth": "PoseInFrame",
    "/location": "LocationFix",
    "/log": "Log",
}
# foxglove.LogLevel, PositionCovarianceType.
_INFO, _WARNING, _UNKNOWN = 2, 3, 0
_LEVEL: Quaternion = (1.0, 0.0, 0.0, 0.0)


def write_mcap(flight: ShownFlight, log: Log, file: IO[bytes]) -> None:
    """Whole, in the order of time."""
    foxglove = json.loads((resources.files(__package__) / "assets/foxglove.json").read_text("utf-8"))["schemas"]
    writer = Writer(file)
    writer.start(library=f"px4-rebound {__version__}")
    channels: dict[str, int] = {}
    # What is much comes as it is wanted: half an hour of it would not fit into a small computer's memory.
    told = sorted(_told(flight), key=itemgetter(0))
    streams = (_heard(log), _truth(flight, log), *_test_ratios(flight), told)
    for at_us, topic, data in heapq.merge(*streams, key=itemgetter(0)):
        if topic not in channels:
            name = f"foxglove.{_FOXGLOVE[topic]}" if topic in _FOXGLOVE else f"rebound.{topic[1:]}"
            schema = json.dumps(foxglove.get(name) or {"title": name, **_kind(data)}).encode()
            schema_id = writer.register_schema(name, "jsonschema", schema)
            channels[topic] = writer.register_channel(topic, "json", schema_id)
        at_ns = round(at_us) * 1000
        writer.add_message(channels[topic], at_ns, json.dumps(finite(data), allow_nan=False).encode(), at_ns)
    writer.finish()  # type: ignore[no-untyped-call]


def _kind(value: Any) -> Json:
    """The schema of what is like this. Each event has data of its own: nothing is said of them."""
    match value:
        case dict():
            return {"type": "object", "properties": {key: _kind(one) for key, one in value.items() if key != "data"}}
        case list() | tuple():
            return {"type": "array", "items": {"type": "number"}}
        case bool():
            return {"type": "boolean"}
        case int() | float():
            return {"type": "number"}
        case str():
            return {"type": "string"}
    return {}


def _heard(log: Log) -> Iterator[Message]:
    attitude = _LEVEL
    for at_us, sample in log.heard:
        match sample:
            case Attitude():
                attitude = sample.attitude_wxyz
            case LocalPosition():
                yield at_us, "/local_position", _fields(sample)
                pose = _pose(sample.position_ned_m, attitude)
                yield at_us, "/pose", {"timestamp": _time(at_us), "frame_id": "local", "pose": pose}
                moved = {"translation": pose["position"], "rotation": pose["orientation"]}
                frames = {"parent_frame_id": "local", "child_frame_id": "vehicle"}
                yield at_us, "/tf", {"timestamp": _time(at_us), **frames, **moved}
            case ImuSample():
                yield at_us, "/imu", _fields(sample)
            case GpsFix():
                place = {"latitude": sample.latitude_deg, "longitude": sample.longitude_deg}
                error = {"position_covariance": [0.0] * 9, "position_covariance_type": _UNKNOWN}
                head = {"timestamp": _time(at_us), "frame_id": "vehicle"}
                yield at_us, "/location", {**head, **place, "altitude": sample.altitude_m, **error}


def _truth(flight: ShownFlight, log: Log) -> Iterator[Message]:
    if flight.truth is None:
        return
    series, times_us = flight.truth.series, flight.truth.at_us(flight.truth.series["time_boot_us"])
    # As often as the vehicle says where it is.
    told_us = [heard.at_us for heard in log.heard if isinstance(heard.sample, LocalPosition)]
    rows = np.unique(np.searchsorted(times_us, told_us))
    for row in rows[rows < len(times_us)].tolist():
        at_us = float(times_us[row])
        pose = _pose(series["position_ned_m"][row].tolist(), series["attitude_wxyz"][row].tolist())
        yield at_us, "/truth", {"timestamp": _time(at_us), "frame_id": "local", "pose": pose}


def _test_ratios(flight: ShownFlight) -> tuple[Iterator[Message], Iterator[Message]]:
    """As EKF2 publishes its own: the square of an innovation over its limit."""
    forces, jumps = flight.findings.listener.forces.all(), flight.findings.listener.velocities.all()
    of_forces = dict(zip(("side", "vertical", "turn"), map(forces.ratio_of, FORCES), strict=True))
    return (
        _squares(flight, "/test_ratio/force", forces.time_boot_us, of_forces),
        _squares(flight, "/test_ratio/velocity", jumps.time_boot_us, {"jump": jumps.ratio}),
    )


def _squares(flight: ShownFlight, topic: str, boot_us: Numbers, ratios: Mapping[str, Numbers]) -> Iterator[Message]:
    squares = np.square(np.fmax(0.0, np.asarray(list(ratios.values())))).T.tolist()
    for at_us, row in zip(heard_at_us(flight, boot_us).tolist(), squares, strict=True):
        yield at_us, topic, dict(zip(ratios, row, strict=True))


def _told(flight: ShownFlight) -> Iterator[Message]:
    """What the companion made of it."""
    for at_us, place in zip(flight.log.setpoint_at_us.tolist(), flight.log.setpoint_ned_m.tolist(), strict=True):
        if math.isfinite(sum(place)):
            yield at_us, "/setpoint", {"position_ned_m": place}
    for event in flight.events:
        at_us, kind, text = float(event["time_us"]), str(event["kind"]), str(event.get("text", ""))
        yield at_us, "/event", {"kind": kind, "text": text, "data": event.get("data", {})}
        yield _log(at_us, _WARNING if HIT_KINDS.get(kind) == 1 else _INFO, "rebound", f"{kind}: {text}")
    for at_us, text in flight.log.texts:
        yield _log(at_us, _INFO, "STATUSTEXT", text)
    for impact in flight.findings.impacts:
        yield impact.at_us, "/hit", _hit(impact)


def _hit(finding: Finding) -> Json:
    """What was known in the end, of the state before it."""
    first, final = finding.first, finding.final
    return {
        "is_collision": finding.is_collision,
        "kind": final.impact.kind.value,
        "evidence": first.impact.evidence.value,
        "specific_force_frd_m_s2": first.impact.specific_force_frd_m_s2,
        "threshold_m_s2": finding.threshold_m_s2,
        "velocity_ned_m_s": first.velocity_ned_m_s,
        "position_ned_m": first.position_ned_m,
        "normal_ned": final.normal.direction_ned,
        "peak_specific_force_m_s2": final.peak_specific_force_m_s2,
        "impulse_m_s": final.impulse_m_s,
        "is_lower_bound": final.is_lower_bound,
    }


# --- Foxglove's own messages --------------------------------------------------------------------------------------


def _fields(sample: ImuSample | LocalPosition) -> Json:
    return {name: getattr(sample, name) for name in sample.__slots__}


def _time(at_us: float) -> Json:
    return {"sec": int(at_us // 1_000_000), "nsec": round(at_us % 1_000_000) * 1000}


def _log(at_us: float, level: int, name: str, text: str) -> Message:
    nowhere = {"file": "", "line": 0}
    return at_us, "/log", {"timestamp": _time(at_us), "level": level, "message": text, "name": name, **nowhere}


def _pose(position_ned_m: Vector3, attitude_wxyz: Quaternion) -> Json:
    """Of the vehicle. From NED to ENU is half a turn about north-east, from FRD to FLU one about forward."""
    north, east, down = position_ned_m
    w, x, y, z = (math.sqrt(0.5) * part for part in attitude_wxyz)
    return {"position": _xyz(east, north, -down), "orientation": {**_xyz(x + y, x - y, w - z), "w": w + z}}


def _xyz(x: float, y: float, z: float) -> Json:
    return {"x": float(x), "y": float(y), "z": float(z)}
