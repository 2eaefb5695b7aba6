"""A vehicle that has been cruising for a while: its lean, thrust, integrals and estimate at a steady velocity."""

import math

import numpy as np

from sim_vehicle.physics.estimate import EstimateErrors
from sim_vehicle.physics.layout import BODY_SIZE, GRAVITY_M_S2, Constants, Disturbance, PlantState
from sim_vehicle.quantities import Floats, Vector3, quaternion_from_matrix


def trim(
    state: PlantState,
    remembered: tuple[EstimateErrors, Floats],
    constants: Constants,
    disturbance: Disturbance,
    position_ned_m: Vector3,
    velocity_ned_m_s: Vector3,
    yaw_rad: float,
) -> None:
    """Write the steady flight through a position (NED, m) at a velocity (NED, m/s) into the state.

    The thrust carries the weight and the drag: R e3 lies along g e3 - a with m a = drag (eqs. 1 and 6). To lean so, a
    vehicle that thrusts more than its weight is asked for less (`control.position`).
    """
    velocity = np.array(velocity_ned_m_s)
    acceleration = constants.drag_n_s_m * (velocity - disturbance.wind_ned_m_s) / constants.mass_kg
    upheld = np.array([0.0, 0.0, GRAVITY_M_S2]) - acceleration
    rotation = _leaning(upheld, yaw_rad)
    state.body[:] = [*position_ned_m, *velocity_ned_m_s, *quaternion_from_matrix(rotation.tolist()), 0.0, 0.0, 0.0]
    state.velocity_integral[:] = acceleration
    state.velocity_integral[0:2] *= GRAVITY_M_S2 / upheld[2]
    state.attitude_setpoint[:] = rotation
    state.yaw_setpoint_rad = yaw_rad
    state.collective_n = constants.mass_kg * float(np.linalg.norm(upheld))
    state.motor_command_n[:] = state.motor_thrust_n[:] = state.collective_n / constants.rotors
    _remember(state, *remembered, 1e-6 * constants.raw_interval_us * constants.raw_per_interval)


def _remember(state: PlantState, errors: EstimateErrors, past: Floats, interval_s: float) -> None:
    """Let the estimate have seen the steady flight before."""
    slots, position, velocity = len(past), state.body[0:3].copy(), state.body[3:6]
    for step in range(slots):
        row = past[(errors.cursor + step) % slots]
        row[:BODY_SIZE] = state.body
        row[0:3] = position + (step - slots + 1) * interval_s * velocity
    delayed_s = max(slots - 1, 0) * interval_s
    state.estimate[:] = state.body[:10]
    state.estimate[0:3] += errors.error[0:3] - delayed_s * velocity
    state.estimate[3:6] += errors.error[3:6]
    state.acceleration_ned_m_s2[:] = 0.0


def _leaning(upheld: Floats, yaw_rad: float) -> Floats:
    """R (body to NED) with its third axis along ``upheld`` and the nose towards a heading."""
    b3 = upheld / np.linalg.norm(upheld)
    b2 = np.cross(b3, [math.cos(yaw_rad), math.sin(yaw_rad), 0.0])
    b2 /= np.linalg.norm(b2)
    return np.column_stack([np.cross(b2, b3), b2, b3])
