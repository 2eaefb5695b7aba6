"""What the aiding sensors say, as values: all that the filter ever gets to know of the world."""

from dataclasses import dataclass
from typing import TypeAlias

from sim_vehicle.quantities import Quaternion, Vector3

NO_QUALITY, BEST_QUALITY = 0, 255


@dataclass(frozen=True, slots=True)
class FlowSample:
    """What a PX4FLOW integrates over one of its periods, in the order and with the signs of OPTICAL_FLOW_RAD.

    A turn to the right about an axis makes both flow and gyroscope positive; moving forward makes a
    positive flow about y, moving right a negative one about x.
    """

    time_us: int
    """The end of the integration."""
    integration_us: int
    flow_frd_rad: tuple[float, float]
    gyroscope_frd_rad: Vector3
    quality: int
    """0 (nothing seen) to 255."""


@dataclass(frozen=True, slots=True)
class RangeSample:
    """Distance along the body's down axis to whatever is nearest there; None where nothing came back."""

    time_us: int
    distance_m: float | None
    distance_min_m: float
    distance_max_m: float


@dataclass(frozen=True, slots=True)
class HeadingSample:
    """Where the nose points, from north, clockwise from above."""

    time_us: int
    yaw_rad: float


@dataclass(frozen=True, slots=True)
class CaptureSample:
    """What cameras around the room see; PX4 takes it as external vision, and only if EKF2_EV_CTRL says so."""

    time_us: int
    position_ned_m: Vector3
    attitude_wxyz: Quaternion
    noise_m: float
    """Standard deviation per axis."""
    noise_rad: float


Sample: TypeAlias = FlowSample | RangeSample | HeadingSample | CaptureSample
