"""Where the points of the vehicle are against the faces of the world: near, close, in front or behind."""

import math

import numpy as np
import numpy.typing as npt

from sim_vehicle.physics.jit import njit
from sim_vehicle.physics.layout import ARM_DIRECTIONS_FRD, FEET, GUARDS, HUB, POINTS, Contact, Scratch
from sim_vehicle.world import (
    FACE_ACROSS,
    FACE_ALONG,
    FACE_HALF_HEIGHT,
    FACE_HALF_WIDTH,
    FACE_NORMAL,
    FACE_POINT,
)

Floats = npt.NDArray[np.float64]
Ints = npt.NDArray[np.int64]

# Values of `near`, per face: out of reach, within reach, and so close that guards and hub must be looked at.
FAR, NEAR, CLOSE = range(3)
# Leaning by this the hoop stands on one edge; less, on both of them in part, as a hoop that gives a little does.
EDGE_LEAN_RAD = 0.1
# Room for the travel in one raw interval at any speed the vehicle can fly.
NEAR_MARGIN_M = 0.01


@njit
def contact_point(
    point: int, face: int, rotation: Floats, position: Floats, contact: Contact, faces: Floats, out: Floats
) -> float:
    """Write the point's position (NED, m) nearest to or deepest in a face into ``out``; return the share of
    the face's normal that lies in the guard's plane (1 for hub and feet).

    A guard is a hoop: its deepest point is on the rim, along the in-plane part of the inward normal, and on the
    edge of the hoop that leans into the face.
    """
    share = 1.0
    if point < GUARDS:
        axis_dot = 0.0
        for i in range(3):
            axis_dot -= faces[face, FACE_NORMAL + i] * rotation[i, 2]
        share = math.sqrt(max(0.0, 1.0 - axis_dot * axis_dot))
        edge = contact.guard_half_height_m * min(max(axis_dot / EDGE_LEAN_RAD, -1.0), 1.0)
        for i in range(3):
            arm = rotation[i, 0] * ARM_DIRECTIONS_FRD[point, 0] + rotation[i, 1] * ARM_DIRECTIONS_FRD[point, 1]
            towards = -faces[face, FACE_NORMAL + i] - axis_dot * rotation[i, 2]
            rim = contact.guard_radius_m * towards / share if share > 1e-9 else 0.0
            out[i] = position[i] + contact.motor_radius_m * arm + rim + edge * rotation[i, 2]
    elif point == HUB:
        for i in range(3):
            out[i] = position[i] - contact.hub_radius_m * faces[face, FACE_NORMAL + i]
    else:
        for i in range(3):
            arm = (
                rotation[i, 0] * ARM_DIRECTIONS_FRD[point - FEET, 0]
                + rotation[i, 1] * ARM_DIRECTIONS_FRD[point - FEET, 1]
            )
            out[i] = position[i] + contact.foot_radius_m * arm + contact.foot_depth_m * rotation[i, 2]
    return share


@njit
def depth_in(face: int, where: Floats, faces: Floats) -> float:
    """How far a position is behind a face's plane, metres; negative in front of it."""
    depth = 0.0
    for i in range(3):
        depth -= (where[i] - faces[face, FACE_POINT + i]) * faces[face, FACE_NORMAL + i]
    return depth


@njit
def within(face: int, where: Floats, faces: Floats) -> bool:
    """Whether a position projects onto the face's rectangle."""
    across, along = 0.0, 0.0
    for i in range(3):
        offset = where[i] - faces[face, FACE_POINT + i]
        across += offset * faces[face, FACE_ACROSS + i]
        along += offset * faces[face, FACE_ALONG + i]
    return bool(abs(across) <= faces[face, FACE_HALF_WIDTH] and abs(along) <= faces[face, FACE_HALF_HEIGHT])


@njit
def find_near(body: Floats, contact: Contact, faces: Floats, near: Ints) -> bool:
    """Mark the faces that some part could reach; return whether there is any."""
    found = False
    for face in range(near.shape[0]):
        near[face] = FAR
        if abs(depth_in(face, body, faces)) < contact.reach_m + NEAR_MARGIN_M:
            near[face] = NEAR
            found = True
    return found


@njit
def find_close(
    body: Floats, behind: Ints, near: Ints, margin_m: float, contact: Contact, faces: Floats, scratch: Scratch
) -> bool:
    """Raise to CLOSE the near faces that a guard or the hub touches, may touch within ``margin_m`` of travel,
    or has passed by; return whether anything but passed points made it so.
    """
    touching = False
    for face in range(near.shape[0]):
        if near[face] == FAR:
            continue
        for point in range(FEET):
            if behind[point, face] == 1:
                near[face] = CLOSE
                continue
            contact_point(point, face, scratch.rotation, body, contact, faces, scratch.where)
            if depth_in(face, scratch.where, faces) > -margin_m:
                near[face] = CLOSE
                touching = True
    return touching


@njit
def points_at(face: int, near: Ints) -> tuple[int, int]:
    """The range of points worth looking at: feet meet the ground alone, guards and hub what is close."""
    last = POINTS if face == 0 else FEET
    if near[face] == FAR:
        return last, last
    return (0 if near[face] == CLOSE else FEET), last


def points_behind(faces: Floats, centre_ned_m: tuple[float, float, float]) -> Ints:
    """Which points (POINTS, n faces) start behind a face: no wall passes through a vehicle at its start
    (the scene checks that), so every point is on its centre's side.
    """
    offset = np.array(centre_ned_m) - faces[:, FACE_POINT : FACE_POINT + 3]
    in_front = (offset * faces[:, FACE_NORMAL : FACE_NORMAL + 3]).sum(axis=1)
    return np.tile((in_front < 0).astype(np.int64), (POINTS, 1))
