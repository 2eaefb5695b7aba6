"""Contact of guards, hub and feet with the faces of the world: it pushes, it never pulls."""

import math

import numpy as np
import numpy.typing as npt

from sim_vehicle.physics.jit import njit
from sim_vehicle.physics.layout import GUARDS, HUB, Contact, Scratch, State
from sim_vehicle.physics.proximity import contact_point, depth_in, points_at, within
from sim_vehicle.physics.rotation import matrix_from_quaternion
from sim_vehicle.world import FACE_NORMAL

Floats = npt.NDArray[np.float64]
Ints = npt.NDArray[np.int64]

# A disc lying flat against a face (a ceiling) cannot fold its arm towards it; below this share of the
# normal in the disc's plane the push is taken as straight through the frame.
LEAST_IN_PLANE = 0.2
# Sliding speed over which friction reaches its full value: far below any speed of interest.
FRICTION_SPEED_M_S = 0.02


@njit
def arm_force(fold_m: float, fold_speed_m_s: float, contact: Contact) -> float:
    """Force along an arm at this fold and folding speed, newtons, never negative (eq. 2, then the stop)."""
    force = contact.arm_stiffness * fold_m + contact.arm_damping * fold_speed_m_s
    beyond = fold_m - contact.fold_max_m
    if beyond > 0.0:
        force += max(0.0, contact.stop_stiffness * beyond + contact.stop_damping * fold_speed_m_s)
    return max(0.0, force)


@njit
def point_force(point: int, depth: float, speed_in: float, share: float, relaxed_m: float, contact: Contact) -> float:
    """Normal force on one point at ``depth`` (m) going in at ``speed_in`` (m/s), newtons.

    A guard whose arm is still folded from before touches only when pressed in further than ``relaxed_m``.
    An arm folds in its own plane, so a slanted push needs 1 / share of the depth and gives 1 / share of
    the force.
    """
    if point < GUARDS:
        lever = max(share, LEAST_IN_PLANE)
        fold = depth / lever
        if fold < relaxed_m:
            return 0.0
        return arm_force(fold, speed_in / lever, contact) / lever
    if depth <= 0.0:
        return 0.0
    if point == HUB:
        return max(0.0, contact.hub_stiffness * depth + contact.hub_damping * speed_in)
    return max(0.0, contact.foot_stiffness * depth + contact.foot_damping * speed_in)


@njit
def contact_wrench(
    body: Floats,
    rotation: Floats,
    behind: Ints,
    near: Ints,
    contact: Contact,
    faces: Floats,
    scratch: Scratch,
    normal_forces: Floats,
) -> None:
    """Add the contacts' force (NED, N) and moment (FRD, N m) to the scratch's and list every normal force."""
    where, lever, speed, rates_ned = scratch.where, scratch.lever, scratch.speed, scratch.rates_ned
    for i in range(3):
        rates_ned[i] = rotation[i, 0] * body[10] + rotation[i, 1] * body[11] + rotation[i, 2] * body[12]
    for face in range(near.shape[0]):
        normal_forces[:, face] = 0.0
        for point in range(*points_at(face, near)):
            if behind[point, face] == 1:
                continue
            share = contact_point(point, face, rotation, body, contact, faces, where)
            depth = depth_in(face, where, faces)
            if depth <= 0.0 or not within(face, where, faces):
                continue
            # The force acts where the face is, not where the unfolded guard would be.
            for i in range(3):
                lever[i] = where[i] + depth * faces[face, FACE_NORMAL + i] - body[i]
            speed[0] = body[3] + rates_ned[1] * lever[2] - rates_ned[2] * lever[1]
            speed[1] = body[4] + rates_ned[2] * lever[0] - rates_ned[0] * lever[2]
            speed[2] = body[5] + rates_ned[0] * lever[1] - rates_ned[1] * lever[0]
            speed_in = 0.0
            for i in range(3):
                speed_in -= speed[i] * faces[face, FACE_NORMAL + i]
            relaxed = scratch.relaxed_m[point] if point < GUARDS else 0.0
            normal = point_force(point, depth, speed_in, share, relaxed, contact)
            if normal > 0.0:
                normal_forces[point, face] = normal
                _add_push(normal, speed_in, face, rotation, contact, faces, scratch)


@njit
def _add_push(
    normal: float, speed_in: float, face: int, rotation: Floats, contact: Contact, faces: Floats, scratch: Scratch
) -> None:
    """Add one contact's normal force and Coulomb friction, smooth around zero sliding speed."""
    lever, push = scratch.lever, scratch.where
    friction = contact.ground_friction if face == 0 else contact.guard_friction
    slide_squared = FRICTION_SPEED_M_S * FRICTION_SPEED_M_S
    for i in range(3):
        slide = scratch.speed[i] + speed_in * faces[face, FACE_NORMAL + i]
        slide_squared += slide * slide
    per_speed = friction * normal / math.sqrt(slide_squared)
    for i in range(3):
        slide = scratch.speed[i] + speed_in * faces[face, FACE_NORMAL + i]
        push[i] = normal * faces[face, FACE_NORMAL + i] - per_speed * slide
        scratch.force_ned[i] += push[i]
        if face != 0:
            scratch.contact_ned[i] += push[i]
    x = lever[1] * push[2] - lever[2] * push[1]
    y = lever[2] * push[0] - lever[0] * push[2]
    z = lever[0] * push[1] - lever[1] * push[0]
    for i in range(3):
        scratch.moment_frd[i] += rotation[0, i] * x + rotation[1, i] * y + rotation[2, i] * z


@njit
def relax_arms(state: State, step_s: float, contact: Contact, relaxed_m: Floats) -> None:
    """Write how far each arm would be folded after ``step_s`` with nothing pressing it.

    An arm under a wall can follow a leaving vehicle as fast as its own force is zero, b_s l' = -k_s l (faster out of
    the stop): eq. 2 ends there. A free arm has its end's mass to move as well (implicit Euler: its fastest time,
    3 ms, is far above any step). The hysteresis holds it where eq. 2 would take it back to zero.
    """
    for arm in range(4):
        fold = state.fold_m[arm]
        held = min(fold, contact.hysteresis_m)
        if contact.arm_damping <= 0.0:
            relaxed_m[arm] = held
        elif state.pressed[arm] == 1 or contact.tip_mass_kg <= 0.0:
            relaxed_m[arm] = max(fold - step_s * _returning_m_s(fold, contact), held)
        else:
            damping, stiffness = contact.arm_damping / contact.tip_mass_kg, contact.arm_stiffness / contact.tip_mass_kg
            rate = (state.fold_rate_m_s[arm] - step_s * stiffness * fold) / (
                1.0 + step_s * damping + step_s * step_s * stiffness
            )
            relaxed_m[arm] = max(fold + step_s * rate, held)


@njit
def _returning_m_s(fold_m: float, contact: Contact) -> float:
    """How fast an arm without mass goes out."""
    returning: float = contact.arm_stiffness * fold_m / contact.arm_damping
    beyond = fold_m - contact.fold_max_m
    if beyond > 0.0:
        push_n = contact.arm_stiffness * fold_m + contact.stop_stiffness * beyond
        returning = max(returning, push_n / (contact.arm_damping + contact.stop_damping))
    return returning


@njit
def settle_arms(
    state: State,
    behind: Ints,
    near: Ints,
    touches: bool,
    step_s: float,
    contact: Contact,
    faces: Floats,
    scratch: Scratch,
) -> None:
    """After a step: how far each arm is folded and how fast it moves."""
    for arm in range(GUARDS):
        scratch.fold_before_m[arm] = state.fold_m[arm]
        state.fold_m[arm] = scratch.relaxed_m[arm]
        state.pressed[arm] = 0
    if touches:
        settle_contacts(state, behind, near, contact, faces, scratch)
    for arm in range(GUARDS):
        state.fold_rate_m_s[arm] = (state.fold_m[arm] - scratch.fold_before_m[arm]) / step_s


@njit
def settle_contacts(state: State, behind: Ints, near: Ints, contact: Contact, faces: Floats, scratch: Scratch) -> None:
    """Press the arms that a face presses, and note which points are behind a face.

    A point that gets behind a face beside its rectangle has passed it by and is not pushed until it is
    in front again.
    """
    # The rotation of the step's end: the next step must find the arm exactly where this one leaves it.
    matrix_from_quaternion(state.body, scratch.turned)
    for face in range(near.shape[0]):
        for point in range(*points_at(face, near)):
            share = contact_point(point, face, scratch.turned, state.body, contact, faces, scratch.where)
            depth = depth_in(face, scratch.where, faces)
            if depth <= 0.0:
                behind[point, face] = 0
            elif behind[point, face] == 0 and not within(face, scratch.where, faces):
                behind[point, face] = 1
            elif behind[point, face] == 0 and point < GUARDS:
                fold = depth / max(share, LEAST_IN_PLANE)
                if fold >= state.fold_m[point]:
                    state.fold_m[point] = fold
                    state.pressed[point] = 1
