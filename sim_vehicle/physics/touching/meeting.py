"""Where a part of the vehicle meets a face of the world: normal, depth, and the point on the face."""

import math

from sim_vehicle.physics.jit import inlined, njit
from sim_vehicle.physics.layout import FEET, GUARDS, HUB, QUAD_X_FRD, ContactSprings, Scratch
from sim_vehicle.quantities import Floats
from sim_vehicle.world import (
    FACE_ACROSS,
    FACE_ALONG,
    FACE_HALF_HEIGHT,
    FACE_HALF_WIDTH,
    FACE_HAS_ENDS,
    FACE_NORMAL,
    FACE_OUTWARD,
    FACE_OUTWARD_TOO,
    FACE_POINT,
    FACE_RADIUS,
)

# Leaning by this the hoop stands on one edge; less, on both of them in part, as a hoop that gives a little does.
EDGE_LEAN_RAD = 0.1
# A hoop that faces a face by less than this touches with its ring in part, and exactly facing with all of it.
FACING_SHARE = 0.05
# Steps between line and hoop until they are as near as they get; each leaves at most half of what is missing.
NEAREST_STEPS = 20
NEAREST_ENOUGH_M = 1e-7
# Where a face ends and its edge begins, rounding must not let both push: metres, and sine of the normal's angle.
SEAM = 1e-9
NOWHERE = -1e9


@inlined
def is_absent(point: int, contact: ContactSprings) -> bool:
    """Whether it is a guard that only vehicles with more rotors have."""
    return bool(contact.rotors <= point < GUARDS)


@inlined
def part_centre(point: int, rotation: Floats, position: Floats, contact: ContactSprings, out: Floats) -> None:
    """Write the middle (NED, m) of a guard or the hub, or where a foot is, into ``out``."""
    along_arm, below, ahead, aside = 0.0, 0.0, 0.0, 0.0
    if point < GUARDS:
        along_arm = contact.motor_radius_m[point]
        ahead, aside = contact.arm_direction_frd[point, 0], contact.arm_direction_frd[point, 1]
    elif point > HUB:
        along_arm, below = contact.foot_radius_m, contact.foot_depth_m
        ahead, aside = QUAD_X_FRD[point - FEET, 0], QUAD_X_FRD[point - FEET, 1]
    for i in range(3):
        direction = rotation[i, 0] * ahead + rotation[i, 1] * aside
        out[i] = position[i] + along_arm * direction + below * rotation[i, 2]


@inlined
def deepest_point(
    point: int, normal: Floats, rotation: Floats, position: Floats, contact: ContactSprings, out: Floats
) -> tuple[float, float]:
    """Write the point (NED, m) of a guard, hub or foot furthest against ``normal`` into ``out``. Return the share of
    the normal in the guard's plane (1 for hub and feet), and the part's further reach (m).

    A guard is a hoop: its deepest point is on the rim, along the in-plane part of the inward normal, and on the
    edge of the hoop that leans into the face. Where a hoop gives a little, the force acts in between, and the reach
    is what makes depth change as that point moves, so that turning makes no energy.
    """
    part_centre(point, rotation, position, contact, out)
    if point >= FEET:
        return 1.0, 0.0
    if point == HUB:
        for i in range(3):
            out[i] -= contact.hub_radius_m * normal[i]
        return 1.0, 0.0
    axis_dot = -(normal[0] * rotation[0, 2] + normal[1] * rotation[1, 2] + normal[2] * rotation[2, 2])
    share = math.sqrt(max(0.0, 1.0 - axis_dot * axis_dot))
    lean = min(max(axis_dot / EDGE_LEAN_RAD, -1.0), 1.0)
    edge = contact.guard_half_height_m * lean
    further = -0.5 * contact.guard_half_height_m * EDGE_LEAN_RAD * lean * lean
    if share < FACING_SHARE:
        further += 0.5 * contact.guard_radius_m * (FACING_SHARE - share * share / FACING_SHARE)
    rim = contact.guard_radius_m / max(share, FACING_SHARE)
    for i in range(3):
        out[i] += rim * (-normal[i] - axis_dot * rotation[i, 2]) + edge * rotation[i, 2]
    return share, further


@inlined
def meet(
    point: int, face: int, rotation: Floats, position: Floats, contact: ContactSprings, faces: Floats, scratch: Scratch
) -> tuple[float, float]:
    """Depth of a part in a face (m, negative in front of it) and the share of the normal in the guard's plane.

    Leaves the unit normal out of the face in `scratch.normal` and where they meet, on the face, in `scratch.where`.
    `NOWHERE` as depth: the part is beside this face, and what is there belongs to another.
    """
    if faces[face, FACE_RADIUS] > 0.0:
        return _meet_round(point, face, rotation, position, contact, faces, scratch)
    for i in range(3):
        scratch.normal[i] = faces[face, FACE_NORMAL + i]
    share, further = deepest_point(point, scratch.normal, rotation, position, contact, scratch.where)
    depth = depth_in(face, scratch.where, faces)
    meets = scratch.where
    if share < 2 * FACING_SHARE:
        # A hoop that faces a side belongs to it up to where its middle is: its deepest point says nothing.
        part_centre(point, rotation, position, contact, scratch.centre)
        meets = scratch.centre
    if not within(face, meets, faces, -SEAM):
        return NOWHERE, share
    for i in range(3):
        scratch.where[i] += depth * scratch.normal[i]
    return depth + further, share


@njit
def _meet_round(
    point: int, face: int, rotation: Floats, position: Floats, contact: ContactSprings, faces: Floats, scratch: Scratch
) -> tuple[float, float]:
    """The same for a round. The hoop is round too: a disc, and everything nearer to it than half of its height.

    Depth and normal are those of the shortest separation of two convex bodies. So pressing in costs what pressing out
    returns, however they roll on each other.
    """
    normal, where, on_line = scratch.normal, scratch.where, scratch.on_line
    part_centre(point, rotation, position, contact, scratch.centre)
    is_end = nearest_on_line(face, scratch.centre, faces, on_line)
    for i in range(3):
        normal[i] = scratch.centre[i] - on_line[i]
    depth = faces[face, FACE_RADIUS] + (contact.guard_half_height_m if point < GUARDS else contact.hub_radius_m)
    inside_m = _way_out_of_hoop(face, rotation, contact, faces, scratch) if point < GUARDS else 0.0
    if point < GUARDS and inside_m == 0.0:
        is_end = _nearest_to_hoop(face, rotation, contact, faces, scratch)
    length = math.sqrt(normal[0] * normal[0] + normal[1] * normal[1] + normal[2] * normal[2])
    if length < 1e-9:
        return NOWHERE, 1.0
    along_axis = 0.0
    for i in range(3):
        normal[i] /= length
        along_axis += normal[i] * rotation[i, 2]
        where[i] = on_line[i] + faces[face, FACE_RADIUS] * normal[i]
    share = math.sqrt(max(0.0, 1.0 - along_axis * along_axis)) if point < GUARDS else 1.0
    depth += inside_m if inside_m > 0.0 else -length
    outward, outward_too = 0.0, 0.0
    for i in range(3):
        # As for a flat side.
        towards = normal[i] if share > 2 * FACING_SHARE else scratch.centre[i] - on_line[i]
        outward += towards * faces[face, FACE_OUTWARD + i]
        outward_too += towards * faces[face, FACE_OUTWARD_TOO + i]
    if outward < -SEAM or outward_too < -SEAM or (is_end and faces[face, FACE_HAS_ENDS] == 0.0):
        return NOWHERE, share
    return depth, share


@njit
def _way_out_of_hoop(face: int, rotation: Floats, contact: ContactSprings, faces: Floats, scratch: Scratch) -> float:
    """How far (m) a round's line that goes through a hoop's disc is from its rim, the shortest way; 0 if it does not.

    Leaves the way as the normal, not of unit length, and where the line goes through in `scratch.on_line`. The way is
    at right angles to the line and to the rim: along the line the disc looks like an ellipse.
    """
    normal, on_line, centre = scratch.normal, scratch.on_line, scratch.centre
    steepness, height = 0.0, 0.0
    for i in range(3):
        steepness += faces[face, FACE_ALONG + i] * rotation[i, 2]
        height += (centre[i] - faces[face, FACE_POINT + i]) * rotation[i, 2]
    if abs(steepness) < 1e-6 or abs(height) > faces[face, FACE_HALF_HEIGHT] * abs(steepness):
        return 0.0
    through = height / steepness
    x = centre[0] - faces[face, FACE_POINT] - through * faces[face, FACE_ALONG]
    y = centre[1] - faces[face, FACE_POINT + 1] - through * faces[face, FACE_ALONG + 1]
    z = centre[2] - faces[face, FACE_POINT + 2] - through * faces[face, FACE_ALONG + 2]
    inner = contact.guard_radius_m - contact.guard_half_height_m
    off_centre = math.sqrt(x * x + y * y + z * z)
    if off_centre >= inner or off_centre < 1e-9:
        return 0.0
    for i in range(3):
        on_line[i] = centre[i] - (x if i == 0 else y if i == 1 else z)
    rim_x = rotation[1, 2] * z - rotation[2, 2] * y
    rim_y = rotation[2, 2] * x - rotation[0, 2] * z
    rim_z = rotation[0, 2] * y - rotation[1, 2] * x
    a, b, c = faces[face, FACE_ALONG], faces[face, FACE_ALONG + 1], faces[face, FACE_ALONG + 2]
    normal[0], normal[1], normal[2] = b * rim_z - c * rim_y, c * rim_x - a * rim_z, a * rim_y - b * rim_x
    outward = (normal[0] * x + normal[1] * y + normal[2] * z) / off_centre
    length = math.sqrt(normal[0] * normal[0] + normal[1] * normal[1] + normal[2] * normal[2])
    if outward < 0.0:
        for i in range(3):
            normal[i] = -normal[i]
    way_m: float = (inner - off_centre) * abs(outward) / length
    return way_m


@njit
def _nearest_to_hoop(face: int, rotation: Floats, contact: ContactSprings, faces: Floats, scratch: Scratch) -> bool:
    """Find the nearest points of a round's line and a hoop's inner disc, by alternating projection. Write the line's
    point into `scratch.on_line`, and the direction from there as the normal. Returns whether it is an end.
    """
    normal, on_line, centre, where = scratch.normal, scratch.on_line, scratch.centre, scratch.where
    inner = contact.guard_radius_m - contact.guard_half_height_m
    is_end = False
    for _ in range(NEAREST_STEPS):
        height, squared = 0.0, 0.0
        for i in range(3):
            height += (on_line[i] - centre[i]) * rotation[i, 2]
        for i in range(3):
            where[i] = on_line[i] - centre[i] - height * rotation[i, 2]
            squared += where[i] * where[i]
        scale = min(1.0, inner / math.sqrt(squared)) if squared > 0.0 else 1.0
        for i in range(3):
            where[i] = centre[i] + scale * where[i]
            normal[i] = on_line[i]
        is_end = nearest_on_line(face, where, faces, on_line)
        moved = 0.0
        for i in range(3):
            moved += abs(on_line[i] - normal[i])
            normal[i] = where[i] - on_line[i]
        if moved < NEAREST_ENOUGH_M:
            break
    return is_end


@njit
def nearest_on_line(face: int, where: Floats, faces: Floats, out: Floats) -> bool:
    """Write the point of a round's line nearest to ``where``; return whether it is one of the ends."""
    along = 0.0
    for i in range(3):
        along += (where[i] - faces[face, FACE_POINT + i]) * faces[face, FACE_ALONG + i]
    half = faces[face, FACE_HALF_HEIGHT]
    kept = min(max(along, -half), half)
    for i in range(3):
        out[i] = faces[face, FACE_POINT + i] + kept * faces[face, FACE_ALONG + i]
    return bool(kept != along)


@inlined
def depth_in(face: int, where: Floats, faces: Floats) -> float:
    """How far a position is behind a flat face's plane, metres; negative in front of it."""
    depth = 0.0
    for i in range(3):
        depth -= (where[i] - faces[face, FACE_POINT + i]) * faces[face, FACE_NORMAL + i]
    return depth


@inlined
def within(face: int, where: Floats, faces: Floats, margin_m: float) -> bool:
    """Whether a position projects onto a flat face's rectangle, or beside it by less than a margin."""
    across, along = 0.0, 0.0
    for i in range(3):
        offset = where[i] - faces[face, FACE_POINT + i]
        across += offset * faces[face, FACE_ACROSS + i]
        along += offset * faces[face, FACE_ALONG + i]
    return bool(
        abs(across) <= faces[face, FACE_HALF_WIDTH] + margin_m
        and abs(along) <= faces[face, FACE_HALF_HEIGHT] + margin_m
    )
