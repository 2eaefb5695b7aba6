"""Offboard setpoints: which are valid, when their stream counts as alive, and what they ask for.

Sources: MavlinkReceiver::handle_message_set_position_target_local_ned, commander's offboardCheck.cpp
and PositionControl::_inputValid of PX4; the two delays are measured on it.
"""

import math

from sim_vehicle.autopilot.messages import PositionTarget, Severity, StatusText
from sim_vehicle.setpoint import FREE, Axis3, TrajectorySetpoint

FRAME_LOCAL_NED = 1
FRAME_BODY_NED = 8

# The mode changes 1.03 to 1.11 s after the last setpoint: COM_OF_LOSS_T = 1.0 s, the commander's
# own cycle, and a check that runs only now and then. Here: at least 1.03 s, looked at every 76 ms.
SETPOINTS_LOST_AFTER_US = 1_030_000
CHECK_PERIOD_US = 76_000
# OFFBOARD can be chosen from the first setpoint on: it makes the commander check at once. Out of the
# failsafe, setpoints that come back lead 0.09 s after the first of them.
BACK_AFTER_US = 90_000

Quaternion = tuple[float, float, float, float]

STOP = TrajectorySetpoint(velocity_ned_m_s=(0.0, 0.0, 0.0))


class OffboardSignal:
    """Whether setpoints arrive, judged as late as PX4 judges it."""

    def __init__(self) -> None:
        self.arrives = False
        self.is_back = False
        """Whether it has arrived for long enough to end a failsafe."""
        self.ever_arrived = False
        self._first_us = 0
        self._last_us: int | None = None
        self._next_check_us = 0

    def heard(self, now_us: int) -> None:
        """A valid setpoint was received."""
        if self._last_us is None:
            self._first_us = now_us
        self._last_us = now_us
        self.ever_arrived = True

    def update(self, now_us: int) -> None:
        """Judge the stream; call at every step."""
        if self._last_us is None:
            return
        self.arrives = True
        self.is_back = now_us - self._first_us >= BACK_AFTER_US
        if now_us < self._next_check_us:
            return
        self._next_check_us = now_us + CHECK_PERIOD_US
        if now_us - self._last_us >= SETPOINTS_LOST_AFTER_US:
            self.arrives = self.is_back = False
            self._last_us = None


def refusal(target: PositionTarget) -> StatusText | None:
    """Why PX4 refuses the setpoint, which then counts as none at all; None where it is valid."""
    if target.frame not in (FRAME_LOCAL_NED, FRAME_BODY_NED):
        return _refused(f"coordinate frame {target.frame} unsupported")
    position, velocity, acceleration = _controlled(target)
    if acceleration != FREE and target.is_force:
        return _refused("force not supported")
    if position == FREE and velocity == FREE and acceleration == FREE:
        return _refused("invalid")
    return None


def trajectory_setpoint(target: PositionTarget, attitude_wxyz: Quaternion) -> TrajectorySetpoint:
    """The valid ``target`` in local NED; one that leaves an axis without any demand means stop."""
    position, velocity, acceleration = _controlled(target)
    if target.frame == FRAME_BODY_NED:
        velocity = _turned_by_yaw(velocity, attitude_wxyz)
        acceleration = _turned(acceleration, attitude_wxyz)
    if not _is_complete(position, velocity, acceleration):
        return STOP
    return TrajectorySetpoint(position, velocity, acceleration, target.yaw_rad, target.yaw_rate_rad_s)


def _refused(why: str) -> StatusText:
    return StatusText(Severity.CRITICAL, f"SET_POSITION_TARGET_LOCAL_NED {why}")


def _controlled(target: PositionTarget) -> tuple[Axis3, Axis3, Axis3]:
    """The vectors that count: in the body's frame no position, and only whole vectors."""
    if target.frame == FRAME_LOCAL_NED:
        return target.position_m, target.velocity_m_s, target.acceleration_m_s2
    velocity = FREE if None in target.velocity_m_s else target.velocity_m_s
    acceleration = FREE if None in target.acceleration_m_s2 else target.acceleration_m_s2
    return FREE, velocity, acceleration


def _is_complete(position: Axis3, velocity: Axis3, acceleration: Axis3) -> bool:
    """Every axis needs a demand, and north and east only come together."""
    if any((vector[0] is None) != (vector[1] is None) for vector in (position, velocity, acceleration)):
        return False
    return all(
        position[axis] is not None or velocity[axis] is not None or acceleration[axis] is not None for axis in range(3)
    )


def _turned_by_yaw(vector: Axis3, attitude_wxyz: Quaternion) -> Axis3:
    """Forward and right to north and east by the heading alone; down stays down."""
    forward, right, down = vector
    if forward is None or right is None:
        return FREE
    w, x, y, z = attitude_wxyz
    yaw = math.atan2(2 * (w * z + x * y), 1 - 2 * (y * y + z * z))
    cos, sin = math.cos(yaw), math.sin(yaw)
    return cos * forward - sin * right, sin * forward + cos * right, down


def _turned(vector: Axis3, attitude_wxyz: Quaternion) -> Axis3:
    """Body FRD to NED by the whole attitude."""
    x, y, z = vector
    if x is None or y is None or z is None:
        return FREE
    qw, qx, qy, qz = attitude_wxyz
    return (
        (1 - 2 * (qy * qy + qz * qz)) * x + 2 * (qx * qy - qw * qz) * y + 2 * (qx * qz + qw * qy) * z,
        2 * (qx * qy + qw * qz) * x + (1 - 2 * (qx * qx + qz * qz)) * y + 2 * (qy * qz - qw * qx) * z,
        2 * (qx * qz - qw * qy) * x + 2 * (qy * qz + qw * qx) * y + (1 - 2 * (qx * qx + qy * qy)) * z,
    )
