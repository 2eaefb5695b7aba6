"""What stands in a flight's scene, moves in it and is remembered of it, by the flight's clock: for all who draw it."""

import math
from typing import Any

from companion.memory.patch import Patch
from companion.memory.surroundings import assumed_area
from rebound_cli.report.shown_flight import ShownFlight
from rebound_cli.results.run_folder import EVENTS_NAME, reading
from sim_vehicle.world import Obstacle, Pole

# From ahead to the right, as PX4 counts the motors of a quad-x.
QUAD_X = [math.radians(degrees) for degrees in (45.0, 225.0, -45.0, 135.0)]


def rounded_s(flight: ShownFlight, at_us: float) -> float:
    """To the microsecond."""
    return round(flight.seconds(at_us), 6)


def modes(flight: ShownFlight) -> list[tuple[float, str]]:
    """The vehicle's flight modes from when on."""
    return [
        (rounded_s(flight, event["time_us"]), event["text"].removeprefix("mode "))
        for event in flight.events
        if event["kind"] == "mode" and str(event.get("text", "")).startswith("mode ")
    ]


def recovering(flight: ShownFlight) -> list[tuple[float, float]]:
    """From each hit that was answered until it was recovered from, or the next one, or the end."""
    told = [(event["kind"], rounded_s(flight, event["time_us"])) for event in flight.events]
    spans = []
    for number, (kind, at_s) in enumerate(told):
        if kind == "detection":
            ends = (end_s for end, end_s in told[number + 1 :] if end in ("recovered", "unconfirmed", "detection"))
            spans.append((at_s, next(ends, flight.ended_s)))
    return spans


def obstacles(flight: ShownFlight) -> list[dict[str, Any]]:
    scene = flight.scene
    return [] if scene is None else [_obstacle(flight, obstacle) for _, obstacle in scene.obstacles()]


def _obstacle(flight: ShownFlight, obstacle: Obstacle) -> dict[str, Any]:
    motion = None
    if obstacle.motion is not None and flight.truth is not None:
        # By the page's own clock.
        times_s = [rounded_s(flight, flight.truth.at_us(time_s * 1e6)) for time_s in obstacle.motion.times_s]
        motion = {"t": times_s, "offsets": obstacle.motion.offsets_ned_m}
    if isinstance(obstacle, Pole):
        shape = {"foot": obstacle.foot_ned_m, "axis": obstacle.axis_ned, "radius": obstacle.radius_m}
        return {"name": obstacle.name, "kind": "pole", "height": obstacle.height_m, **shape, "motion": motion}
    shape = {"centre": obstacle.centre_ned_m, "axes": obstacle.axes_ned, "sizes": obstacle.sizes_m}
    return {"name": obstacle.name, "kind": "box", **shape, "motion": motion}


def surfaces(flight: ShownFlight) -> list[dict[str, Any]]:
    """What was believed of each surface from when until when: from each touch of it to the next."""
    with reading(EVENTS_NAME):
        told = [
            (rounded_s(flight, event["time_us"]), Patch.model_validate(event["data"]))
            for event in flight.events
            if event["kind"] == "obstacle"
        ]
    known = [(0.0, patch) for patch in flight.patches if patch.found_at_us < flight.started_at_us]
    shown = []
    for number, (since_s, patch) in enumerate([*known, *told]):
        later = [*known, *told][number + 1 :]
        until_s = next((at_s for at_s, one in later if patch.touches_ned_m[0] in one.touches_ned_m), None)
        shown.append({"t": since_s, "until": until_s, "corners": _corners(flight, patch)})
    return shown


def _corners(flight: ShownFlight, patch: Patch) -> list[list[float]]:
    """In the vehicle's local frame; a wall's in its plane, a ceiling's or a floor's at its height."""
    origin = flight.origin_ned_m
    if patch.is_steep:
        outline = assumed_area(patch, 0.0).exterior.coords[:-1]
        corners = [(north, east, patch.centre_ned_m[2]) for north, east in outline]
    else:
        (left_m, right_m), (low_m, high_m) = patch.assumed_along_m(), patch.assumed_heights_m()
        around = ((left_m, low_m), (right_m, low_m), (right_m, high_m), (left_m, high_m))
        corners = [(*patch.place_ne_m(along_m), -height_m) for along_m, height_m in around]
    return [[round(p + o, 4) for p, o in zip(corner, origin, strict=True)] for corner in corners]


def vehicle(flight: ShownFlight) -> dict[str, Any]:
    """`arms`: where each ends, ahead and to the right, in the order of PX4's motors."""
    guards = flight.config.estimate.guards
    arms = flight.rotors_frd_m or [(guards.centre_m * math.cos(way), guards.centre_m * math.sin(way)) for way in QUAD_X]
    return {"arms": arms, "centre": guards.centre_m, "radius": guards.radius_m, "height": guards.height_m}
