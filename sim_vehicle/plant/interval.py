"""One IMU interval of the plant: loops -> motors -> contact and rigid body -> inertial sensor, raw by raw."""

import math

import numpy as np

from sim_vehicle.control.attitude import ATTITUDE_LOOP_HZ, allocate_motors, attitude_control, track
from sim_vehicle.control.position import POSITION_LOOP_HZ, position_control
from sim_vehicle.physics.estimate import update_estimate, update_slope
from sim_vehicle.physics.imu import add_raw_sample
from sim_vehicle.physics.jit import borrowed, inlined, njit
from sim_vehicle.physics.layout import (
    ASKED_ATTITUDE,
    ASKED_RATES,
    ASKED_TRAJECTORY,
    POINTS,
    Constants,
    Disturbance,
    PlantState,
    Scratch,
    SetpointRows,
)
from sim_vehicle.physics.report import write_report
from sim_vehicle.physics.rigid_body import runge_kutta_step
from sim_vehicle.physics.rotation import matrix_from_quaternion, yaw_of
from sim_vehicle.physics.touching.contact import relax_arms, settle_arms
from sim_vehicle.physics.touching.hits import close_old_hit, note_contact
from sim_vehicle.physics.touching.proximity import find_close, find_near
from sim_vehicle.quantities import Floats, Ints
from sim_vehicle.world import FACE_VELOCITY

MOTORS_OFF, MOTORS_IDLE, MOTORS_FLYING, MOTORS_DRIVEN = range(4)

# Steps in one raw interval (125 us) while something stiff touches or is about to: 12.5 us is 80 steps in
# the rigid vehicle's 1 ms of contact. Halving it changes no rebound speed by 0.1 %.
FINE_STEPS = 10
# How much deeper than before a part may be after a step: twice its travel, for what a rebound adds, and the rounding
# where one face ends and the next begins.
TRAVEL_FACTOR = 2.0
NEWLY_TOUCHED_M = 2e-5
# A guard this close to a face, beyond the travel of one raw interval, calls for fine steps.
TOUCH_MARGIN_M = 0.0005


@njit
def advance_interval(
    states: Floats,
    setpoints: Floats,
    motors: int,
    noise: Floats,
    all_constants: Floats,
    disturbances: Floats,
    faces: Floats,
    moving: Ints,
    behind: Ints,
    near: Ints,
    forces: Floats,
    scratches: Floats,
    all_errors: Floats,
    past: Floats,
    report: Floats,
) -> None:
    """Advance the state by one integration interval, renew the vehicle's estimate, fill ``report``.

    Who drives the motors from outside has an estimate and a frame of its own: a hit notes no offset of ours then.

    Each record comes as an array of one. ``motors``: off, idling, flying the setpoint, or driven (as
    `PlantState.motor_command_n` says). ``noise`` is standard normal: six values a raw sample, then nine for the
    estimate. ``behind`` (POINTS, n faces) is 1 where a point is behind a face without having met it and belongs to
    the state; ``near`` (n faces) and ``forces`` (2, POINTS, n faces) are working memory. ``moving`` are the rows of
    ``faces`` that have a velocity: they are moved on. ``past`` without rows: the estimate comes from elsewhere.
    """
    state, asked, constants, disturbance = states[0], setpoints[0], all_constants[0], disturbances[0]
    scratch, errors, noise, past = scratches[0], all_errors[0], borrowed(noise), borrowed(past)
    faces, moving, behind = borrowed(faces), borrowed(moving), borrowed(behind)
    near, forces = borrowed(near), borrowed(forces)
    state.peak_force_n = 0.0
    state.finished_count = 0
    state.specific_force_sum[:] = 0.0
    state.rate_sum[:] = 0.0
    state.clipped_off_m_s[:] = 0.0
    interval_s = 1e-6 * constants.raw_per_interval * constants.raw_interval_us
    touches = find_near(state.body, interval_s, constants, faces, near, scratch)
    spun = 1.0 - math.exp(-1e-6 * constants.raw_interval_us / constants.motor_time_constant_s)
    if motors in (MOTORS_OFF, MOTORS_IDLE):
        rest_loops(state)
        state.motor_command_n[:] = constants.motor_idle_n if motors == MOTORS_IDLE else 0.0
    for raw in range(constants.raw_per_interval):
        if motors == MOTORS_FLYING:
            run_loops(state, asked, constants)
        spin_motors(state, spun, constants, disturbance)
        for i in range(3):
            scratch.velocity_before[i] = state.body[3 + i]
            scratch.rates_before[i] = state.body[10 + i]
        move_body(state, touches, constants, disturbance, faces, moving, behind, near, forces, scratch)
        add_raw_sample(state, scratch, noise, raw, constants, disturbance)
        state.time_us += constants.raw_interval_us
    close_old_hit(state)
    if past.shape[0] > 0:
        update_estimate(state, errors, past, noise, disturbance)
        update_slope(state, errors, interval_s)
    if motors == MOTORS_DRIVEN:
        state.frame_offset_ned_m[:] = 0.0
    write_report(state, constants, borrowed(report))


@njit
def run_loops(state: PlantState, asked: SetpointRows, constants: Constants) -> None:
    """Run whichever inner loop is due: position at 100 Hz, attitude at 150 Hz (paper, section V).

    Asked for an attitude or rates, the loops above are left out and begin anew when they are next needed.
    """
    time_us = state.time_us
    if asked.level != ASKED_TRAJECTORY:
        rest_loops(state)
    elif time_us * POSITION_LOOP_HZ >= state.position_loops * 1_000_000:
        state.position_loops = time_us * POSITION_LOOP_HZ // 1_000_000 + 1
        position_control(state, asked, constants)
    if time_us * ATTITUDE_LOOP_HZ >= state.attitude_loops * 1_000_000:
        state.attitude_loops = time_us * ATTITUDE_LOOP_HZ // 1_000_000 + 1
        if asked.level != ASKED_TRAJECTORY:
            state.collective_n = asked.thrust * constants.all_motors_max_n
        if asked.level == ASKED_ATTITUDE:
            for row in range(3):
                for column in range(3):
                    state.attitude_setpoint[row, column] = asked.attitude[row, column]
        if asked.level == ASKED_RATES:
            track(state, constants, np.zeros(3), asked.rates_frd_rad_s)
        else:
            attitude_control(state, constants, asked.yaw[2])
        allocate_motors(state, constants)


@njit
def rest_loops(state: PlantState) -> None:
    """Start the next flight with clean integrals, facing as the vehicle stands."""
    state.velocity_integral[:] = 0.0
    state.yaw_setpoint_rad = yaw_of(state.estimate)


@inlined
def spin_motors(state: PlantState, share: float, constants: Constants, disturbance: Disturbance) -> None:
    """First-order lag of each motor's thrust: in a raw interval by ``share`` nearer to what it gives of its command."""
    for motor in range(constants.rotors):
        command = min(max(state.motor_command_n[motor], 0.0), constants.motor_max_n)
        given = disturbance.motor_share[motor] * command
        state.motor_thrust_n[motor] += share * (given - state.motor_thrust_n[motor])


@inlined
def move_body(
    state: PlantState,
    touches: bool,
    constants: Constants,
    disturbance: Disturbance,
    faces: Floats,
    moving: Ints,
    behind: Ints,
    near: Ints,
    forces: Floats,
    scratch: Scratch,
) -> None:
    """Move the body through one raw interval, in fine steps while something stiff may touch."""
    body = state.body
    raw_s = 1e-6 * constants.raw_interval_us
    steps, travel_m = 1, 0.0
    if touches:
        matrix_from_quaternion(body, scratch.rotation)
        speed = math.sqrt(body[3] * body[3] + body[4] * body[4] + body[5] * body[5])
        tip_speed = constants.reach_m * (abs(body[10]) + abs(body[11]) + abs(body[12]))
        travel_m = (speed + tip_speed + fastest_m_s(moving, faces)) * raw_s
        if find_close(body, behind, near, travel_m + TOUCH_MARGIN_M, constants, faces, scratch):
            steps = FINE_STEPS
    step_s = raw_s / steps
    for step in range(steps):
        if touches:
            for point in range(POINTS):
                scratch.share[point] = state.share[point]
                scratch.deepest_m[point] = state.depth_m[point] + TRAVEL_FACTOR * travel_m / steps + NEWLY_TOUCHED_M
        relax_arms(state, step_s, constants, scratch.relaxed_m)
        runge_kutta_step(state, behind, near, touches, step_s, constants, disturbance, faces, moving, forces, scratch)
        settle_arms(state, behind, near, touches, step_s, constants, faces, scratch)
        if touches:
            mass_kg = constants.mass_kg + disturbance.carried_kg
            note_contact(state, 1e6 * step * step_s, step_s, near, forces[0], constants, faces, mass_kg, scratch)


@inlined
def fastest_m_s(moving: Ints, faces: Floats) -> float:
    """An upper bound of the speed of anything that moves."""
    fastest = 0.0
    for row in moving:
        speed = 0.0
        for i in range(3):
            speed += abs(faces[row, FACE_VELOCITY + i])
        fastest = max(fastest, speed)
    return fastest
