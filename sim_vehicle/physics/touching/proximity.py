"""Where the points of the vehicle are against the faces of the world: near, close, in front or behind."""

import math

import numpy as np

from sim_vehicle.physics.jit import inlined, njit
from sim_vehicle.physics.layout import FEET, POINTS, ContactSprings, Scratch
from sim_vehicle.physics.touching.meeting import (
    deepest_point,
    depth_in,
    is_absent,
    meet,
    nearest_on_line,
    part_centre,
    within,
)
from sim_vehicle.quantities import Floats, Ints
from sim_vehicle.world import FACE_MEETS_FEET, FACE_NORMAL, FACE_POINT, FACE_RADIUS, FACE_VELOCITY

# Values of `near`, per face: out of reach for this interval, within reach, and so close that guards and hub must be
# looked at.
FAR, NEAR, CLOSE = range(3)
# Values of `behind`, per point and face. A part is past a face whose plane it crossed beside the rectangle. It is
# inside where it got deep without coming from outside, as a part that slips off an edge may. No spring was compressed,
# so none may push.
IN_FRONT, PASSED, INSIDE = range(3)
# Room for what a hit may add to the speed within one interval of the inertial sensor.
NEAR_MARGIN_M = 0.03


@njit
def find_near(
    body: Floats, interval_s: float, contact: ContactSprings, faces: Floats, near: Ints, scratch: Scratch
) -> bool:
    """Mark the faces that some part could reach in an interval of the inertial sensor; whether there is any."""
    speed = math.sqrt(body[3] * body[3] + body[4] * body[4] + body[5] * body[5])
    found = False
    for face in range(near.shape[0]):
        moved = 0.0
        for i in range(3):
            moved += abs(faces[face, FACE_VELOCITY + i])
        reach_m = contact.reach_m + 2.0 * (speed + 2.0 * moved) * interval_s + NEAR_MARGIN_M
        near[face] = NEAR if _is_within_reach(body, face, reach_m, faces, scratch) else FAR
        found = found or near[face] == NEAR
    return found


@inlined
def _is_within_reach(body: Floats, face: int, reach_m: float, faces: Floats, scratch: Scratch) -> bool:
    """Whether a face's plane, or a round's surface, is less than ``reach_m`` from the vehicle's centre."""
    if faces[face, FACE_RADIUS] == 0.0:
        return bool(abs(depth_in(face, body, faces)) < reach_m)
    nearest_on_line(face, body, faces, scratch.on_line)
    squared = 0.0
    for i in range(3):
        squared += (body[i] - scratch.on_line[i]) ** 2
    return bool(squared < (reach_m + faces[face, FACE_RADIUS]) ** 2)


@inlined
def find_close(
    body: Floats, behind: Ints, near: Ints, margin_m: float, contact: ContactSprings, faces: Floats, scratch: Scratch
) -> bool:
    """Raise to CLOSE the near faces that a guard or the hub touches or may touch within ``margin_m`` of travel;
    note which parts have passed by a flat face; return whether any is CLOSE.
    """
    touching = False
    for face in range(near.shape[0]):
        if near[face] == FAR:
            continue
        near[face] = NEAR
        flat = faces[face, FACE_RADIUS] == 0.0
        for point in range(POINTS if faces[face, FACE_MEETS_FEET] == 1.0 else FEET):
            if is_absent(point, contact):
                continue
            if flat and face != 0:
                note_passing(point, face, body, behind, contact, faces, scratch)
            if point >= FEET or behind[point, face] != IN_FRONT:
                continue
            if flat:
                for i in range(3):
                    scratch.normal[i] = faces[face, FACE_NORMAL + i]
                _, further = deepest_point(point, scratch.normal, scratch.rotation, body, contact, scratch.where)
                close = depth_in(face, scratch.where, faces) + further > -margin_m
                close = close and within(face, scratch.where, faces, margin_m + contact.guard_radius_m)
            else:
                close = meet(point, face, scratch.rotation, body, contact, faces, scratch)[0] > -margin_m
            if close:
                near[face] = CLOSE
                touching = True
    return touching


@njit
def note_passing(
    point: int, face: int, body: Floats, behind: Ints, contact: ContactSprings, faces: Floats, scratch: Scratch
) -> None:
    """A part whose middle gets behind a face's plane beside its rectangle has passed it by and is not pushed by it
    until it is in front again.
    """
    part_centre(point, scratch.rotation, body, contact, scratch.where)
    if depth_in(face, scratch.where, faces) <= 0.0:
        if behind[point, face] == PASSED:
            behind[point, face] = IN_FRONT
    elif behind[point, face] == IN_FRONT and not within(face, scratch.where, faces, 0.0):
        behind[point, face] = PASSED


@inlined
def points_at(face: int, near: Ints, faces: Floats) -> tuple[int, int]:
    """The range of points worth looking at: feet meet level faces alone, guards and hub what is close."""
    last = POINTS if faces[face, FACE_MEETS_FEET] == 1.0 else FEET
    if near[face] < NEAR:
        return last, last
    return (0 if near[face] == CLOSE else FEET), last


def points_behind(faces: Floats, centre_ned_m: tuple[float, float, float]) -> Ints:
    """Which points (POINTS, n faces) start behind a face: no wall passes through a vehicle at its start
    (the scene checks that), so every point is on its centre's side.
    """
    offset = np.array(centre_ned_m) - faces[:, FACE_POINT : FACE_POINT + 3]
    in_front = (offset * faces[:, FACE_NORMAL : FACE_NORMAL + 3]).sum(axis=1)
    is_flat = faces[:, FACE_RADIUS] == 0.0
    return np.tile(((in_front < 0) & is_flat).astype(np.int64), (POINTS, 1))
