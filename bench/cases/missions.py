"""A whole random mission from its seed: room, wind, stream, what moves or stands in the way, items, policies."""

import math
from dataclasses import dataclass
from functools import lru_cache
from pathlib import Path
from typing import Any

from bench.cases.draw import DIGITS, Draw, towards
from bench.cases.items import LOWEST_M, Route, motion_item, policy, quiet_item
from bench.cases.rooms import MAX_HEIGHT_M, DrawnRoom, draw_room
from bench.cases.vehicles import companion_settings, drawn_vehicle
from companion.errors import ReboundError
from companion.mission.model import Mission
from rebound_cli.inputs.documents import load_document
from rebound_cli.inputs.inputs import with_guards
from sim_vehicle.airframe import Airframe, built_in_airframes, with_base
from sim_vehicle.errors import SceneError
from sim_vehicle.scene import Scene, check_start_is_free

Part = dict[str, Any]


# PX4's IMU_INTEG_RATE on a flight controller; asked for more, it sends every sample. And its default onboard stream.
STREAMS_HZ = {200: 250.0, 50: 50.0}
INTEGRATION_INTERVAL_US = 5_000
WIND_MAX_M_S = 5.0
# A gust or something that moves comes in this part of the flight; take-off begins 5 s after the start.
EVENTFUL_S = (8.0, 16.0)
# Not where it could press the vehicle against a wall behind it.
ROOMS_WITH_CARTS = ("free walls", "poles", "boxes")
# Higher than where the detector is switched on, by the vehicle's own height.
LOWEST_BEAM_M = 0.9
# Drawn anew when the mission's ways leave its fence or something stands where it starts: one in a hundred.
MOST_TRIES = 50


class NoMissionError(ReboundError):
    """A seed for which no mission was found."""


@dataclass(frozen=True, slots=True)
class MissionCase:
    """Everything that is not here is drawn from the seed."""

    seed: int
    airframe: str
    is_drawn: bool = False
    """Whether the vehicle, too, is drawn from the seed: one of the airframe's kind, with other numbers."""


@dataclass(frozen=True, slots=True)
class RandomMission:
    """A mission file's content, and what its tables sort it by."""

    data: Part
    room: str
    stream_hz: int
    wind_m_s: float
    extras: tuple[str, ...]


def airframe_data(case: MissionCase) -> Part:
    """The airframe file: a drawn one, one's own, or a built-in one with PX4's integration interval on a flight
    controller."""
    if case.is_drawn:
        return drawn_vehicle(case.seed, case.airframe)
    if case.airframe not in built_in_airframes():
        return load_document(Path(case.airframe)).data
    return {"based_on": case.airframe, "imu": {"integration_interval_us": INTEGRATION_INTERVAL_US}}


def random_mission(case: MissionCase) -> RandomMission:
    """The same room and mission for both airframes. Raises NoMissionError."""
    for attempt in range(MOST_TRIES):
        drawn = _draw(case, Draw(case.seed, attempt))
        try:
            Mission.model_validate(drawn.data)
            check_start_is_free(Scene.model_validate(drawn.data["sim"]), airframe_of(case))
        except (ValueError, SceneError):
            continue
        return drawn
    raise NoMissionError(f"seed {case.seed}: none of {MOST_TRIES} missions can be flown")


def flyable(case: MissionCase, drawn: RandomMission) -> tuple[Mission, Scene, Airframe]:
    """What `lockstep` flies of it."""
    airframe = airframe_of(case)
    mission = Mission.model_validate(with_guards(drawn.data, airframe))
    return mission, Scene.model_validate(drawn.data["sim"]), airframe


@lru_cache
def airframe_of(case: MissionCase) -> Airframe:
    return Airframe.model_validate(with_base(airframe_data(case)))


def _draw(case: MissionCase, draw: Draw) -> RandomMission:
    room = draw_room(draw)
    stream_hz = draw.one_of(list(STREAMS_HZ))
    wind, wind_m_s = _wind(draw)
    height_m = draw.number(1.0, min(2.2, room.highest_m))
    extras = ["beam over the start"] if draw.happens(0.05) and _over_start(room, draw, height_m) else []
    route = Route(draw, room, (0.0, 0.0), height_m)
    items: list[Part] = [{"takeoff": {"height_m": height_m}}]
    for _ in range(draw.whole(1, 3)):
        item = motion_item(route)
        if draw.happens(0.15):
            item["on_collision"] = policy(draw)
        items += [quiet for quiet in (quiet_item(route),) if quiet is not None]
        items.append(item)
    if room.kind in ROOMS_WITH_CARTS and draw.happens(0.12):
        extras.append(_cart(room, draw, route))
        items.append({"hold": {"duration_s": 4.0}})
    if draw.happens(0.06):
        items[-1:] = [{"repeat": {"times": 2, "items": [items[-1], {"hold": {"duration_s": 0.5}}]}}]
    items.append(_last(draw, room))
    follows, interrupted, yaw_deg = policy(draw), draw.one_of(("hold", "land")), float(draw.whole(-180, 180))
    out_of_reach = draw.one_of(("land", "return", "continue", "abort"), (3.0, 3.0, 3.0, 1.0))
    if "land" in items[-1] and draw.happens(0.1):
        extras.append(_block(room, draw, route))
    data: Part = {
        "name": f"random-{case.seed}",
        "description": f"{room.kind}, {stream_hz} Hz, wind up to {wind_m_s:g} m/s, seed {case.seed}",
        "items": items,
        "on_collision": follows,
        "obstacles": {"on_unreachable": out_of_reach},
        "on_interrupt": interrupted,
        "fence": room.fence,
        "companion": {
            "streams": {"highres_imu_hz": STREAMS_HZ[stream_hz]},
            **(companion_settings(airframe_of(case)) if case.is_drawn else {}),
        },
        "sim": {
            "airframe": case.airframe,
            "seed": case.seed,
            "start": {"yaw_deg": yaw_deg},
            **wind,
            **room.obstacles(),
        },
    }
    return RandomMission(data, room.kind, stream_hz, wind_m_s, tuple(extras))


def _wind(draw: Draw) -> tuple[Part, float]:
    """Steady, and with a gust now and then; both together at most `WIND_MAX_M_S`."""
    most_m_s = draw.number(0.0, WIND_MAX_M_S)
    share = draw.number(0.3, 0.9) if draw.happens(0.4) else 1.0
    way = draw.heading()
    steady = [round(share * most_m_s * part, DIGITS) for part in (math.cos(way), math.sin(way), 0.0)]
    found: Part = {"wind_ned_m_s": steady}
    if share < 1.0:
        extra = [round((1.0 - share) * most_m_s * part, DIGITS) for part in (math.cos(way), math.sin(way), 0.0)]
        begins_s = draw.number(*EVENTFUL_S)
        found["faults"] = [
            {"kind": "gust", "between_s": [begins_s, begins_s + draw.whole(2, 4)], "velocity_ned_m_s": extra}
        ]
    return found, most_m_s


def _over_start(room: DrawnRoom, draw: Draw, height_m: float) -> bool:
    """A level beam that the climb meets off-centre. Not where a ceiling leaves no way beside it."""
    if room.ceiling_m is not None or height_m < LOWEST_BEAM_M + 0.5:
        return False
    way = draw.heading()
    foot = towards(towards((0.0, 0.0), way, -2.0), way + 0.5 * math.pi, draw.number(-0.25, 0.25))
    axis = [round(math.cos(way), 6), round(math.sin(way), 6), 0.0]
    place = [*foot, -draw.number(LOWEST_BEAM_M, height_m - 0.4)]
    beam = {"name": "beam", "point_ned_m": place, "axis_ned": axis, "height_m": 4.0, "radius_m": draw.number(0.03, 0.1)}
    room.poles.append(beam)
    return True


def _cart(room: DrawnRoom, draw: Draw, route: Route) -> str:
    """A box that comes to where the vehicle would hover, through free air, and goes away again."""
    way, speed_m_s = draw.heading(), draw.number(0.5, 2.0)
    far_m, size_m = draw.number(4.0, 6.0), draw.number(0.4, 1.0)
    n, e = towards(route.place_ne_m, way, far_m)
    reach_m = far_m - 0.5 * size_m
    begins_s = draw.number(*EVENTFUL_S)
    there_s = round(begins_s + reach_m / speed_m_s, DIGITS)
    offset = [round(-reach_m * math.cos(way), DIGITS), round(-reach_m * math.sin(way), DIGITS), 0.0]
    path = [
        {"at_s": begins_s, "offset_ned_m": [0.0, 0.0, 0.0]},
        {"at_s": there_s, "offset_ned_m": offset},
        {"at_s": there_s + 1.0, "offset_ned_m": offset},
        {"at_s": round(there_s + 1.0 + reach_m / speed_m_s, DIGITS), "offset_ned_m": [0.0, 0.0, 0.0]},
    ]
    centre = [n, e, -max(route.height_m, 0.5 * size_m + 0.05)]
    box = {
        "name": "cart",
        "centre_ned_m": centre,
        "size_m": [size_m, size_m, size_m],
        "yaw_deg": draw.number(0.0, 90.0),
    }
    room.boxes.append(box | {"motion": {"path": path}})
    return "cart"


def _block(room: DrawnRoom, draw: Draw, route: Route) -> str:
    """A low block on the edge of which a guard comes down, by less than its half."""
    size = [draw.number(0.4, 1.0), draw.number(0.4, 1.0), draw.number(0.2, 0.5)]
    way = draw.heading()
    n, e = towards(route.place_ne_m, way, 0.5 * size[0] + draw.number(0.14, 0.2))
    centre = [n, e, round(-0.5 * size[2], DIGITS)]
    room.boxes.append({"name": "block", "centre_ned_m": centre, "size_m": size, "yaw_deg": round(math.degrees(way), 1)})
    return "block at the landing"


def _last(draw: Draw, room: DrawnRoom) -> Part:
    if draw.happens(0.5):
        return {"land": {}}
    highest_m = min(room.highest_m, MAX_HEIGHT_M)
    height = {"height_m": draw.number(LOWEST_M, highest_m)} if draw.happens(0.5) else {}
    return {"return": height | {"speed_m_s": draw.number(0.8, 2.5)}}
