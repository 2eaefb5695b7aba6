"""Attitude tracking on SO(3), the paper's eqs. 4 and 5, run at 150 Hz, and the motor commands for it."""

import numpy as np

from sim_vehicle.airframe import MOST_ROTORS
from sim_vehicle.physics.inertia import times
from sim_vehicle.physics.jit import njit
from sim_vehicle.physics.layout import Constants, PlantState
from sim_vehicle.physics.rotation import matrix_from_quaternion
from sim_vehicle.quantities import Floats

ATTITUDE_LOOP_HZ = 150


@njit
def attitude_control(state: PlantState, constants: Constants, yaw_rate_rad_s: float) -> None:
    """Set the moment tau of ``state``: tau = -k_R e_R - k_W e_W + W x J W + J' W (eq. 5).

    e_R = (R_d^T R - R^T R_d)^vee / 2 and e_W = W - R^T R_d W_d (eq. 4), where the asked rate W_d is the
    asked yaw rate about the asked b3. The setpoint comes in steps, so its angular acceleration alpha is
    taken as zero. J is that of the arms as they are folded; its rate is the term that a J which varies
    adds to eq. 5's tracking (the paper refers to its proof elsewhere).
    """
    r = np.empty((3, 3))
    matrix_from_quaternion(state.estimate, r)
    d = state.attitude_setpoint
    product = d.T @ r
    error = np.array([product[2, 1] - product[1, 2], product[0, 2] - product[2, 0], product[1, 0] - product[0, 1]])
    track(state, constants, error, product[2] * yaw_rate_rad_s)


@njit
def track(state: PlantState, constants: Constants, error: Floats, asked_frd_rad_s: Floats) -> None:
    """Set the moment of ``state`` for twice an e_R and asked body rates; without an error it is the rate loop."""
    rates = np.empty(3)
    for i in range(3):
        rates[i] = state.body[10 + i] + constants.gyroscope_bias_frd_rad_s[i]
    p, q, r = rates[0], rates[1], rates[2]
    x, y, z = times(state.inertia, p, q, r)
    fx, fy, fz = times(state.inertia_rate, p, q, r)
    # W x J W + J' W: what the body's own turning calls for.
    carried = np.array([q * z - r * y + fx, r * x - p * z + fy, p * y - q * x + fz])
    for i in range(3):
        state.moment_frd_n_m[i] = (
            -constants.k_r[i] * 0.5 * error[i] - constants.k_omega[i] * (rates[i] - asked_frd_rad_s[i]) + carried[i]
        )


@njit
def allocate_motors(state: PlantState, constants: Constants) -> None:
    """Share thrust and moment among the motors: roll and pitch first, then thrust, then yaw.

    A vehicle that cannot have everything must at least stay upright; yaw matters least.
    """
    low, high, rotors, mix = constants.motor_idle_n, constants.motor_max_n, constants.rotors, constants.mix
    tilt = np.empty(MOST_ROTORS)
    smallest, largest = 0.0, 0.0
    for motor in range(rotors):
        roll = mix[motor, 0] * state.moment_frd_n_m[0]
        pitch = mix[motor, 1] * state.moment_frd_n_m[1]
        tilt[motor] = (roll + pitch) / constants.roll_lever_m
        smallest = min(smallest, tilt[motor])
        largest = max(largest, tilt[motor])
    scale = min(1.0, (high - low) / max(largest - smallest, 1e-9))
    each = min(max(state.collective_n / rotors, low - scale * smallest), high - scale * largest)
    room = high
    for motor in range(rotors):
        thrust = each + scale * tilt[motor]
        # A motor on which yaw does not act leaves room enough.
        share = max(abs(mix[motor, 2]), 1e-6)
        room = min(room, (thrust - low) / share, (high - thrust) / share)
    yaw = state.moment_frd_n_m[2] / constants.yaw_lever_m
    yaw = min(max(yaw, -max(room, 0.0)), max(room, 0.0))
    for motor in range(rotors):
        state.motor_command_n[motor] = each + scale * tilt[motor] + mix[motor, 2] * yaw
