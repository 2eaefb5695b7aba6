"""Position control: the paper's cascaded P-PID (eq. 6), run at 100 Hz on the vehicle's own estimate."""

import math

import numpy as np

from sim_vehicle.airframe import THRUST_MIN
from sim_vehicle.physics.jit import njit
from sim_vehicle.physics.layout import GRAVITY_M_S2, Constants, Gains, PlantState, SetpointRows
from sim_vehicle.physics.rotation import yaw_of
from sim_vehicle.quantities import Floats, Vector3

POSITION_LOOP_HZ = 100
# An off-centre hit spins the vehicle by more than a right angle. Past that e_R of eq. 4 no longer tells tilt
# from heading, and the vehicle flies off; so R_d asks for at most this much turn at a time.
YAW_STEP_MAX_RAD = 0.5

# Of all thrust, PX4's MPC_THR_XY_MARG: what a vehicle that is asked to climb keeps for leaning.
HORIZONTAL_MARGIN = 0.3

# Rows of `SetpointRows`.
ASK_POSITION, ASK_VELOCITY, ASK_ACCELERATION = range(3)


@njit
def position_control(state: PlantState, asked: SetpointRows, constants: Constants) -> None:
    """Set thrust f and attitude R_d of ``state`` from what is asked (NED, SI).

    The D acts on the measured slope only: the paper's d/dt e_v would kick at every new setpoint.
    Eq. 6 gives a scalar f for the height; its three-axis form becomes thrust and direction as PX4 has it.
    """
    step_s = 1.0 / POSITION_LOOP_HZ
    acceleration = np.empty(3)
    for axis in range(3):
        acceleration[axis] = _axis_acceleration(axis, state, asked, constants)
    if asked.yaw[1]:
        state.yaw_setpoint_rad = asked.yaw[0]
    else:
        state.yaw_setpoint_rad += asked.yaw[2] * step_s
    _thrust(acceleration, constants.tilt_max_rad, constants.all_motors_max_n / constants.mass_kg)
    state.collective_n = constants.mass_kg * math.sqrt(acceleration @ acceleration)
    _attitude(state, acceleration)


@njit
def _axis_acceleration(axis: int, state: PlantState, asked: SetpointRows, gains: Gains) -> float:
    """One axis of eq. 6: v_d = k_p e_x, then PID on e_v; feed-forwards added where they are asked for."""
    feed_forward: float = asked.value[ASK_ACCELERATION, axis] if asked.given[ASK_ACCELERATION, axis] else 0.0
    controls_velocity = asked.given[ASK_POSITION, axis] or asked.given[ASK_VELOCITY, axis]
    if asked.given[ASK_ACCELERATION, axis] and not controls_velocity:
        return feed_forward
    wanted = asked.value[ASK_VELOCITY, axis] if asked.given[ASK_VELOCITY, axis] else 0.0
    if asked.given[ASK_POSITION, axis]:
        wanted += gains.position_p[axis] * (asked.value[ASK_POSITION, axis] - state.estimate[axis])
    if axis == 2:
        wanted = min(max(wanted, -gains.climb_max_m_s), gains.descent_max_m_s)
    else:
        wanted = min(max(wanted, -gains.speed_max_m_s), gains.speed_max_m_s)
    error = wanted - state.estimate[3 + axis]
    proportional: float = gains.velocity_p[axis] * error
    # Horizontally, integrate only what the tilt limit lets happen; an integral wound up while
    # saturated is what carries a vehicle past its setpoint.
    limit = GRAVITY_M_S2 * math.tan(gains.tilt_max_rad)
    if abs(proportional) < limit:
        state.velocity_integral[axis] += gains.velocity_i[axis] * error / POSITION_LOOP_HZ
    slope: float = gains.velocity_d[axis] * state.acceleration_ned_m_s2[axis]
    integral: float = state.velocity_integral[axis]
    return proportional + integral - slope + feed_forward


@njit
def _thrust(acceleration: Floats, tilt_max_rad: float, most_m_s2: float) -> None:
    """Turn what is asked into thrust over mass, of ``most_m_s2`` at most, NED; as `PositionControl.cpp` of PX4.

    It tilts as if it hovered (MPC_ACC_DECOUPLE). Its thrust holds the height at the commanded tilt, not at the present
    one: tipped onto a wall it presses with all of its weight. Where there is too little thrust, height comes first.
    """
    horizontal = math.hypot(acceleration[0], acceleration[1])
    leant = min(horizontal / GRAVITY_M_S2, math.tan(tilt_max_rad))
    up = max(GRAVITY_M_S2 - acceleration[2], THRUST_MIN * most_m_s2 / math.hypot(1.0, leant))
    aside = up * leant
    up = min(up, math.sqrt(most_m_s2**2 - min(aside, HORIZONTAL_MARGIN * most_m_s2) ** 2))
    aside = min(aside, math.sqrt(max(most_m_s2**2 - up**2, 0.0)))
    scale = aside / max(horizontal, 1e-9)
    acceleration[0] *= scale
    acceleration[1] *= scale
    acceleration[2] = -up


@njit
def _attitude(state: PlantState, thrust: Floats) -> None:
    """R_d with b3 against the thrust and the nose towards the asked yaw."""
    magnitude = math.sqrt(thrust @ thrust)
    b3 = -thrust[0] / magnitude, -thrust[1] / magnitude, -thrust[2] / magnitude
    yaw_now = yaw_of(state.estimate)
    error = state.yaw_setpoint_rad - yaw_now
    error -= 2 * math.pi * math.floor((error + math.pi) / (2 * math.pi))
    yaw = yaw_now + min(max(error, -YAW_STEP_MAX_RAD), YAW_STEP_MAX_RAD)
    nose = math.cos(yaw), math.sin(yaw), 0.0
    b2 = _cross(b3, nose)
    length = math.sqrt(b2[0] * b2[0] + b2[1] * b2[1] + b2[2] * b2[2])
    b2 = b2[0] / length, b2[1] / length, b2[2] / length
    b1 = _cross(b2, b3)
    for i in range(3):
        state.attitude_setpoint[i, 0] = b1[i]
        state.attitude_setpoint[i, 1] = b2[i]
        state.attitude_setpoint[i, 2] = b3[i]


@njit
def _cross(a: Vector3, b: Vector3) -> Vector3:
    """Numba compiles its own for a second."""
    return a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]
