"""`rebound plan import`: a .plan as a mission file, which goes to standard output, and notes beside it."""

import json
import math
import re
import sys
from argparse import Namespace
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import Any

import yaml

from companion.errors import ConfigurationError
from companion.mavlink.encode import command_name
from companion.messages import Vector3
from companion.mission.items import MAX_SPEED_M_S
from rebound_cli.documents import Document, parse_document, validated, write_text
from rebound_cli.inputs import mission_from
from rebound_cli.plan import shape
from rebound_cli.plan.shape import PlanShape, SimpleItem
from sim_vehicle.geography import Origin, Place

# Nearer to each other than this, two places of a plan are one: GPS knows no better.
_SAME_PLACE_M = 0.5
# A plan that states no fence gets one this much wider and higher than what it flies.
_MARGIN_M = 5.0
_MARGIN_UP_M = 2.0
# A circle whose centre is nearer to home than this is one around home.
_AT_HOME_M = 1.0
# Any other circle becomes a polygon inside it, at most 1 % narrower.
_CIRCLE_CORNERS = 24


def run_import(options: Namespace) -> int:
    path: Path = options.plan
    try:
        plan = json.loads(path.read_text(encoding="utf-8"))
    except ValueError as error:
        raise ConfigurationError(f"{path}: not JSON, so no plan of QGroundControl: {error}.") from error
    name = options.name or re.sub(r"[^A-Za-z0-9._-]+", "-", path.stem).strip("-") or "mission"
    try:
        data, notes = mission_of_plan(plan, name)
    except ConfigurationError as error:
        raise ConfigurationError(f"{path}: {error}") from error
    # Lists and maps of plain values stand on a line.
    written = yaml.safe_dump(data, sort_keys=False, default_flow_style=None, allow_unicode=True)
    text = f"# From {path.name}, a plan of QGroundControl.\n{written}"
    # What is written can be flown: a plan that leaves its own fence is refused here and not at the field.
    mission_from(parse_document(text, f"the mission from {path}"))
    for note in notes:
        print(f"note: {note}", file=sys.stderr)
    if options.out is None:
        print(text, end="")
    else:
        write_text(options.out, text)
        print(f"written to {options.out}", file=sys.stderr)
    return 0


def mission_of_plan(plan: Any, name: str) -> tuple[dict[str, Any], Sequence[str]]:
    """The content of a mission file and notes on what was left out or put in.

    Raises ConfigurationError where the file is no plan, or asks for something that a mission cannot do.
    """
    if not isinstance(plan, dict) or plan.get("fileType") != "Plan" or not isinstance(plan.get("mission"), dict):
        raise ConfigurationError("this is no plan of QGroundControl: it has no fileType 'Plan' and mission.")
    whole = validated(PlanShape, Document("this is no whole plan of QGroundControl"), plan)
    reader = _Reader(whole)
    return {"name": name, "items": reader.items, "fence": reader.fence(whole.geoFence)}, reader.notes


def _simple_items(plan: PlanShape) -> Iterator[SimpleItem]:
    """Simple items, and those that surveys and other patterns are made of."""
    for number, item in enumerate(plan.mission.items, start=1):
        if isinstance(item, SimpleItem):
            yield item
            continue
        parts = item.TransectStyleComplexItem.Items
        if parts is None:
            kind = item.complexItemType or item.type or "pattern"
            raise ConfigurationError(f"item {number} of the plan is a '{kind}', whose way the file does not state.")
        yield from parts


def _refusal(item: SimpleItem, why: str) -> ConfigurationError:
    return ConfigurationError(f"item {item.doJumpId} of the plan {why}.")


class _Reader:
    """The mission as far as it has been read."""

    def __init__(self, plan: PlanShape) -> None:
        latitude_deg, longitude_deg, *altitude_m = plan.mission.plannedHomePosition
        self._origin = Origin(Place(latitude_deg, longitude_deg, altitude_m[0] if altitude_m else 0.0))
        self.items: list[dict[str, Any]] = []
        self.notes: list[str] = []
        self._begins: dict[int, int] = {}  # where the items of each plan item begin, for jumps
        self._place_ned_m: Vector3 = (0.0, 0.0, 0.0)
        self._furthest_m = self._highest_m = 0.0
        items = list(_simple_items(plan))
        self._begin(items, plan.mission.hoverSpeed)
        for item in items:
            self._begins[item.doJumpId] = len(self.items)
            self._add(item)
        if not {"land", "return"} & self.items[-1].keys():
            self.items.append({"return": {}})
            self.notes.append("the plan does not land: a return was put at its end")
        if plan.rallyPoints and plan.rallyPoints.get("points"):
            self.notes.append("left out: rally points; a mission returns to where the vehicle was armed")

    def _begin(self, items: Sequence[SimpleItem], speed_m_s: float | None) -> None:
        """A mission begins with a take-off: the plan's own comes later to the front, one of ours is put in now."""
        if all(item.command != shape.TAKEOFF for item in items):
            first = next((item for item in items if item.command == shape.WAYPOINT), None)
            place = None if first is None else self._place(first)
            if place is None:
                raise ConfigurationError("the plan has neither a take-off nor a waypoint.")
            self._take_off(-place[2])
            self.notes.append("the plan does not take off: a take-off to the height of its first waypoint was put in")
        if speed_m_s is not None:
            self._set_speed(speed_m_s)

    def _add(self, item: SimpleItem) -> None:
        match item.command:
            case shape.TAKEOFF:
                self._take_off(self._height_m(item))
                place = self._place(item)
                if place is not None and math.hypot(*place[:2]) > _SAME_PLACE_M:
                    self._go_to(place, item.params[3])
            case shape.WAYPOINT | shape.LOITER_TIME:
                self._go_to(self._needed_place(item), item.params[3])
                if item.value(1) > 0.0:
                    self.items.append({"hold": {"duration_s": item.value(1)}})
            case shape.LOITER_TURNS:
                self._orbit(item)
            case shape.DELAY | shape.CONDITION_DELAY:
                if item.value(1) <= 0.0:
                    raise _refusal(item, "waits for a time of day; give it a delay")
                self.items.append({"hold": {"duration_s": item.value(1)}})
            case shape.CONDITION_YAW:
                if item.value(4) != 0.0:
                    raise _refusal(item, "turns by an angle; give it a heading")
                self.items.append({"set_yaw": {"yaw_deg": item.value(1)}})
            case shape.CHANGE_SPEED:
                self._set_speed(item.value(2))
            case shape.JUMP:
                self._jump(item)
            case shape.RETURN_TO_LAUNCH:
                self.items.append({"return": {}})
            case shape.LAND:
                place = self._place(item)
                if place is not None and math.dist(place[:2], self._place_ned_m[:2]) > _SAME_PLACE_M:
                    self._go_to((place[0], place[1], self._place_ned_m[2]))
                self.items.append({"land": {}})
            case command if command in shape.BESIDE_THE_WAY:
                name = command_name(command)
                self.notes.append(f"left out: item {item.doJumpId}, command {name} for camera or gimbal")
            case command:
                raise _refusal(item, f"is command {command_name(command)}, which a mission cannot do")

    def _take_off(self, height_m: float) -> None:
        # A set_speed may have been put in before it.
        self.items.insert(0, {"takeoff": {"height_m": round(height_m, 3)}})
        self._be_at((0.0, 0.0, -height_m))

    def _go_to(self, place_ned_m: Vector3, yaw_deg: float | None = None) -> None:
        self._be_at(place_ned_m)
        yaw = {} if yaw_deg is None else {"yaw_deg": round(math.remainder(yaw_deg, 360.0), 1)}
        self.items.append({"go_to": {"position_ned_m": _rounded(place_ned_m), **yaw}})

    def _be_at(self, place_ned_m: Vector3, around_m: float = 0.0) -> None:
        self._place_ned_m = place_ned_m
        self._furthest_m = max(self._furthest_m, math.hypot(*place_ned_m[:2]) + around_m)
        self._highest_m = max(self._highest_m, -place_ned_m[2])

    def _set_speed(self, speed_m_s: float) -> None:
        if speed_m_s > MAX_SPEED_M_S:
            self.notes.append(f"a speed of {speed_m_s:g} m/s became {MAX_SPEED_M_S:g} m/s")
        if speed_m_s > 0.0:
            self.items.append({"set_speed": {"speed_m_s": min(speed_m_s, MAX_SPEED_M_S)}})

    def _orbit(self, item: SimpleItem) -> None:
        centre, radius_m, turns = self._needed_place(item), abs(item.value(3)), abs(item.value(1))
        if radius_m == 0.0 or turns == 0.0:
            raise _refusal(item, "circles without a radius or a number of turns")
        way = {"clockwise": False} if item.value(3) < 0.0 else {}
        self.items.append({"orbit": {"centre_ned_m": _rounded(centre), "radius_m": radius_m, "turns": turns, **way}})
        self._be_at(centre, around_m=radius_m)

    def _jump(self, item: SimpleItem) -> None:
        """Back to an item, so many times: what lies between is repeated."""
        begin, again = self._begins.get(int(item.value(1))), int(item.value(2))
        if begin is None or again < 0:
            raise _refusal(item, "jumps forwards or for ever, which a mission cannot do")
        repeated = self.items[begin:]
        if again == 0 or not repeated:
            return
        if any({"takeoff", "land", "return"} & part.keys() for part in repeated):
            raise _refusal(item, "repeats a take-off or a landing")
        self.items[begin:] = [{"repeat": {"times": again + 1, "items": repeated}}]
        self._begins = {jump_id: place for jump_id, place in self._begins.items() if place <= begin}

    def _place(self, item: SimpleItem) -> Vector3 | None:
        """Mission coordinates of an item that has a place."""
        latitude_deg, longitude_deg = item.params[4:6]
        if latitude_deg is None or longitude_deg is None or (latitude_deg, longitude_deg) == (0.0, 0.0):
            return None
        altitude_m = self._origin.place.altitude_m + self._height_m(item)
        return self._origin.position_of(Place(latitude_deg, longitude_deg, altitude_m))

    def _needed_place(self, item: SimpleItem) -> Vector3:
        place = self._place(item)
        if place is None:
            raise _refusal(item, "has no place")
        return place

    def _height_m(self, item: SimpleItem) -> float:
        """Above home."""
        if item.frame in shape.FRAME_ABOVE_HOME:
            return item.value(7)
        if item.frame in shape.FRAME_ABOVE_SEA:
            return item.value(7) - self._origin.place.altitude_m
        raise _refusal(item, "has its height above the terrain, which is not known here")

    def fence(self, written: shape.GeoFence | None) -> dict[str, Any]:
        """The mission's. Raises ConfigurationError for a fence that a mission cannot have."""
        fence = written or shape.GeoFence()
        if not all(part.inclusion for part in (*fence.circles, *fence.polygons)):
            raise ConfigurationError(
                "the plan has a fence that keeps out, which a mission does not know: leave it out."
            )
        if len(fence.circles) + len(fence.polygons) > 1:
            raise ConfigurationError("the plan has several fences, and a mission has one: leave one.")
        top_m = math.ceil(self._highest_m + _MARGIN_UP_M)
        if not fence.circles and not fence.polygons:
            radius_m = math.ceil(self._furthest_m + _MARGIN_M)
            self.notes.append(f"the plan has no fence: one of {radius_m} m and {top_m} m up was put in")
            return {"radius_m": radius_m, "max_height_m": top_m}
        self.notes.append(f"a plan's fence has no top: {top_m} m was put in")
        if fence.polygons:
            return {"polygon_ne_m": [self._ne_m(corner) for corner in fence.polygons[0].polygon], "max_height_m": top_m}
        circle = fence.circles[0].circle
        north_m, east_m = self._ne_m(circle.center)
        if math.hypot(north_m, east_m) < _AT_HOME_M:
            return {"radius_m": circle.radius, "max_height_m": top_m}
        angles = [math.tau * corner / _CIRCLE_CORNERS for corner in range(_CIRCLE_CORNERS)]
        sides = [(circle.radius * math.cos(angle), circle.radius * math.sin(angle)) for angle in angles]
        corners = [[round(north_m + north, 3), round(east_m + east, 3)] for north, east in sides]
        return {"polygon_ne_m": corners, "max_height_m": top_m}

    def _ne_m(self, corner: tuple[float, float]) -> list[float]:
        return _rounded(self._origin.position_of(Place(*corner, self._origin.place.altitude_m)))[:2]


def _rounded(place_ned_m: Vector3) -> list[float]:
    """To a millimetre; adding 0.0 turns a -0.0 into 0.0."""
    return [round(axis, 3) + 0.0 for axis in place_ned_m]
