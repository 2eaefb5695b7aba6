"""Typed samples in.

World frame NED, body frame FRD, SI units, quaternions (w, x, y, z) body to NED. Times named `time_boot_us`
are the vehicle's own boot clock. None means "not given"; MAVLink's NaN and type masks stay in the codec.
"""

from dataclasses import dataclass
from enum import IntEnum
from typing import TypeAlias

Vector3: TypeAlias = tuple[float, float, float]
Quaternion: TypeAlias = tuple[float, float, float, float]


class CommandResult(IntEnum):
    """MAV_RESULT."""

    ACCEPTED = 0
    TEMPORARILY_REJECTED = 1
    DENIED = 2
    UNSUPPORTED = 3
    FAILED = 4
    IN_PROGRESS = 5
    CANCELLED = 6


class LandedState(IntEnum):
    """MAV_LANDED_STATE."""

    UNDEFINED = 0
    ON_GROUND = 1
    IN_AIR = 2
    TAKEOFF = 3
    LANDING = 4


class Severity(IntEnum):
    """MAV_SEVERITY, as far as the companion has something to say."""

    ERROR = 3
    WARNING = 4
    NOTICE = 5
    INFO = 6


class MessageId(IntEnum):
    """MAVLink ids of the streams the companion asks for and of the messages it requests."""

    ATTITUDE_QUATERNION = 31
    LOCAL_POSITION_NED = 32
    MANUAL_CONTROL = 69
    ATTITUDE_TARGET = 83
    POSITION_TARGET_LOCAL_NED = 85
    HIGHRES_IMU = 105
    AUTOPILOT_VERSION = 148
    ESTIMATOR_STATUS = 230
    VIBRATION = 241
    EXTENDED_SYS_STATE = 245
    ODOMETRY = 331
    CURRENT_MODE = 436


@dataclass(frozen=True, slots=True)
class Refused:
    """A message of the vehicle's that was not believed: a value that is not finite, or that no vehicle can have."""

    message: str
    reason: str


@dataclass(frozen=True, slots=True)
class Heartbeat:
    system_id: int
    component_id: int
    vehicle_type: int  # MAV_TYPE
    autopilot: int  # MAV_AUTOPILOT
    armed: bool
    custom_mode: int
    system_status: int  # MAV_STATE


@dataclass(frozen=True, slots=True)
class ImuSample:
    """HIGHRES_IMU: mean over the vehicle's integration interval that ends at `time_boot_us`."""

    time_boot_us: int
    specific_force_frd_m_s2: Vector3
    angular_velocity_frd_rad_s: Vector3


@dataclass(frozen=True, slots=True)
class LocalPosition:
    time_boot_us: int
    position_ned_m: Vector3
    velocity_ned_m_s: Vector3


@dataclass(frozen=True, slots=True)
class Odometry:
    """ODOMETRY: what LOCAL_POSITION_NED says, and how often the estimator has let it jump (modulo 256)."""

    time_boot_us: int
    position_ned_m: Vector3
    velocity_ned_m_s: Vector3
    reset_counter: int


@dataclass(frozen=True, slots=True)
class Attitude:
    """ATTITUDE_QUATERNION; the rates are those of the moment, not a mean."""

    time_boot_us: int
    attitude_wxyz: Quaternion
    angular_velocity_frd_rad_s: Vector3 | None = None


@dataclass(frozen=True, slots=True)
class AttitudeTarget:
    """ATTITUDE_TARGET: what the vehicle's position control asks of its attitude control."""

    time_boot_us: int
    thrust_fraction: float  # collective over the greatest, 0 to 1
    attitude_wxyz: Quaternion | None = None


@dataclass(frozen=True, slots=True)
class PositionTarget:
    """POSITION_TARGET_LOCAL_NED: the place that the vehicle's position control flies to; None where there is none."""

    position_ned_m: Vector3 | None


@dataclass(frozen=True, slots=True)
class GlobalPosition:
    """GLOBAL_POSITION_INT; altitude above mean sea level."""

    latitude_deg: float
    longitude_deg: float
    altitude_m: float


@dataclass(frozen=True, slots=True)
class Sticks:
    """MANUAL_CONTROL as PX4 tells it: the pilot's pitch, roll, throttle and yaw sticks, -1 to 1, 0 in the middle."""

    deflections: tuple[float, float, float, float]


@dataclass(frozen=True, slots=True)
class Vibration:
    """VIBRATION as PX4 fills it: the mean change from sample to sample, and clipped samples since boot.

    `clipping_counts` has one count for each accelerometer, its three axes together.
    """

    time_boot_us: int
    gyroscope_rad_s: float
    accelerometer_m_s2: float
    clipping_counts: tuple[int, int, int]


@dataclass(frozen=True, slots=True)
class Battery:
    """SYS_STATUS of a vehicle that knows its charge."""

    remaining_percent: int


@dataclass(frozen=True, slots=True)
class ExtendedState:
    landed_state: LandedState


@dataclass(frozen=True, slots=True)
class CurrentMode:
    custom_mode: int
    intended_custom_mode: int | None


@dataclass(frozen=True, slots=True)
class CommandAck:
    command: int  # MAV_CMD
    result: CommandResult


@dataclass(frozen=True, slots=True)
class TimeSyncRequest:
    """TIMESYNC with tc1 = 0: the vehicle asks for our time."""

    vehicle_time_ns: int


@dataclass(frozen=True, slots=True)
class TimeSyncAnswer:
    """TIMESYNC that answers ours: the time we sent, and the vehicle's when it answered."""

    companion_time_ns: int
    vehicle_time_ns: int


@dataclass(frozen=True, slots=True)
class Parameter:
    """PARAM_VALUE; whole numbers are int."""

    name: str
    value: int | float


@dataclass(frozen=True, slots=True)
class EstimatorStatus:
    """ESTIMATOR_STATUS: innovations against their gates (1 is turned down), and what is estimated."""

    ratios: tuple[float, ...]  # of velocity and place, as far as a sensor measures them
    horizontal_velocity_is_good: bool
    accelerometer_is_doubted: bool


@dataclass(frozen=True, slots=True)
class AutopilotVersion:
    flight_version: tuple[int, int, int]


Sample: TypeAlias = (
    Heartbeat
    | ImuSample
    | LocalPosition
    | Odometry
    | Attitude
    | AttitudeTarget
    | PositionTarget
    | GlobalPosition
    | Sticks
    | Vibration
    | Battery
    | ExtendedState
    | CurrentMode
    | CommandAck
    | TimeSyncRequest
    | TimeSyncAnswer
    | Parameter
    | EstimatorStatus
    | AutopilotVersion
    | Refused
)
