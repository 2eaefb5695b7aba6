"""What the vehicle can run into: the ground and walls, as the arrays that the contact kernel reads."""

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

Vector3 = tuple[float, float, float]
Floats = npt.NDArray[np.float64]

GROUND = "ground"


@dataclass(frozen=True, slots=True)
class Wall:
    """A solid plate of finite extent; its front face is what a mission file describes."""

    name: str
    point_ned_m: Vector3
    """Centre of the front face."""
    normal_ned: Vector3
    """Unit vector out of the front face."""
    width_m: float
    """Extent across: horizontal for an upright wall, along east for a ceiling or a floor."""
    height_m: float
    """Extent along the face at right angles to the width."""
    thickness_m: float


# Columns of a row of faces: everything that can push, one row each; row 0 is the ground. All NED.
FACE_POINT, FACE_NORMAL, FACE_ACROSS, FACE_ALONG = 0, 3, 6, 9  # three columns each; the last three unit vectors
FACE_HALF_WIDTH, FACE_HALF_HEIGHT = 12, 13


@dataclass(frozen=True, slots=True)
class World:
    """The faces (n, 14) and, for each, the name of the thing it belongs to."""

    faces: Floats
    names: tuple[str, ...]


def build_world(walls: tuple[Wall, ...]) -> World:
    """Ground at z = 0 and two faces a wall, front and back."""
    faces = [_face(np.zeros(3), np.array([0.0, 0.0, -1.0]), np.inf, np.inf)]
    names = [GROUND]
    for wall in walls:
        normal, front = np.array(wall.normal_ned), np.array(wall.point_ned_m)
        faces.append(_face(front, normal, wall.width_m, wall.height_m))
        faces.append(_face(front - wall.thickness_m * normal, -normal, wall.width_m, wall.height_m))
        names += [wall.name, wall.name]
    return World(np.array(faces), tuple(names))


def _face(point_ned_m: Floats, normal_ned: Floats, width_m: float, height_m: float) -> Floats:
    across, along = _face_axes(normal_ned)
    return np.concatenate([point_ned_m, normal_ned, across, along, [width_m / 2, height_m / 2]])


def _face_axes(normal_ned: Floats) -> tuple[Floats, Floats]:
    """Unit vectors along the width (horizontal; east for level faces) and the height of a face."""
    down = np.array([0.0, 0.0, 1.0])
    across = np.cross(down, normal_ned)
    length = np.linalg.norm(across)
    # Below a thousandth of a radian a face counts as level: its horizontal direction is noise.
    across = np.array([0.0, 1.0, 0.0]) if length < 1e-3 else across / length
    return across, np.cross(normal_ned, across)


def distance_to_wall(wall: Wall, position_ned_m: Vector3) -> float:
    """Distance from a point to the nearest point of the solid plate; 0 inside."""
    normal = np.array(wall.normal_ned)
    across, along = _face_axes(normal)
    centre = np.array(wall.point_ned_m) - 0.5 * wall.thickness_m * normal
    offset = np.array(position_ned_m) - centre
    local = np.abs(np.array([offset @ normal, offset @ across, offset @ along]))
    outside = np.maximum(local - 0.5 * np.array([wall.thickness_m, wall.width_m, wall.height_m]), 0.0)
    return float(np.linalg.norm(outside))
