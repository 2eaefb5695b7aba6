"""What the vehicle can run into: ground, walls, poles and boxes, as the rows that the contact kernel reads.

Every solid is made of two things: flat rectangles that face one way, and rounds, which are all that is nearer to a
line than a radius. A pole is one round. A box is six rectangles and twelve rounds along its edges; a plate is a box
that its edges round off completely, so two rectangles and four rounds.
"""

import math
from dataclasses import dataclass, replace

import numpy as np

from sim_vehicle.quantities import Floats, Ints, Vector3, vector

GROUND = "ground"

# Columns of a row of `World.faces`, all NED; row 0 is the ground. Unit vectors across and along a flat face.
FACE_POINT, FACE_NORMAL, FACE_ACROSS, FACE_ALONG = 0, 3, 6, 9
FACE_HALF_WIDTH, FACE_HALF_HEIGHT = 12, 13
# A round has a radius, its line's middle in FACE_POINT, direction in FACE_ALONG, half length in FACE_HALF_HEIGHT.
# The rounds of an edge push only outward of both faces that meet there.
FACE_RADIUS, FACE_OUTWARD, FACE_OUTWARD_TOO = 14, FACE_NORMAL, FACE_ACROSS
# 1: the round's end is a ball that pushes. Where three edges meet, one of them has the corner.
FACE_HAS_ENDS = 15
# 1: flat and level enough to stand on: feet meet it.
FACE_MEETS_FEET = 16
FACE_VELOCITY = 17
FACE_COLUMNS = 20

# No edge in the world is sharper or blunter than it must be: a plate of 10 cm has a half-round rim, a box this much.
EDGE_RADIUS_M = 0.05
BOX_EDGE_RADIUS_M = 0.02
# A face within 45 degrees of level is a floor or a ceiling.
_LEVEL = math.sqrt(0.5)


@dataclass(frozen=True, slots=True)
class Motion:
    """Where an obstacle is, against where it was described: straight from point to point, then at rest."""

    times_s: tuple[float, ...]
    """Of the vehicle's boot clock, rising."""
    offsets_ned_m: tuple[Vector3, ...]

    def offset_ned_m(self, time_s: float) -> Vector3:
        """Offset at a time; before the first and after the last time that of the first and last."""
        x, y, z = (float(np.interp(time_s, self.times_s, axis)) for axis in zip(*self.offsets_ned_m, strict=True))
        return x, y, z

    def later(self, seconds: float) -> "Motion":
        """The same motion, begun later."""
        return replace(self, times_s=tuple(time_s + seconds for time_s in self.times_s))


@dataclass(frozen=True, slots=True)
class Box:
    """A solid with six rectangular sides and rounded edges."""

    name: str
    centre_ned_m: Vector3
    axes_ned: tuple[Vector3, Vector3, Vector3]
    """Unit vectors at right angles to each other."""
    sizes_m: Vector3
    """Extent along each of the axes."""
    edge_radius_m: float = BOX_EDGE_RADIUS_M
    motion: Motion | None = None

    def distance_m(self, position_ned_m: Vector3) -> float:
        """From a point to the nearest point of the solid, its edges taken as sharp; 0 inside."""
        local = np.abs(np.array(self.axes_ned) @ (np.array(position_ned_m) - np.array(self.centre_ned_m)))
        return float(np.linalg.norm(np.maximum(local - 0.5 * np.array(self.sizes_m), 0.0)))


def plate(
    name: str,
    point_ned_m: Vector3,
    normal_ned: Vector3,
    size_m: tuple[float, float],
    thickness_m: float,
    motion: Motion | None = None,
) -> Box:
    """A wall, ceiling or floor by its front face: the centre, the unit vector out of it, width and height.

    The width is level; of a ceiling or a floor it goes along east.
    """
    normal = np.array(normal_ned)
    across, along = _face_axes(normal)
    return Box(
        name,
        vector(np.array(point_ned_m) - 0.5 * thickness_m * normal),
        (normal_ned, vector(across), vector(along)),
        (thickness_m, *size_m),
        EDGE_RADIUS_M,
        motion,
    )


@dataclass(frozen=True, slots=True)
class Pole:
    """A round bar: upright, level or slanted."""

    name: str
    foot_ned_m: Vector3
    axis_ned: Vector3
    """Unit vector from the foot to the top."""
    height_m: float
    radius_m: float
    motion: Motion | None = None

    def ends(self) -> tuple[Floats, Floats]:
        """Both ends of its axis: the foot stands on something, the top is a half ball below the stated height."""
        foot, axis = np.array(self.foot_ned_m), np.array(self.axis_ned)
        return foot, foot + max(self.height_m - self.radius_m, 0.0) * axis

    def distance_m(self, position_ned_m: Vector3) -> float:
        """From a point to the nearest point of the solid; 0 inside."""
        foot, top = self.ends()
        axis = np.array(self.axis_ned)
        offset = np.array(position_ned_m) - foot
        nearest = float(np.clip(offset @ axis, 0.0, (top - foot) @ axis)) * axis
        return max(float(np.linalg.norm(offset - nearest)) - self.radius_m, 0.0)


Obstacle = Pole | Box


def distance_m(obstacle: Obstacle, position_ned_m: Vector3, time_s: float) -> float:
    """From a point to the nearest point of an obstacle where it is at that time; 0 inside."""
    (x, y, z), motion = position_ned_m, obstacle.motion
    dx, dy, dz = (0.0, 0.0, 0.0) if motion is None else motion.offset_ned_m(time_s)
    return obstacle.distance_m((x - dx, y - dy, z - dz))


@dataclass(frozen=True, slots=True)
class Mover:
    """Rows of an obstacle that moves and where they are without its motion."""

    rows: Ints
    points_ned_m: Floats
    motion: Motion


@dataclass(frozen=True, slots=True)
class World:
    """The rows (n, FACE_COLUMNS), flat ones first, and for each what it belongs to and what it is."""

    faces: Floats
    flat_count: int
    names: tuple[str, ...]
    kinds: tuple[str, ...]
    """ground, wall, ceiling, floor, edge or pole."""
    movers: tuple[Mover, ...]
    obstacles: tuple[Obstacle, ...]
    owners: Ints
    """Which of the obstacles each row is a part of; -1 for the ground."""

    def rows_in(self, other: "World") -> Ints:
        """For each row, which one it is in another world; -1 where its obstacle is not there. The same obstacles are
        the same objects.
        """
        there = {id(obstacle): number for number, obstacle in enumerate(other.obstacles)} | {id(None): -1}
        found = np.full(len(self.owners), -1)
        for number, obstacle in ((-1, None), *enumerate(self.obstacles)):
            if id(obstacle) in there:
                found[self.owners == number] = np.flatnonzero(other.owners == there[id(obstacle)])
        return found


def build_world(obstacles: tuple[Obstacle, ...]) -> World:
    """Ground at z = 0 and the rows of every obstacle."""
    ground = _flat(np.zeros(3), np.array([0.0, 0.0, -1.0]), *_face_axes(np.array([0.0, 0.0, -1.0])), np.inf, np.inf)
    parts = [(-1, GROUND, ground)]
    for number, obstacle in enumerate(obstacles):
        parts += [(number, kind, row) for kind, row in _rows_of(obstacle)]
    parts.sort(key=lambda part: bool(part[2][FACE_RADIUS]))
    faces = np.array([row for _, _, row in parts])
    owners = np.array([number for number, _, _ in parts])
    movers = []
    for number, obstacle in enumerate(obstacles):
        if obstacle.motion is not None:
            rows = np.flatnonzero(owners == number)
            movers.append(Mover(rows, faces[rows, FACE_POINT : FACE_POINT + 3], obstacle.motion))
    return World(
        faces,
        flat_count=int((faces[:, FACE_RADIUS] == 0.0).sum()),
        names=tuple(GROUND if number < 0 else obstacles[number].name for number, _, _ in parts),
        kinds=tuple(kind for _, kind, _ in parts),
        movers=tuple(movers),
        obstacles=obstacles,
        owners=owners,
    )


def _rows_of(obstacle: Obstacle) -> list[tuple[str, Floats]]:
    if isinstance(obstacle, Pole):
        foot, top = obstacle.ends()
        half_m = 0.5 * float(np.linalg.norm(top - foot))
        axis = np.array(obstacle.axis_ned)
        return [("pole", _round(0.5 * (foot + top), axis, half_m, obstacle.radius_m, np.zeros(3), np.zeros(3), True))]
    return _sides(obstacle) + _edges(obstacle)


def _halves(box: Box) -> tuple[Floats, Floats, float]:
    """Half sizes, the same without the rounding, and its radius: never more than half of the thinnest size."""
    half = 0.5 * np.array(box.sizes_m)
    radius_m = min(box.edge_radius_m, float(half.min()))
    return half, half - radius_m, radius_m


def _sides(box: Box) -> list[tuple[str, Floats]]:
    """The flat part of every side that has one."""
    half, inner, _ = _halves(box)
    axes, rows = np.array(box.axes_ned), []
    for side in range(3):
        across, along = (side + 1) % 3, (side + 2) % 3
        if inner[across] <= 0.0 or inner[along] <= 0.0:
            continue
        for sign in (1.0, -1.0):
            normal = sign * axes[side]
            point = np.array(box.centre_ned_m) + half[side] * normal
            row = _flat(point, normal, axes[across], axes[along], 2 * inner[across], 2 * inner[along])
            rows.append((_kind_facing(normal), row))
    return rows


def _edges(box: Box) -> list[tuple[str, Floats]]:
    """A round along every edge; edges that the rounding brings together are one."""
    _, inner, radius_m = _halves(box)
    axes, rows = np.array(box.axes_ned), []
    for direction in range(3):
        # The last axis' edges have the corners, and stay when the box is all corner.
        has_ends = direction == 2
        if inner[direction] <= 0.0 and not has_ends:
            continue
        first, second = (direction + 1) % 3, (direction + 2) % 3
        for one in (1.0, -1.0) if inner[first] > 0.0 else (0.0,):
            for other in (1.0, -1.0) if inner[second] > 0.0 else (0.0,):
                outward, outward_too = one * axes[first], other * axes[second]
                middle = np.array(box.centre_ned_m) + inner[first] * outward + inner[second] * outward_too
                row = _round(middle, axes[direction], inner[direction], radius_m, outward, outward_too, has_ends)
                rows.append(("edge", row))
    return rows


def _kind_facing(normal_ned: Floats) -> str:
    return "ceiling" if normal_ned[2] > _LEVEL else "floor" if normal_ned[2] < -_LEVEL else "wall"


def _flat(point: Floats, normal: Floats, across: Floats, along: Floats, width_m: float, height_m: float) -> Floats:
    row = np.zeros(FACE_COLUMNS)
    row[FACE_POINT : FACE_HALF_HEIGHT + 1] = [*point, *normal, *across, *along, width_m / 2, height_m / 2]
    row[FACE_MEETS_FEET] = normal[2] < -_LEVEL
    return row


def _round(
    middle: Floats,
    direction: Floats,
    half_length_m: float,
    radius_m: float,
    outward: Floats,
    outward_too: Floats,
    has_ends: bool,
) -> Floats:
    row = np.zeros(FACE_COLUMNS)
    row[FACE_POINT : FACE_POINT + 3], row[FACE_ALONG : FACE_ALONG + 3] = middle, direction
    row[FACE_OUTWARD : FACE_OUTWARD + 3], row[FACE_OUTWARD_TOO : FACE_OUTWARD_TOO + 3] = outward, outward_too
    row[FACE_HALF_HEIGHT], row[FACE_RADIUS], row[FACE_HAS_ENDS] = half_length_m, radius_m, has_ends
    return row


def _face_axes(normal_ned: Floats) -> tuple[Floats, Floats]:
    """Unit vectors along the width (horizontal; east for level faces) and the height of a face."""
    down = np.array([0.0, 0.0, 1.0])
    across = np.cross(down, normal_ned)
    length = np.linalg.norm(across)
    # Below a thousandth of a radian a face counts as level: its horizontal direction is noise.
    across = np.array([0.0, 1.0, 0.0]) if length < 1e-3 else across / length
    return across, np.cross(normal_ned, across)
