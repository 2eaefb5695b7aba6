"""What the autopilot asks of the position controller."""

from dataclasses import dataclass

Axis3 = tuple[float | None, float | None, float | None]

FREE: Axis3 = (None, None, None)


@dataclass(frozen=True, slots=True)
class TrajectorySetpoint:
    """A point of a trajectory in local NED; None means that the axis is not controlled by that term.

    The meaning is PX4's trajectory_setpoint: velocity and acceleration are feed-forward where
    position is given too, and the whole demand where it is not.
    """

    position_ned_m: Axis3 = FREE
    velocity_ned_m_s: Axis3 = FREE
    acceleration_ned_m_s2: Axis3 = FREE
    yaw_rad: float | None = None
    yaw_rate_rad_s: float | None = None
