"""What steers the flight beside commands: setpoints, sticks and targets to follow, as values."""

from dataclasses import dataclass
from typing import TypeAlias

from sim_vehicle.autopilot.messages import PositionTarget
from sim_vehicle.setpoint import Axis3, Quaternion, Vector3


@dataclass(frozen=True, slots=True)
class GlobalTarget:
    """SET_POSITION_TARGET_GLOBAL_INT with the ignored and the NaN fields as None. Velocity and acceleration are NED."""

    frame: int
    place: Vector3 | None
    """Latitude and longitude in degrees, altitude in metres; None where any of the three is ignored."""
    velocity_m_s: Axis3
    acceleration_m_s2: Axis3
    yaw_rad: float | None
    yaw_rate_rad_s: float | None
    is_force: bool


@dataclass(frozen=True, slots=True)
class AttitudeTarget:
    """SET_ATTITUDE_TARGET with the ignored fields as None."""

    attitude_wxyz: Quaternion | None
    rates_frd_rad_s: Axis3
    thrust: float | None
    """Along -z of the body, a fraction of the greatest; None where the mask leaves it out."""


@dataclass(frozen=True, slots=True)
class StickInput:
    """Sticks from -1 to 1: right, forward, up and right are positive."""

    roll: float
    pitch: float
    throttle: float
    yaw: float
    source: int
    """1: a radio; 2 and more: the first link and those after it."""


@dataclass(frozen=True, slots=True)
class RadioChannels:
    """RC_CHANNELS_OVERRIDE: pulses in microseconds, 18 of them; 0 and 65535 say nothing."""

    pulses_us: tuple[int, ...]


@dataclass(frozen=True, slots=True)
class FollowTarget:
    """FOLLOW_TARGET: where a target is and how it moves."""

    latitude_deg: float
    longitude_deg: float
    altitude_m: float
    velocity_ned_m_s: Vector3


FlightInput: TypeAlias = PositionTarget | GlobalTarget | AttitudeTarget | StickInput | RadioChannels | FollowTarget
