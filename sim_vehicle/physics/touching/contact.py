"""Contact of guards, hub and feet with the world: it pushes, it never pulls."""

import math

from sim_vehicle.physics.jit import inlined, njit
from sim_vehicle.physics.layout import GUARDS, HUB, ContactSprings, PlantState, Scratch
from sim_vehicle.physics.rotation import matrix_from_quaternion
from sim_vehicle.physics.touching.meeting import is_absent, meet
from sim_vehicle.physics.touching.proximity import IN_FRONT, INSIDE, NEAR, points_at
from sim_vehicle.quantities import Floats, Ints
from sim_vehicle.world import FACE_RADIUS, FACE_VELOCITY

# Sliding speed over which friction reaches its full value: far below any speed of interest.
FRICTION_SPEED_M_S = 0.02


@inlined
def arm_force(arm: int, fold_m: float, fold_speed_m_s: float, contact: ContactSprings) -> float:
    """Force along an arm at this fold and folding speed, newtons, never negative (eq. 2, then the stop)."""
    force: float = contact.arm_stiffness[arm] * fold_m + contact.arm_damping[arm] * fold_speed_m_s
    beyond = fold_m - contact.fold_max_m[arm]
    if beyond > 0.0:
        force += max(0.0, contact.stop_stiffness * beyond + contact.stop_damping * fold_speed_m_s)
    return max(0.0, force)


@inlined
def point_force(
    point: int, depth: float, speed_in: float, share: float, relaxed_m: float, contact: ContactSprings
) -> float:
    """Normal force on one point at ``depth`` (m) going in at ``speed_in`` (m/s), newtons.

    A guard whose arm is still folded from before touches only when pressed in further than ``relaxed_m``.
    An arm folds in its own plane, so a slanted push needs 1 / share of the depth and gives 1 / share of
    the force.
    """
    if point < GUARDS:
        lever: float = max(share, contact.least_in_plane[point])
        fold = depth / lever
        if fold < relaxed_m:
            return 0.0
        return arm_force(point, fold, speed_in / lever, contact) / lever
    if depth <= 0.0:
        return 0.0
    if point == HUB:
        return max(0.0, contact.hub_stiffness * depth + contact.hub_damping * speed_in)
    return max(0.0, contact.foot_stiffness * depth + contact.foot_damping * speed_in)


@inlined
def contact_wrench(
    body: Floats,
    rotation: Floats,
    behind: Ints,
    near: Ints,
    contact: ContactSprings,
    faces: Floats,
    scratch: Scratch,
    normal_forces: Floats,
) -> None:
    """Add the contacts' force (NED, N) and moment (FRD, N m) to the scratch's and list the normal forces of the faces
    within reach.
    """
    lever, speed, rates_ned = scratch.lever, scratch.speed, scratch.rates_ned
    for i in range(3):
        rates_ned[i] = rotation[i, 0] * body[10] + rotation[i, 1] * body[11] + rotation[i, 2] * body[12]
    for face in range(near.shape[0]):
        if near[face] < NEAR:
            continue
        normal_forces[:, face] = 0.0
        for point in range(*points_at(face, near, faces)):
            if is_absent(point, contact) or behind[point, face] != IN_FRONT:
                continue
            depth, share = meet(point, face, rotation, body, contact, faces, scratch)
            if depth <= 0.0 or (face != 0 and depth > scratch.deepest_m[point]):
                continue
            if faces[face, FACE_RADIUS] > 0.0 and scratch.share[point] > 0.0:
                share = scratch.share[point]
            # The force acts where the face is, not where the unfolded guard would be.
            for i in range(3):
                lever[i] = scratch.where[i] - body[i]
            # Speeds are against the face's own.
            speed[0] = body[3] + rates_ned[1] * lever[2] - rates_ned[2] * lever[1]
            speed[1] = body[4] + rates_ned[2] * lever[0] - rates_ned[0] * lever[2]
            speed[2] = body[5] + rates_ned[0] * lever[1] - rates_ned[1] * lever[0]
            speed_in = 0.0
            for i in range(3):
                speed[i] -= faces[face, FACE_VELOCITY + i]
                speed_in -= speed[i] * scratch.normal[i]
            relaxed = scratch.relaxed_m[point] if point < GUARDS else 0.0
            normal = point_force(point, depth, speed_in, share, relaxed, contact)
            if normal > 0.0:
                normal_forces[point, face] = normal
                friction = contact.ground_friction if point > HUB or face == 0 else contact.guard_friction
                _add_push(normal, speed_in, friction, face != 0, rotation, scratch)


@inlined
def _add_push(
    normal_n: float, speed_in: float, friction: float, is_obstacle: bool, rotation: Floats, scratch: Scratch
) -> None:
    """Add one contact's normal force and Coulomb friction, smooth around zero sliding speed."""
    lever, push, normal = scratch.lever, scratch.where, scratch.normal
    slide_squared = FRICTION_SPEED_M_S * FRICTION_SPEED_M_S
    for i in range(3):
        slide = scratch.speed[i] + speed_in * normal[i]
        slide_squared += slide * slide
    per_speed = friction * normal_n / math.sqrt(slide_squared)
    for i in range(3):
        slide = scratch.speed[i] + speed_in * normal[i]
        push[i] = normal_n * normal[i] - per_speed * slide
        scratch.force_ned[i] += push[i]
        if is_obstacle:
            scratch.contact_ned[i] += push[i]
    x = lever[1] * push[2] - lever[2] * push[1]
    y = lever[2] * push[0] - lever[0] * push[2]
    z = lever[0] * push[1] - lever[1] * push[0]
    for i in range(3):
        scratch.moment_frd[i] += rotation[0, i] * x + rotation[1, i] * y + rotation[2, i] * z


@inlined
def relax_arms(state: PlantState, step_s: float, contact: ContactSprings, relaxed_m: Floats) -> None:
    """Write how far each arm would be folded after ``step_s`` with nothing pressing it.

    An arm under a wall can follow a leaving vehicle as fast as its own force is zero, b_s l' = -k_s l (faster out of
    the stop): eq. 2 ends there. A free arm has its end's mass to move as well (implicit Euler: its fastest time,
    3 ms, is far above any step). The hysteresis holds it where eq. 2 would take it back to zero.
    """
    for arm in range(contact.rotors):
        fold = state.fold_m[arm]
        if fold == 0.0 and state.fold_rate_m_s[arm] == 0.0:
            relaxed_m[arm] = 0.0
            continue
        held = min(fold, contact.hysteresis_m[arm])
        if contact.arm_damping[arm] <= 0.0:
            relaxed_m[arm] = held
        elif state.pressed[arm] == 1 or contact.tip_mass_kg <= 0.0:
            relaxed_m[arm] = max(fold - step_s * _returning_m_s(arm, fold, contact), held)
        else:
            damping = contact.arm_damping[arm] / contact.tip_mass_kg
            stiffness = contact.arm_stiffness[arm] / contact.tip_mass_kg
            rate = (state.fold_rate_m_s[arm] - step_s * stiffness * fold) / (
                1.0 + step_s * damping + step_s * step_s * stiffness
            )
            relaxed_m[arm] = max(fold + step_s * rate, held)


@njit
def _returning_m_s(arm: int, fold_m: float, contact: ContactSprings) -> float:
    """How fast an arm without mass goes out."""
    returning: float = contact.arm_stiffness[arm] * fold_m / contact.arm_damping[arm]
    beyond = fold_m - contact.fold_max_m[arm]
    if beyond > 0.0:
        push_n = contact.arm_stiffness[arm] * fold_m + contact.stop_stiffness * beyond
        returning = max(returning, push_n / (contact.arm_damping[arm] + contact.stop_damping))
    return returning


@inlined
def settle_arms(
    state: PlantState,
    behind: Ints,
    near: Ints,
    touches: bool,
    step_s: float,
    contact: ContactSprings,
    faces: Floats,
    scratch: Scratch,
) -> None:
    """After a step: how far each arm is folded and how fast it moves."""
    for arm in range(contact.rotors):
        scratch.fold_before_m[arm] = state.fold_m[arm]
        state.fold_m[arm] = scratch.relaxed_m[arm]
        state.pressed[arm] = 0
    if touches:
        settle_contacts(state, behind, near, contact, faces, scratch)
    elif state.was_near == 1:
        state.depth_m[:] = 0.0
        state.share[:] = 0.0
    state.was_near = 1 if touches else 0
    for arm in range(contact.rotors):
        folded_m = state.fold_m[arm] - scratch.fold_before_m[arm]
        state.fold_rate_m_s[arm] = folded_m / step_s if folded_m != 0.0 else 0.0


@inlined
def settle_contacts(
    state: PlantState, behind: Ints, near: Ints, contact: ContactSprings, faces: Floats, scratch: Scratch
) -> None:
    """Press the arms that a face presses, and note how deep every part is."""
    # The rotation of the step's end: the next step must find the arm exactly where this one leaves it.
    matrix_from_quaternion(state.body, scratch.turned)
    state.depth_m[:] = 0.0
    state.share[:] = 0.0
    for face in range(near.shape[0]):
        for point in range(*points_at(face, near, faces)):
            if is_absent(point, contact):
                continue
            depth, share = meet(point, face, scratch.turned, state.body, contact, faces, scratch)
            if depth <= 0.0 and behind[point, face] == INSIDE:
                behind[point, face] = IN_FRONT
            elif behind[point, face] == IN_FRONT and face != 0 and depth > scratch.deepest_m[point]:
                behind[point, face] = INSIDE
            if behind[point, face] != IN_FRONT:
                continue
            state.depth_m[point] = max(state.depth_m[point], depth)
            # A guard that rolls over a pole or an edge keeps pressing the same arm. Otherwise the same depth would cost
            # more and more force, and the roll would make energy.
            if faces[face, FACE_RADIUS] > 0.0 and depth > 0.0:
                share = state.share[point] = scratch.share[point] if scratch.share[point] > 0.0 else share
            if point >= GUARDS:
                continue
            fold = depth / max(share, contact.least_in_plane[point])
            if depth > 0.0 and fold >= state.fold_m[point]:
                state.fold_m[point] = fold
                state.pressed[point] = 1
