"""What goes to PX4's `simulator_mavlink` and what comes back, in SI units but where PX4 wants others."""

from dataclasses import dataclass
from typing import TypeAlias

from sim_vehicle.airframe import MOST_ROTORS
from sim_vehicle.estimator.samples import CaptureSample, FlowSample, RangeSample
from sim_vehicle.geography import Place
from sim_vehicle.quantities import Vector3

MOTORS_STOPPED = (0.0,) * MOST_ROTORS


@dataclass(frozen=True, slots=True)
class Air:
    """A barometer's sample."""

    pressure_hpa: float
    altitude_m: float
    """Of the standard atmosphere at that pressure's true height; PX4 computes its own from the pressure."""
    temperature_c: float


@dataclass(frozen=True, slots=True)
class HilSensor:
    """One sample of the inertial sensor; the slower sensors come with it when they are due, else None."""

    time_us: int
    """Becomes PX4's own clock."""
    specific_force_frd_m_s2: Vector3
    angular_velocity_frd_rad_s: Vector3
    magnetic_field_frd_gauss: Vector3 | None
    air: Air | None


@dataclass(frozen=True, slots=True)
class HilGps:
    """A fix in three dimensions."""

    time_us: int
    place: Place
    velocity_ned_m_s: Vector3
    accuracy_m: float
    """One standard deviation, horizontal and vertical."""


ToPx4: TypeAlias = HilSensor | HilGps | CaptureSample | FlowSample | RangeSample


@dataclass(frozen=True, slots=True)
class ActuatorControls:
    """PX4's answer to a sample of the inertial sensor."""

    time_us: int
    """The sample's, as PX4's clock stands still until the next one."""
    armed: bool
    is_lockstep: bool
    motor_fractions: tuple[float, ...]
    """Thrust asked of each motor over its greatest, in motor order."""
