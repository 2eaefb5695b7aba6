"""What the autopilot asks of the control: a point of a trajectory, an attitude, or body rates."""

from dataclasses import dataclass
from typing import TypeAlias

from sim_vehicle.quantities import Axis3, Quaternion, Vector3

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


@dataclass(frozen=True, slots=True)
class AttitudeSetpoint:
    """An attitude (w, x, y, z; body to NED) with thrust; PX4's vehicle_attitude_setpoint."""

    attitude_wxyz: Quaternion
    thrust_fraction: float
    """Of all four motors together, over their greatest."""
    yaw_rate_rad_s: float = 0.0


@dataclass(frozen=True, slots=True)
class RatesSetpoint:
    """Body rates with thrust; PX4's vehicle_rates_setpoint."""

    rates_frd_rad_s: Vector3
    thrust_fraction: float


Setpoint: TypeAlias = TrajectorySetpoint | AttitudeSetpoint | RatesSetpoint
