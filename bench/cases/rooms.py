"""Random rooms: what stands around a vehicle that starts at the origin, and the fence that its mission is given."""

import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from bench.cases.draw import DIGITS, Draw, NorthEast, towards

Part = dict[str, Any]

# Nothing but what is meant to be in the way of the take-off stands nearer to the start than this: guards reach 0.2 m.
START_CLEAR_M = 0.7
# Walls reach this high where nothing else is said; no mission flies over one by accident.
WALL_HEIGHT_M = 6.0
MAX_HEIGHT_M = 5.0
OPEN_FENCE_M = 14.0
# Where a room's walls are the fence, setpoints stay this far off them: the guards' reach and 0.1 m.
FENCE_OFF_WALLS_M = 0.3


@dataclass(slots=True)
class DrawnRoom:
    """Obstacles as a mission's `sim:` part has them. Heights are above the ground."""

    kind: str
    walls: list[Part] = field(default_factory=list)
    poles: list[Part] = field(default_factory=list)
    boxes: list[Part] = field(default_factory=list)
    fence: Part = field(default_factory=lambda: {"radius_m": OPEN_FENCE_M, "max_height_m": MAX_HEIGHT_M})
    aims: list[NorthEast] = field(default_factory=list)
    """Places on obstacles: to fly at one of them is to hit something."""
    inside_m: float = 6.0
    """Goals that shall be free are drawn within this distance of the start."""
    ceiling_m: float | None = None

    @property
    def is_fenced_by_walls(self) -> bool:
        return "polygon_ne_m" in self.fence

    @property
    def highest_m(self) -> float:
        """How high a free way may lie: half a metre below the ceiling."""
        return 2.6 if self.ceiling_m is None else self.ceiling_m - 0.5

    def obstacles(self) -> Mapping[str, list[Part]]:
        parts = {"walls": self.walls, "poles": self.poles, "boxes": self.boxes}
        return {name: found for name, found in parts.items() if found}


def draw_room(draw: Draw) -> DrawnRoom:
    """One of the kinds, with more in it now and then."""
    room = draw.one_of(list(KINDS))(draw)
    if draw.happens(0.3):
        _add_poles(room, draw, draw.whole(1, 2))
    if room.ceiling_m is None and draw.happens(0.25):
        _add_ceiling(room, draw)
    return room


def wall(name: str, foot_ne_m: NorthEast, facing_rad: float, width_m: float, lean_rad: float = 0.0) -> Part:
    """Upright, or leaning: with a positive angle its face looks downwards."""
    level = math.cos(lean_rad)
    normal = [level * math.cos(facing_rad), level * math.sin(facing_rad), math.sin(lean_rad)]
    return {
        "name": name,
        "point_ned_m": [*foot_ne_m, -0.5 * WALL_HEIGHT_M],
        "normal_ned": [round(part, 6) for part in normal],
        "width_m": width_m,
        "height_m": WALL_HEIGHT_M,
    }


def _closed(draw: Draw) -> DrawnRoom:
    """Four walls, none of them quite square, somewhere around the start; the fence is often the room itself."""
    room = DrawnRoom("closed room")
    turn = draw.heading()
    ahead, behind, right, left = (draw.number(1.5, 4.5) for _ in range(4))
    reach = [(ahead, right), (-behind, right), (-behind, -left), (ahead, -left)]
    corners = []
    for along, across in reach:
        n, e = towards(towards((0.0, 0.0), turn, along), turn + 0.5 * math.pi, across)
        corners.append((round(n + draw.number(-0.2, 0.2), DIGITS), round(e + draw.number(-0.2, 0.2), DIGITS)))
    for number, (a, b) in enumerate(zip(corners, corners[1:] + corners[:1], strict=True)):
        middle = (round(0.5 * (a[0] + b[0]), DIGITS), round(0.5 * (a[1] + b[1]), DIGITS))
        along = math.atan2(b[1] - a[1], b[0] - a[0])
        # Corners go round clockwise as seen from above, so that inside is to the right of each edge.
        room.walls.append(
            wall(f"wall {number + 1}", middle, along + 0.5 * math.pi, round(math.dist(a, b) + 0.2, DIGITS))
        )
        room.aims.append(middle)
    room.aims += corners
    room.inside_m = min(ahead, behind, right, left) - 0.7
    if draw.happens(0.5):
        _add_ceiling(room, draw)
    if draw.happens(0.4):
        room.fence = {"polygon_ne_m": _shrunk(corners), "max_height_m": room.highest_m + 0.2}
    return room


def _free_walls(draw: Draw) -> DrawnRoom:
    """One to three walls of any width, standing anywhere at any angle, some leaning."""
    room = DrawnRoom("free walls")
    for number in range(draw.whole(1, 3)):
        bearing, distance_m = draw.heading(), draw.number(2.0, 5.0)
        slant = math.radians(draw.number(-60.0, 60.0))
        lean = math.radians(draw.number(-20.0, 20.0)) if draw.happens(0.3) else 0.0
        foot = towards((0.0, 0.0), bearing, distance_m)
        width_m = draw.number(0.8, 6.0)
        clear_m = distance_m * math.cos(slant) - 0.5 * WALL_HEIGHT_M * abs(math.tan(lean))
        if clear_m < START_CLEAR_M + 0.3:
            slant = lean = 0.0
        room.walls.append(wall(f"wall {number + 1}", foot, bearing + math.pi + slant, width_m, lean))
        room.aims.append(foot)
    return room


def _corner(draw: Draw) -> DrawnRoom:
    """Two walls that meet at 60 to 130 degrees, the start between them."""
    room = DrawnRoom("corner")
    bearing, distance_m = draw.heading(), draw.number(2.5, 5.0)
    half = math.radians(draw.number(30.0, 65.0))
    apex = towards((0.0, 0.0), bearing, distance_m)
    length_m = draw.number(3.0, 6.0)
    for name, side in (("left wall", -1.0), ("right wall", 1.0)):
        along = bearing + math.pi - side * half
        middle = towards(apex, along, 0.5 * length_m)
        room.walls.append(wall(name, middle, along + side * 0.5 * math.pi, length_m))
    room.aims += [
        apex,
        apex,
        towards(apex, bearing + math.pi - half, 1.0),
        towards(apex, bearing + math.pi + half, 1.0),
    ]
    return room


def _corridor(draw: Draw) -> DrawnRoom:
    """Two walls that face each other, 2 to 4.5 m apart."""
    room = DrawnRoom("corridor")
    along, width_m = draw.heading(), draw.number(2.0, 4.5)
    right_m = draw.number(0.9, width_m - 0.9)
    for name, side, off_m in (("right wall", 1.0, right_m), ("left wall", -1.0, width_m - right_m)):
        across = along + side * 0.5 * math.pi
        foot = towards((0.0, 0.0), across, off_m)
        room.walls.append(wall(name, foot, across + math.pi, 14.0))
        room.aims += [towards(foot, along, draw.number(-4.0, 4.0)) for _ in range(3)]
    room.inside_m = min(right_m, width_m - right_m) - 0.5
    return room


def _poles(draw: Draw) -> DrawnRoom:
    room = DrawnRoom("poles")
    _add_poles(room, draw, draw.whole(3, 7))
    return room


def _boxes(draw: Draw) -> DrawnRoom:
    """Pillars, cupboards and low blocks."""
    room = DrawnRoom("boxes")
    for number in range(draw.whole(1, 3)):
        size = [draw.number(0.3, 1.5), draw.number(0.3, 1.5), draw.number(0.6, 5.0)]
        half_m = 0.5 * math.hypot(size[0], size[1])
        place = towards((0.0, 0.0), draw.heading(), START_CLEAR_M + half_m + draw.number(0.8, 4.0))
        box = {"name": f"box {number + 1}", "centre_ned_m": [*place, round(-0.5 * size[2], DIGITS)]}
        room.boxes.append(box | {"size_m": size, "yaw_deg": draw.number(0.0, 90.0)})
        room.aims.append(place)
    return room


KINDS: tuple[Callable[[Draw], DrawnRoom], ...] = (_closed, _free_walls, _corner, _corridor, _poles, _boxes)


def _add_poles(room: DrawnRoom, draw: Draw, count: int) -> None:
    for _ in range(count):
        place = towards((0.0, 0.0), draw.heading(), draw.number(START_CLEAR_M + 0.6, 5.0))
        radius_m = draw.number(0.02, 0.3)
        pole = {"name": f"pole {len(room.poles) + 1}", "point_ned_m": [*place, 0.0], "radius_m": radius_m}
        room.poles.append(pole | {"height_m": draw.number(3.0, 6.0)})
        room.aims.append(place)


def _add_ceiling(room: DrawnRoom, draw: Draw) -> None:
    """Level, or tilted by up to 5 degrees, over everything."""
    room.ceiling_m = draw.number(2.4, 3.4)
    tilt, way = math.radians(draw.number(0.0, 5.0)) if draw.happens(0.3) else 0.0, draw.heading()
    normal = [math.sin(tilt) * math.cos(way), math.sin(tilt) * math.sin(way), math.cos(tilt)]
    room.walls.append(
        {
            "name": "ceiling",
            "point_ned_m": [0.0, 0.0, -room.ceiling_m],
            "normal_ned": [round(part, 6) for part in normal],
            "width_m": 30.0,
            "height_m": 30.0,
        }
    )


def _shrunk(corners: list[NorthEast]) -> list[list[float]]:
    """The corners of a room whose walls all stand `FENCE_OFF_WALLS_M` further in."""
    shrunk = []
    for number, corner in enumerate(corners):
        before, after = corners[number - 1], corners[(number + 1) % len(corners)]
        inward = np.array([_inward(before, corner), _inward(corner, after)])
        n, e = np.array(corner) + np.linalg.solve(inward, np.full(2, FENCE_OFF_WALLS_M))
        shrunk.append([round(float(n), DIGITS), round(float(e), DIGITS)])
    return shrunk


def _inward(a: NorthEast, b: NorthEast) -> NorthEast:
    """Unit normal of an edge, to its right."""
    length_m = math.dist(a, b)
    return -(b[1] - a[1]) / length_m, (b[0] - a[0]) / length_m
