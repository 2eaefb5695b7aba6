"""The rigid body of the paper's eq. 1 with drag, contact and what else acts on it, and one Runge-Kutta step of it."""

from sim_vehicle.physics.inertia import XX, XY, YY, ZZ, inertia_of, times
from sim_vehicle.physics.jit import inlined, njit
from sim_vehicle.physics.layout import BODY_SIZE, GRAVITY_M_S2, Constants, Disturbance, PlantState, Scratch
from sim_vehicle.physics.rotation import matrix_from_quaternion, normalise
from sim_vehicle.physics.touching.contact import contact_wrench
from sim_vehicle.quantities import Floats, Ints
from sim_vehicle.world import FACE_POINT, FACE_VELOCITY


@inlined
def derivative(
    body: Floats,
    thrust_n: float,
    mass_kg: float,
    inertia: Floats,
    inertia_rate: Floats,
    behind: Ints,
    near: Ints,
    touches: bool,
    constants: Constants,
    disturbance: Disturbance,
    faces: Floats,
    rotation: Floats,
    normal_forces: Floats,
    scratch: Scratch,
    slope: Floats,
) -> None:
    """Write d(body)/dt of eq. 1 into ``slope``: m v' = m g e3 - f R e3 + drag + contact and
    J W' = tau - W x J W - J' W, the last for the arms' folding; J and J' are held over a step, as f and the thrusts'
    moment (`thrusts_moment`) are.

    ``touches`` off skips the contacts: no face is near.
    """
    matrix_from_quaternion(body, rotation)
    force, moment = scratch.force_ned, scratch.moment_frd
    for i in range(3):
        force[i] = -thrust_n * rotation[i, 2] - constants.drag_n_s_m * (body[3 + i] - disturbance.wind_ned_m_s[i])
        moment[i] = scratch.thrusts_moment_frd[i]
    if disturbance.pushes == 1:
        add_push(rotation, disturbance, scratch)
    scratch.contact_ned[:] = 0.0
    if touches:
        contact_wrench(body, rotation, behind, near, constants, faces, scratch, normal_forces)

    p, q, r = body[10], body[11], body[12]
    for i in range(3):
        slope[i] = body[3 + i]
        slope[3 + i] = force[i] / mass_kg
    slope[5] += GRAVITY_M_S2
    slope[6] = -0.5 * (body[7] * p + body[8] * q + body[9] * r)
    slope[7] = 0.5 * (body[6] * p + body[8] * r - body[9] * q)
    slope[8] = 0.5 * (body[6] * q + body[9] * p - body[7] * r)
    slope[9] = 0.5 * (body[6] * r + body[7] * q - body[8] * p)
    x, y, z = times(inertia, p, q, r)
    fx, fy, fz = times(inertia_rate, p, q, r)
    tx, ty = moment[0] - (q * z - r * y) - fx, moment[1] - (r * x - p * z) - fy
    determinant = inertia[XX] * inertia[YY] - inertia[XY] * inertia[XY]
    slope[10] = (inertia[YY] * tx - inertia[XY] * ty) / determinant
    slope[11] = (inertia[XX] * ty - inertia[XY] * tx) / determinant
    slope[12] = (moment[2] - (p * y - q * x) - fz) / inertia[ZZ]


@inlined
def thrusts_moment(thrusts_n: Floats, constants: Constants, moment: Floats) -> None:
    """Write the moment (FRD, N m) of the motors' thrusts and of their drag."""
    moment[:] = 0.0
    for motor in range(constants.rotors):
        thrust = thrusts_n[motor]
        moment[0] -= constants.motor_radius_m[motor] * constants.arm_direction_frd[motor, 1] * thrust
        moment[1] += constants.motor_radius_m[motor] * constants.arm_direction_frd[motor, 0] * thrust
        moment[2] += constants.yaw_sign[motor] * constants.moment_per_thrust_m * thrust


@njit
def add_push(rotation: Floats, disturbance: Disturbance, scratch: Scratch) -> None:
    """Add a force (NED) on a point of the body."""
    push, point = scratch.where, disturbance.push_point_frd_m
    for i in range(3):
        scratch.force_ned[i] += disturbance.push_ned_n[i]
        push[i] = 0.0
        for j in range(3):
            push[i] += rotation[j, i] * disturbance.push_ned_n[j]
    scratch.moment_frd[0] += point[1] * push[2] - point[2] * push[1]
    scratch.moment_frd[1] += point[2] * push[0] - point[0] * push[2]
    scratch.moment_frd[2] += point[0] * push[1] - point[1] * push[0]


@njit
def move_faces(moving: Ints, step_s: float, faces: Floats) -> None:
    """Move the rows of obstacles that move on by ``step_s``."""
    for row in moving:
        for i in range(3):
            faces[row, FACE_POINT + i] += step_s * faces[row, FACE_VELOCITY + i]


@inlined
def runge_kutta_step(
    state: PlantState,
    behind: Ints,
    near: Ints,
    touches: bool,
    step_s: float,
    constants: Constants,
    disturbance: Disturbance,
    faces: Floats,
    moving: Ints,
    forces: Floats,
    scratch: Scratch,
) -> None:
    """Advance the body and what moves around it by ``step_s`` (classical fourth order), thrusts and inertia held.

    Leaves the rotation of the step's *start* in the scratch and its normal forces in ``forces[0]``
    (2, POINTS, n faces).
    """
    body, thrusts_n, inertia, inertia_rate = state.body, state.motor_thrust_n, state.inertia, state.inertia_rate
    inertia_of(state.fold_m, state.fold_rate_m_s, constants, inertia, inertia_rate)
    thrusts_moment(thrusts_n, constants, scratch.thrusts_moment_frd)
    thrust_n = 0.0
    for motor in range(constants.rotors):
        thrust_n += thrusts_n[motor]
    mass_kg = constants.mass_kg + disturbance.carried_kg
    k, trial = scratch.slopes, scratch.trial
    for stage in range(4):
        if moving.shape[0] > 0 and (stage == 1 or stage == 3):
            move_faces(moving, 0.5 * step_s, faces)
        part_s = 0.0 if stage == 0 else step_s if stage == 3 else 0.5 * step_s
        for i in range(BODY_SIZE):
            trial[i] = body[i] + part_s * k[max(stage - 1, 0), i]
        derivative(
            trial,
            thrust_n,
            mass_kg,
            inertia,
            inertia_rate,
            behind,
            near,
            touches,
            constants,
            disturbance,
            faces,
            scratch.rotation if stage == 0 else scratch.turned,
            forces[0] if stage == 0 else forces[1],
            scratch,
            k[stage],
        )
    for i in range(BODY_SIZE):
        body[i] += step_s / 6 * (k[0, i] + 2 * k[1, i] + 2 * k[2, i] + k[3, i])
    normalise(body)
