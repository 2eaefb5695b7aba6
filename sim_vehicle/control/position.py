"""Position control: the paper's cascaded P-PID (eq. 6), run at 100 Hz on the vehicle's own estimate."""

import math

import numpy as np
import numpy.typing as npt

from sim_vehicle.physics.jit import njit
from sim_vehicle.physics.layout import GRAVITY_M_S2, Asked, Gains, State
from sim_vehicle.physics.rotation import matrix_from_quaternion, yaw_of

Floats = npt.NDArray[np.float64]

POSITION_LOOP_HZ = 100
# An off-centre hit spins the vehicle by more than a right angle. Past that e_R of eq. 4 no longer tells tilt
# from heading, and the vehicle flies off; so R_d asks for at most this much turn at a time.
YAW_STEP_MAX_RAD = 0.5

# Rows of `Asked`.
ASK_POSITION, ASK_VELOCITY, ASK_ACCELERATION = range(3)


@njit
def position_control(state: State, mass_kg: float, asked: Asked, gains: Gains) -> None:
    """Set thrust f and attitude R_d of ``state`` from what is asked (NED, SI).

    The D acts on the measured slope only: the paper's d/dt e_v would kick at every new setpoint.
    Eq. 6 gives a scalar f for the height; its three-axis form turns the asked acceleration into the
    thrust direction, as in the paper's reference for the attitude (Lee et al., 2010).
    """
    step_s = 1.0 / POSITION_LOOP_HZ
    acceleration = np.empty(3)
    for axis in range(3):
        acceleration[axis] = _axis_acceleration(axis, state, asked, gains)
    _limit_tilt(acceleration, gains.tilt_max_rad)
    if asked.yaw[1]:
        state.yaw_setpoint_rad = asked.yaw[0]
    else:
        state.yaw_setpoint_rad += asked.yaw[2] * step_s
    _thrust_and_attitude(state, mass_kg, acceleration)


@njit
def _axis_acceleration(axis: int, state: State, asked: Asked, gains: Gains) -> float:
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
def _limit_tilt(acceleration: Floats, tilt_max_rad: float) -> None:
    """Scale the horizontal part so that the thrust leans at most ``tilt_max_rad``; height comes first."""
    # Half of gravity: a vehicle must keep thrust to steer with even when asked to fall.
    acceleration[2] = min(acceleration[2], 0.5 * GRAVITY_M_S2)
    most = (GRAVITY_M_S2 - acceleration[2]) * math.tan(tilt_max_rad)
    horizontal = math.hypot(acceleration[0], acceleration[1])
    if horizontal > most:
        acceleration[0] *= most / horizontal
        acceleration[1] *= most / horizontal


@njit
def _thrust_and_attitude(state: State, mass_kg: float, acceleration: Floats) -> None:
    """f = m (g e3 - a) . R e3 and R_d with b3 along g e3 - a and the nose towards the asked yaw."""
    rotation = np.empty((3, 3))
    matrix_from_quaternion(state.estimate, rotation)
    b3 = np.empty(3)
    for i in range(3):
        b3[i] = -acceleration[i]
    b3[2] += GRAVITY_M_S2
    along = b3[0] * rotation[0, 2] + b3[1] * rotation[1, 2] + b3[2] * rotation[2, 2]
    state.collective_n = max(0.0, mass_kg * along)
    b3 /= math.sqrt(b3[0] * b3[0] + b3[1] * b3[1] + b3[2] * b3[2])
    yaw_now = yaw_of(state.estimate)
    error = state.yaw_setpoint_rad - yaw_now
    error -= 2 * math.pi * math.floor((error + math.pi) / (2 * math.pi))
    yaw = yaw_now + min(max(error, -YAW_STEP_MAX_RAD), YAW_STEP_MAX_RAD)
    nose = np.array([math.cos(yaw), math.sin(yaw), 0.0])
    b2 = np.cross(b3, nose)
    b2 /= math.sqrt(b2[0] * b2[0] + b2[1] * b2[1] + b2[2] * b2[2])
    b1 = np.cross(b2, b3)
    for i in range(3):
        state.attitude_setpoint[i, 0] = b1[i]
        state.attitude_setpoint[i, 1] = b2[i]
        state.attitude_setpoint[i, 2] = b3[i]
