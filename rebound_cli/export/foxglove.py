"""A recorded flight for Foxglove: an MCAP file of JSON messages, with Foxglove's own schemas and ours.

Foxglove's scene has z up. Its topics are in two frames: `local` is ENU about the origin of the vehicle's local frame,
`vehicle` is FLU about its centre. Our own topics keep NED and FRD, as their fields' names say.
"""

import heapq
import json
import math
from collections.abc import Iterator, Sequence
from importlib import resources
from operator import itemgetter
from typing import IO, Any, TypeAlias

import numpy as np
import numpy.typing as npt
from mcap.writer import Writer

from companion.messages import Attitude, GlobalPosition, ImuSample, LocalPosition, Quaternion, Vector3
from rebound_cli import __version__
from rebound_cli.logs.log import Log
from rebound_cli.replay.report import finding_data
from rebound_cli.report.content import finite
from rebound_cli.report.scene import surfaces
from rebound_cli.report.shown_flight import ShownFlight
from rebound_cli.results.run_folder import HIT_KINDS
from rebound_cli.results.truth_match import FlightTruth
from sim_vehicle.mavlink.telemetry import quaternion_from_matrix
from sim_vehicle.world import Obstacle, Pole

Json: TypeAlias = dict[str, Any]
# When, on which topic, and what.
Message: TypeAlias = tuple[float, str, Json]

# Topics with a schema of Foxglove's. All others have one of ours, named after the topic.
_FOXGLOVE = {
    "/tf": "FrameTransform",
    "/pose": "PoseInFrame",
    "/truth": "PoseInFrame",
    **dict.fromkeys(("/scene", "/scene/moving", "/scene/surfaces", "/scene/hits"), "SceneUpdate"),
    "/location": "LocationFix",
    "/log": "Log",
}
# foxglove.LogLevel, PositionCovarianceType, LinePrimitive's LINE_STRIP.
_INFO, _WARNING, _UNKNOWN, _STRIP = 2, 3, 0, 0
# Okabe and Ito's colours, which the colour-blind tell apart.
_ORANGE, _BLUE, _PURPLE, _RED = (
    {"r": r, "g": g, "b": b, "a": a}
    for r, g, b, a in ((0.9, 0.6, 0.0, 1.0), (0.0, 0.45, 0.7, 0.8), (0.8, 0.6, 0.7, 0.5), (0.84, 0.37, 0.0, 1.0))
)
_PRIMITIVES = ("arrows", "cubes", "spheres", "cylinders", "lines", "triangles", "texts", "models")
_LEVEL: Quaternion = (1.0, 0.0, 0.0, 0.0)


def write_mcap(flight: ShownFlight, log: Log, file: IO[bytes]) -> None:
    """Whole, in the order of time."""
    foxglove = json.loads((resources.files(__package__) / "assets/foxglove.json").read_text("utf-8"))["schemas"]
    writer = Writer(file)
    writer.start(library=f"px4-rebound {__version__}")
    channels: dict[str, int] = {}
    # What is much comes as it is wanted: half an hour of it would not fit into a small computer's memory.
    told = sorted(_told(flight, log), key=itemgetter(0))
    for at_us, topic, data in heapq.merge(_heard(log), _truth(flight, log), told, key=itemgetter(0)):
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


def boot_us(log: Log, at_us: Sequence[float]) -> npt.NDArray[np.int64]:
    """The vehicle's clock at times of the log's: the newest heard IMU sample's, and what went by since."""
    imu = log.imu()
    heard = np.array([heard_us for heard_us, _ in imu], np.int64)
    sampled = np.array([sample.time_boot_us for _, sample in imu], np.int64)
    wanted = np.asarray(at_us).astype(np.int64)
    newest = np.maximum(np.searchsorted(heard, wanted, side="right") - 1, 0)
    times: npt.NDArray[np.int64] = sampled[newest] + wanted - heard[newest]
    return times


def _true_rows(truth: FlightTruth, log: Log) -> Sequence[int]:
    """Which rows of the simulator's truth are kept: as many as the vehicle says where it is."""
    times_us = truth.series["time_boot_us"]
    rows = np.unique(np.searchsorted(times_us, boot_us(log, _positions_us(log))))
    return [int(row) for row in rows if row < len(times_us)]


def _positions_us(log: Log) -> list[int]:
    """When the vehicle said where it is."""
    return [heard.at_us for heard in log.heard if isinstance(heard.sample, LocalPosition)]


def _heard(log: Log) -> Iterator[Message]:
    attitude = _LEVEL
    for heard in log.heard:
        at_us, sample = heard.at_us, heard.sample
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
            case GlobalPosition():
                yield at_us, "/location", _location(at_us, sample)


def _truth(flight: ShownFlight, log: Log) -> Iterator[Message]:
    if flight.truth is None:
        return
    series = flight.truth.series
    for row in _true_rows(flight.truth, log):
        at_us = float(flight.truth.at_us(float(series["time_boot_us"][row])))
        pose = _pose(series["position_ned_m"][row].tolist(), series["attitude_wxyz"][row].tolist())
        yield at_us, "/truth", {"timestamp": _time(at_us), "frame_id": "local", "pose": pose}


def _told(flight: ShownFlight, log: Log) -> Iterator[Message]:
    """What the companion made of it."""
    yield from _scene(flight, log)
    for at_us, place in zip(flight.log.setpoint_at_us.tolist(), flight.log.setpoint_ned_m.tolist(), strict=True):
        if math.isfinite(sum(place)):
            yield at_us, "/setpoint", {"position_ned_m": place}
    for event in flight.events:
        at_us, kind, text = float(event["time_us"]), str(event["kind"]), str(event.get("text", ""))
        yield at_us, "/event", {"kind": kind, "text": text, "data": event.get("data", {})}
        yield _log(at_us, _WARNING if kind in HIT_KINDS else _INFO, "rebound", f"{kind}: {text}")
    for at_us, text in flight.log.texts:
        yield _log(at_us, _INFO, "STATUSTEXT", text)
    for impact in flight.findings.impacts:
        yield impact.at_us, "/hit", finding_data(impact)


def _scene(flight: ShownFlight, log: Log) -> Iterator[Message]:
    """Whoever jumps to a time gets the latest message of each topic, so each has all that its topic draws by then:
    what stands and the vehicle, what moves, remembered surfaces, hits.
    """
    began_us, guards = flight.started_at_us, flight.config.estimate.guards
    size, aside_m = _xyz(2 * guards.radius_m, 2 * guards.radius_m, guards.height_m), math.sqrt(0.5) * guards.centre_m
    places = [_xyz(x, y, 0.0) for x in (aside_m, -aside_m) for y in (aside_m, -aside_m)]
    hoops = [_cylinder({"position": place, "orientation": _wxyz(*_LEVEL)}, size, _BLUE) for place in places]
    obstacles = [] if flight.scene is None else [obstacle for _, obstacle in flight.scene.obstacles()]
    standing = [_obstacle(began_us, one, (0.0, 0.0, 0.0)) for one in obstacles if one.motion is None]
    yield _update(began_us, "/scene", [_entity(began_us, "vehicle", "vehicle", cylinders=hoops), *standing])
    moving = [(one, one.motion) for one in obstacles if one.motion is not None]
    moving_us = _positions_us(log) if moving else []
    for at_us, boot_s in zip(moving_us, (boot_us(log, moving_us) * 1e-6).tolist(), strict=True):
        moved = [_obstacle(at_us, one, motion.offset_ned_m(boot_s)) for one, motion in moving]
        yield _update(at_us, "/scene/moving", moved)
    drawn = list[Json]()
    for number, surface in enumerate(surfaces(flight), start=1):
        corners = [_enu(corner) for corner in (*surface["corners"], surface["corners"][0])]
        at_us = began_us + 1e6 * surface["t"]
        until_us = None if surface["until"] is None else began_us + 1e6 * surface["until"]
        pose = {"position": _xyz(0.0, 0.0, 0.0), "orientation": _wxyz(*_LEVEL)}
        line = {"type": _STRIP, "pose": pose, "thickness": 3, "scale_invariant": True}
        line |= {"points": corners, "color": _PURPLE, "colors": [], "indices": []}
        drawn.append(_entity(at_us, f"surface {number}", until_us=until_us, lines=[line]))
        yield _update(at_us, "/scene/surfaces", drawn)
    arrows = list[Json]()
    for number, impact in enumerate(flight.findings.impacts, start=1):
        # The arrow points out of the surface, as long as the speed before the contact.
        speed_m_s = math.hypot(*impact.first.velocity_ned_m_s)
        sizes = {"shaft_length": speed_m_s, "shaft_diameter": 0.04, "head_length": 0.12, "head_diameter": 0.1}
        away = _along(impact.final.normal.direction_ned, 0)
        pose = {"position": _enu(impact.first.position_ned_m), "orientation": away}
        arrows.append(_entity(impact.at_us, f"hit {number}", arrows=[{"pose": pose, **sizes, "color": _RED}]))
        yield _update(impact.at_us, "/scene/hits", arrows)


# --- Foxglove's own messages --------------------------------------------------------------------------------------


def _fields(sample: ImuSample | LocalPosition) -> Json:
    return {name: getattr(sample, name) for name in sample.__slots__}


def _time(at_us: float) -> Json:
    return {"sec": int(at_us // 1_000_000), "nsec": round(at_us % 1_000_000) * 1000}


def _log(at_us: float, level: int, name: str, text: str) -> Message:
    nowhere = {"file": "", "line": 0}
    return at_us, "/log", {"timestamp": _time(at_us), "level": level, "message": text, "name": name, **nowhere}


def _location(at_us: float, sample: GlobalPosition) -> Json:
    place = {"latitude": sample.latitude_deg, "longitude": sample.longitude_deg, "altitude": sample.altitude_m}
    error = {"position_covariance": [0.0] * 9, "position_covariance_type": _UNKNOWN}
    return {"timestamp": _time(at_us), "frame_id": "vehicle", **place, **error}


def _update(at_us: float, topic: str, entities: Sequence[Json]) -> Message:
    return at_us, topic, {"deletions": [], "entities": list(entities)}


def _entity(at_us: float, name: str, frame: str = "local", until_us: float | None = None, **drawn: Any) -> Json:
    """One thing of the scene, in the place of what it was before; without `until_us` it stays."""
    return {
        "timestamp": _time(at_us),
        "frame_id": frame,
        "id": name,
        "metadata": [],
        "lifetime": _time(0.0 if until_us is None else until_us - at_us),
        "frame_locked": True,
        **{primitive: drawn.get(primitive, []) for primitive in _PRIMITIVES},
    }


def _obstacle(at_us: float, obstacle: Obstacle, moved_ned_m: Vector3) -> Json:
    """So far from where it was described."""
    name = f"obstacle {obstacle.name}"
    if isinstance(obstacle, Pole):
        middle = np.array(obstacle.foot_ned_m) + 0.5 * obstacle.height_m * np.array(obstacle.axis_ned) + moved_ned_m
        pose = {"position": _enu(middle.tolist()), "orientation": _along(obstacle.axis_ned, 2)}
        size = _xyz(2 * obstacle.radius_m, 2 * obstacle.radius_m, obstacle.height_m)
        return _entity(at_us, name, cylinders=[_cylinder(pose, size, _ORANGE)])
    centre = np.array(obstacle.centre_ned_m) + moved_ned_m
    pose = {"position": _enu(centre.tolist()), "orientation": _turn(obstacle.axes_ned)}
    return _entity(at_us, name, cubes=[{"pose": pose, "size": _xyz(*obstacle.sizes_m), "color": _ORANGE}])


def _cylinder(pose: Json, size: Json, color: Json) -> Json:
    return {"pose": pose, "size": size, "bottom_scale": 1, "top_scale": 1, "color": color}


def _pose(position_ned_m: Vector3, attitude_wxyz: Quaternion) -> Json:
    """Of the vehicle. From NED to ENU is half a turn about north-east, from FRD to FLU one about forward."""
    w, x, y, z = (math.sqrt(0.5) * part for part in attitude_wxyz)
    return {"position": _enu(position_ned_m), "orientation": _wxyz(w + z, x + y, x - y, w - z)}


def _along(direction_ned: Vector3, axis: int) -> Json:
    """The turn that lays this axis along a direction."""
    first = np.array(direction_ned)
    second = np.cross(first, np.eye(3)[np.argmin(np.abs(first))])
    second /= np.linalg.norm(second)
    axes = np.roll([first, second, np.cross(first, second)], axis, axis=0)
    return _turn(axes.tolist())


def _turn(axes_ned: Sequence[Sequence[float]]) -> Json:
    """That of a body with these axes; a body that looks the same both ways along its last one."""
    columns = np.array(axes_ned)[:, (1, 0, 2)] * (1.0, 1.0, -1.0)
    columns[2] *= np.sign(np.linalg.det(columns))
    return _wxyz(*quaternion_from_matrix(columns.T.tolist()))


def _enu(ned: Sequence[float]) -> Json:
    north, east, down = ned
    return _xyz(east, north, -down)


def _xyz(x: float, y: float, z: float) -> Json:
    return {"x": float(x), "y": float(y), "z": float(z)}


def _wxyz(w: float, x: float, y: float, z: float) -> Json:
    return {**_xyz(x, y, z), "w": float(w)}
