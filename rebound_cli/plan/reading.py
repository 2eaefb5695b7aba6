"""A .plan as the data of a mission file. QGroundControl's developer guide describes the format ("Plan File Format")."""

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field
from typing import Any

from companion.errors import ConfigurationError
from companion.mavlink.encode import command_name
from companion.messages import Vector3
from companion.mission.items import MAX_SPEED_M_S
from rebound_cli.plan import commands
from rebound_cli.plan.fences import fence_of_plan
from rebound_cli.plan.shape import Item, PlanShape, SimpleItem, whole_plan
from sim_vehicle.geography import Origin
from sim_vehicle.hil.messages import Place

# Nearer to each other than this, two places of a plan are one: GPS knows no better.
_SAME_PLACE_M = 0.5


class PlanError(ConfigurationError):
    """The file is no plan, or asks for something that a mission cannot do."""


@dataclass(frozen=True, slots=True)
class PlanItem:
    """One command; parameters that are null in the file are None."""

    jump_id: int
    command: int
    frame: int
    parameters: tuple[float | None, ...]

    def value(self, number: int) -> float:
        """MAVLink's param1 to param7; 0 where the plan says nothing."""
        return self.parameters[number - 1] or 0.0


@dataclass(slots=True)
class _Mission:
    """The mission as far as it has been read."""

    origin: Origin
    items: list[dict[str, Any]] = field(default_factory=list)
    # Where the items of each plan item begin, for jumps.
    begins: dict[int, int] = field(default_factory=dict)
    place_ned_m: Vector3 = (0.0, 0.0, 0.0)
    furthest_m: float = 0.0
    highest_m: float = 0.0
    notes: list[str] = field(default_factory=list)

    def go_to(self, place_ned_m: Vector3, yaw_deg: float | None = None) -> None:
        self.note_place(place_ned_m)
        item: dict[str, Any] = {"position_ned_m": _rounded(place_ned_m)}
        if yaw_deg is not None:
            item["yaw_deg"] = round(math.remainder(yaw_deg, 360.0), 1)
        self.items.append({"go_to": item})

    def note_place(self, place_ned_m: Vector3) -> None:
        self.place_ned_m = place_ned_m
        self.furthest_m = max(self.furthest_m, math.hypot(*place_ned_m[:2]))
        self.highest_m = max(self.highest_m, -place_ned_m[2])


def mission_of_plan(plan: Any, name: str) -> tuple[dict[str, Any], Sequence[str]]:
    """The content of a mission file and notes on what was left out or put in. Raises PlanError."""
    if not isinstance(plan, dict) or plan.get("fileType") != "Plan" or not isinstance(plan.get("mission"), dict):
        raise PlanError("this is no plan of QGroundControl: it has no fileType 'Plan' and mission.")
    try:
        whole = whole_plan(plan)
    except ValueError as fault:
        raise PlanError(f"this is no whole plan of QGroundControl: {fault}.") from fault
    mission = _Mission(Origin(_home(whole.mission.plannedHomePosition)))
    items = list(_items(whole.mission.items))
    if not items:
        raise PlanError("the plan has no items.")
    _take_off(mission, items, whole.mission.hoverSpeed)
    for item in items:
        mission.begins[item.jump_id] = len(mission.items)
        _add(mission, item)
    if not ({"land", "return"} & mission.items[-1].keys()):
        mission.items.append({"return": {}})
        mission.notes.append("the plan does not land: a return was put at its end")
    mission.notes += _left_out(whole)
    fence, fence_notes = fence_of_plan(whole.geoFence, mission.origin, mission.furthest_m, mission.highest_m)
    data = {"name": name, "items": mission.items, "fence": fence}
    return data, [*mission.notes, *fence_notes]


def _left_out(plan: PlanShape) -> Iterator[str]:
    """What of a plan is not of its items."""
    if plan.rallyPoints is not None and plan.rallyPoints.points:
        yield "left out: rally points; a mission returns to where the vehicle was armed"
    if (plan.mission.vehicleType or commands.QUADROTOR) not in commands.MULTICOPTERS:
        yield "the plan was made for another kind of vehicle: only multicopters are flown"


def _home(home: Sequence[float] | None) -> Place:
    if home is None or len(home) < 2:
        raise PlanError("the plan has no plannedHomePosition, to which its places could be related.")
    return Place(home[0], home[1], home[2] if len(home) > 2 else 0.0)


def _items(items: Sequence[Item]) -> Iterator[PlanItem]:
    """Simple items, and those that surveys and other patterns are made of."""
    for number, item in enumerate(items, start=1):
        if item.type == "SimpleItem":
            yield _plan_item(item)
            continue
        parts = item.TransectStyleComplexItem.Items
        if parts is None:
            kind = item.complexItemType or item.type
            raise PlanError(f"item {number} of the plan is a '{kind}', whose way the file does not state.")
        yield from map(_plan_item, parts)


def _plan_item(item: SimpleItem) -> PlanItem:
    if item.params is None or len(item.params) != 7 or item.command is None or item.frame is None:
        raise PlanError(f"item {item.doJumpId or '?'} of the plan is not complete.")
    return PlanItem(item.doJumpId, item.command, item.frame, tuple(item.params))


def _take_off(mission: _Mission, items: Sequence[PlanItem], speed_m_s: float | None) -> None:
    """A mission begins with one: the plan's own comes later to the front, one of ours is put in now."""
    if all(item.command != commands.TAKEOFF for item in items):
        first = next((item for item in items if item.command == commands.WAYPOINT), None)
        place = None if first is None else _place(mission, first)
        if place is None:
            raise PlanError("the plan has neither a take-off nor a waypoint.")
        mission.items.append({"takeoff": {"height_m": round(-place[2], 3)}})
        mission.note_place((0.0, 0.0, place[2]))
        mission.notes.append("the plan does not take off: a take-off to the height of its first waypoint was put in")
    if speed_m_s is not None and speed_m_s > 0.0:
        mission.items.append({"set_speed": {"speed_m_s": _speed(mission, speed_m_s)}})


def _add(mission: _Mission, item: PlanItem) -> None:
    match item.command:
        case commands.TAKEOFF:
            _add_takeoff(mission, item)
        case commands.WAYPOINT | commands.LOITER_TIME:
            mission.go_to(_needed_place(mission, item), item.parameters[3])
            if item.value(1) > 0.0:
                mission.items.append({"hold": {"duration_s": item.value(1)}})
        case commands.LOITER_TURNS:
            _add_orbit(mission, item)
        case commands.DELAY | commands.CONDITION_DELAY:
            if item.value(1) <= 0.0:
                raise PlanError(f"item {item.jump_id} of the plan waits for a time of day; give it a delay.")
            mission.items.append({"hold": {"duration_s": item.value(1)}})
        case commands.CONDITION_YAW:
            if item.value(4) != 0.0:
                raise PlanError(f"item {item.jump_id} of the plan turns by an angle; give it a heading.")
            mission.items.append({"set_yaw": {"yaw_deg": item.value(1)}})
        case commands.CHANGE_SPEED:
            if item.value(2) > 0.0:
                mission.items.append({"set_speed": {"speed_m_s": _speed(mission, item.value(2))}})
        case commands.JUMP:
            _add_jump(mission, item)
        case commands.RETURN_TO_LAUNCH:
            mission.items.append({"return": {}})
        case commands.LAND:
            place = _place(mission, item)
            if place is not None and math.dist(place[:2], mission.place_ned_m[:2]) > _SAME_PLACE_M:
                mission.go_to((place[0], place[1], mission.place_ned_m[2]))
            mission.items.append({"land": {}})
        case command if command in commands.BESIDE_THE_WAY:
            mission.notes.append(f"left out: item {item.jump_id}, command {command_name(command)} for camera or gimbal")
        case command:
            raise PlanError(
                f"item {item.jump_id} of the plan is command {command_name(command)}, which a mission cannot do."
            )


def _add_takeoff(mission: _Mission, item: PlanItem) -> None:
    height_m = _height_m(mission, item)
    # a set_speed may have been put in before it
    mission.items.insert(0, {"takeoff": {"height_m": round(height_m, 3)}})
    mission.note_place((0.0, 0.0, -height_m))
    place = _place(mission, item)
    if place is not None and math.hypot(*place[:2]) > _SAME_PLACE_M:
        mission.go_to(place, item.parameters[3])


def _add_orbit(mission: _Mission, item: PlanItem) -> None:
    north_m, east_m, down_m = centre = _needed_place(mission, item)
    radius_m, turns = abs(item.value(3)), abs(item.value(1))
    if radius_m == 0.0 or turns == 0.0:
        raise PlanError(f"item {item.jump_id} of the plan circles without a radius or a number of turns.")
    orbit: dict[str, Any] = {"centre_ned_m": _rounded(centre), "radius_m": radius_m, "turns": turns}
    if item.value(3) < 0.0:
        orbit["clockwise"] = False
    mission.items.append({"orbit": orbit})
    outward = math.hypot(north_m, east_m) + radius_m
    mission.furthest_m = max(mission.furthest_m, outward)
    mission.note_place((north_m, east_m, down_m))


def _add_jump(mission: _Mission, item: PlanItem) -> None:
    """Back to an item, so many times: what lies between is repeated."""
    begin, again = mission.begins.get(int(item.value(1))), int(item.value(2))
    if begin is None or again < 0:
        raise PlanError(f"item {item.jump_id} of the plan jumps forwards or for ever, which a mission cannot do.")
    repeated = mission.items[begin:]
    if again == 0 or not repeated:
        return
    if any({"takeoff", "land", "return"} & part.keys() for part in repeated):
        raise PlanError(f"item {item.jump_id} of the plan repeats a take-off or a landing.")
    mission.items[begin:] = [{"repeat": {"times": again + 1, "items": repeated}}]
    mission.begins = {jump_id: place for jump_id, place in mission.begins.items() if place <= begin}


def _rounded(place_ned_m: Vector3) -> list[float]:
    """To a millimetre; adding 0.0 turns a -0.0 into 0.0."""
    return [round(axis, 3) + 0.0 for axis in place_ned_m]


def _speed(mission: _Mission, speed_m_s: float) -> float:
    if speed_m_s <= MAX_SPEED_M_S:
        return speed_m_s
    mission.notes.append(f"a speed of {speed_m_s:g} m/s became {MAX_SPEED_M_S:g} m/s")
    return MAX_SPEED_M_S


def _place(mission: _Mission, item: PlanItem) -> Vector3 | None:
    """Mission coordinates of an item that has a place."""
    latitude_deg, longitude_deg = item.parameters[4], item.parameters[5]
    if latitude_deg is None or longitude_deg is None or (latitude_deg, longitude_deg) == (0.0, 0.0):
        return None
    home_m = mission.origin.place.altitude_m
    place = Place(latitude_deg, longitude_deg, home_m + _height_m(mission, item))
    return mission.origin.position_of(place)


def _needed_place(mission: _Mission, item: PlanItem) -> Vector3:
    place = _place(mission, item)
    if place is None:
        raise PlanError(f"item {item.jump_id} of the plan has no place.")
    return place


def _height_m(mission: _Mission, item: PlanItem) -> float:
    """Above home."""
    if item.frame in commands.FRAME_ABOVE_HOME:
        return item.value(7)
    if item.frame in commands.FRAME_ABOVE_SEA:
        return item.value(7) - mission.origin.place.altitude_m
    raise PlanError(f"item {item.jump_id} of the plan has its height above the terrain, which is not known here.")
