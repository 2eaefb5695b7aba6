"""Typed samples in and typed commands out: the only language between the codec and the core.

World frame NED, body frame FRD, SI units, quaternions (w, x, y, z) body to NED. Times named `time_boot_us`
are the vehicle's own boot clock. None means "not given"; MAVLink's NaN and type masks stay in the codec.
"""

import math
from dataclasses import dataclass
from enum import IntEnum
from typing import TypeAlias

Vector3: TypeAlias = tuple[float, float, float]
Quaternion: TypeAlias = tuple[float, float, float, float]


class Sample:
    """A received message."""

    __slots__ = ()


class Outgoing:
    """A message to be sent."""

    __slots__ = ()


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
    """MAV_SEVERITY: the levels that the companion uses."""

    ERROR = 3
    WARNING = 4
    NOTICE = 5
    INFO = 6


class MessageId(IntEnum):
    """MAVLink ids of the streams the companion asks for and of the messages it requests."""

    HEARTBEAT = 0
    GPS_RAW_INT = 24
    SCALED_IMU = 26
    RAW_IMU = 27
    ATTITUDE_QUATERNION = 31
    LOCAL_POSITION_NED = 32
    RC_CHANNELS = 65
    MANUAL_CONTROL = 69
    ATTITUDE_TARGET = 83
    POSITION_TARGET_LOCAL_NED = 85
    HIGHRES_IMU = 105
    AUTOPILOT_VERSION = 148
    EKF_STATUS_REPORT = 193
    ESTIMATOR_STATUS = 230
    VIBRATION = 241
    EXTENDED_SYS_STATE = 245
    ODOMETRY = 331
    CURRENT_MODE = 436


@dataclass(frozen=True, slots=True)
class Refused(Sample):
    """A message of the vehicle's that was not accepted: a value is not finite, or no vehicle can have it."""

    message: str
    reason: str


@dataclass(frozen=True, slots=True)
class Heartbeat(Sample):
    system_id: int
    component_id: int
    vehicle_type: int  # MAV_TYPE
    autopilot: int  # MAV_AUTOPILOT
    armed: bool
    custom_mode: int
    system_status: int  # MAV_STATE


@dataclass(frozen=True, slots=True)
class ImuSample(Sample):
    """HIGHRES_IMU: mean over the vehicle's integration interval that ends at `time_boot_us`."""

    time_boot_us: int
    specific_force_frd_m_s2: Vector3
    angular_velocity_frd_rad_s: Vector3


@dataclass(frozen=True, slots=True)
class ScaledImu(Sample):
    """SCALED_IMU: a sample of PX4's as it is measured, without what its estimator takes for biases."""

    time_boot_us: int
    specific_force_frd_m_s2: Vector3
    angular_velocity_frd_rad_s: Vector3


@dataclass(frozen=True, slots=True)
class LocalPosition(Sample):
    time_boot_us: int
    position_ned_m: Vector3
    velocity_ned_m_s: Vector3


@dataclass(frozen=True, slots=True)
class GpsFix(Sample):
    """GPS_RAW_INT: the receiver's own horizontal velocity, by Doppler shift, and place. Its stamp is no boot time.

    The altitude is above mean sea level.
    """

    velocity_ne_m_s: tuple[float, float]
    latitude_deg: float
    longitude_deg: float
    altitude_m: float


@dataclass(frozen=True, slots=True)
class Odometry(Sample):
    """ODOMETRY: position and velocity as in LOCAL_POSITION_NED, and the number of resets (modulo 256)."""

    time_boot_us: int
    position_ned_m: Vector3
    velocity_ned_m_s: Vector3
    reset_counter: int


@dataclass(frozen=True, slots=True)
class Attitude(Sample):
    """ATTITUDE_QUATERNION; the rates are those of the moment, not a mean."""

    time_boot_us: int
    attitude_wxyz: Quaternion
    angular_velocity_frd_rad_s: Vector3 | None = None


@dataclass(frozen=True, slots=True)
class AttitudeTarget(Sample):
    """ATTITUDE_TARGET: the setpoint of the vehicle's attitude control."""

    time_boot_us: int
    thrust_fraction: float  # collective over the greatest, 0 to 1
    attitude_wxyz: Quaternion | None = None


@dataclass(frozen=True, slots=True)
class PositionTarget(Sample):
    """POSITION_TARGET_LOCAL_NED: the setpoint of the vehicle's position control; None where there is none."""

    position_ned_m: Vector3 | None
    velocity_down_m_s: float | None = None


@dataclass(frozen=True, slots=True)
class Asked:
    """Where a program's setpoint leads, local NED; None where it does not say."""

    place_ned_m: Vector3 | None = None
    velocity_ned_m_s: Vector3 | None = None


@dataclass(frozen=True, slots=True)
class Sticks(Sample):
    """MANUAL_CONTROL as PX4 sends it: the pilot's pitch, roll, throttle and yaw sticks, -1 to 1, 0 in the middle."""

    deflections: tuple[float, float, float, float]


@dataclass(frozen=True, slots=True)
class MotorOutputs(Sample):
    """SERVO_OUTPUT_RAW of the main outputs: four to eight, microseconds of PWM or a driver's own units."""

    outputs: tuple[float, ...]


@dataclass(frozen=True, slots=True)
class Vibration(Sample):
    """VIBRATION: clipped samples since boot, of all accelerometers and axes together."""

    clipped: int


@dataclass(frozen=True, slots=True)
class Battery(Sample):
    """SYS_STATUS of a vehicle that knows its charge."""

    remaining_percent: int


@dataclass(frozen=True, slots=True)
class ExtendedState(Sample):
    landed_state: LandedState


@dataclass(frozen=True, slots=True)
class CurrentMode(Sample):
    custom_mode: int
    intended_custom_mode: int | None  # the user's last request, where the message has it


@dataclass(frozen=True, slots=True)
class CommandAck(Sample):
    command: int  # MAV_CMD
    result: CommandResult


@dataclass(frozen=True, slots=True)
class TimeSync(Sample, Outgoing):
    """TIMESYNC, either way: who asks sends its own time, which whoever answers sends back with its own."""

    asked_ns: int
    answered_ns: int | None = None  # of a question


@dataclass(frozen=True, slots=True)
class StatusText(Sample, Outgoing):
    """STATUSTEXT, either way: a long one goes in as many packets as it needs, and comes in pieces, each by itself.

    Of the vehicle's it is a warning or worse: why it does not arm, or which failsafe acts.
    """

    severity: int  # MAV_SEVERITY
    text: str


@dataclass(frozen=True, slots=True)
class Parameter(Sample, Outgoing):
    """PARAM_VALUE, or PARAM_SET on its way to the vehicle. Whole numbers are int: INT32 for PX4, all others REAL32."""

    name: str
    value: int | float


@dataclass(frozen=True, slots=True)
class EstimatorStatus(Sample):
    """ESTIMATOR_STATUS: innovation test ratios (rejected above 1), and which states are estimated."""

    ratios: tuple[float, ...]  # of velocity and position, for each sensor that is used
    horizontal_velocity_is_good: bool
    accelerometer_is_faulty: bool


@dataclass(frozen=True, slots=True)
class AutopilotVersion(Sample):
    flight_version: tuple[int, int, int]


@dataclass(frozen=True, slots=True)
class VehicleCommand:
    """COMMAND_LONG: MAV_CMD and its first parameters; all others are 0, as PX4 wants them. `text` is for people."""

    command_id: int
    parameters: tuple[float, ...]
    text: str
    custom_mode: int | None = None  # of one that asks for a mode, as the autopilot numbers it


# MAV_CMD_COMPONENT_ARM_DISARM. By force: also where PX4 does not know that it has landed.
ARM = VehicleCommand(400, (1.0,), "arm")
DISARM = VehicleCommand(400, (0.0,), "disarm")
DISARM_BY_FORCE = VehicleCommand(400, (0.0, 21196.0), "disarm")


def set_message_interval(message_id: int, interval_us: int) -> VehicleCommand:
    """MAV_CMD_SET_MESSAGE_INTERVAL."""
    return VehicleCommand(511, (message_id, interval_us), f"message {message_id} every {interval_us / 1000:g} ms")


def request_message(message_id: int) -> VehicleCommand:
    """MAV_CMD_REQUEST_MESSAGE."""
    return VehicleCommand(512, (message_id,), f"message {message_id}")


def take_off(height_m: float) -> VehicleCommand:
    """MAV_CMD_NAV_TAKEOFF, upwards from here: of an autopilot that no setpoint lifts off the ground."""
    return VehicleCommand(22, (0.0, 0.0, 0.0, 0.0, 0.0, 0.0, height_m), f"take-off to {height_m:g} m")


@dataclass(frozen=True, slots=True)
class SendCommand(Outgoing):
    """A command with its transmission count, as COMMAND_LONG.confirmation wants it."""

    command: VehicleCommand
    confirmation: int


@dataclass(frozen=True, slots=True)
class PositionSetpoint(Outgoing):
    """Setpoint in the vehicle's local NED; a None part is left to the vehicle."""

    time_us: int
    position_ned_m: Vector3
    yaw_rad: float | None
    velocity_ned_m_s: Vector3 | None = None
    acceleration_ned_m_s2: Vector3 | None = None


@dataclass(frozen=True, slots=True)
class AttitudeSetpoint(Outgoing):
    """SET_ATTITUDE_TARGET: attitude in the vehicle's own frame, collective thrust as a share of the most, turn."""

    time_us: int
    attitude_wxyz: Quaternion
    thrust_fraction: float
    yaw_rate_rad_s: float


Setpoint: TypeAlias = PositionSetpoint | AttitudeSetpoint


@dataclass(frozen=True, slots=True)
class OnboardHeartbeat(Outgoing):
    """Our own HEARTBEAT as an onboard computer; `active` while a flight is under way."""

    active: bool


@dataclass(frozen=True, slots=True)
class ReadParameter(Outgoing):
    """PARAM_REQUEST_READ."""

    name: str


@dataclass(frozen=True, slots=True)
class NamedValue(Outgoing):
    """NAMED_VALUE_FLOAT, or DEBUG_VECT with a vector's three numbers; the name has at most ten characters."""

    time_us: int
    name: str
    value: float | Vector3


@dataclass(frozen=True, slots=True)
class ComputerStatus(Outgoing):
    """ONBOARD_COMPUTER_STATUS; `at_us` since the epoch, a MiB is 2^20 bytes, a temperature nobody measures None."""

    at_us: int
    uptime_ms: int
    cpu_percent: tuple[int, ...]  # of each core
    temperature_deg_c: int | None
    memory_used_mib: int
    memory_total_mib: int
    disk_used_mib: int
    disk_total_mib: int


# All three axes of a sensor at the end of its range at once, and a tenth more for its calibration.
_OF_RANGE = 1.1 * math.sqrt(3.0)
# 40 g is the widest range among PX4's accelerometer drivers (ADIS16470, ADIS16507).
SPECIFIC_FORCE_M_S2 = _OF_RANGE * 40.0 * 9.80665
# The widest zero-g offset among PX4's accelerometers (MPU-6000, z: 80 mg). A sensor that is off reads no more; thrust
# is more in all but free fall, which shows no contact.
ZERO_G_OFFSET_M_S2 = 0.08 * 9.80665
# 4000 deg/s is the widest range among PX4's gyroscope drivers (ICM-45686).
ANGULAR_VELOCITY_RAD_S = _OF_RANGE * math.radians(4000.0)
# EKF2 holds its own states within these: velocity_limit, and Ekf::constrainStates.
VELOCITY_M_S = 100.0
POSITION_M = 1.0e6
# Thrust is the length of a vector with three parts of at most 1 (PX4's streams/ATTITUDE_TARGET.hpp).
THRUST_FRACTION = math.sqrt(3.0)
# Microseconds are exact in double precision up to here: 285 years.
TIME_US = 1 << 53
# PX4 sends rotations in single precision, good to 1e-6; one that is further from length 1 than this is no rotation.
QUATERNION_ERROR = 1.0e-3


def is_rotation(w: float, x: float, y: float, z: float) -> bool:
    """Whether a quaternion has length 1."""
    return abs(w * w + x * x + y * y + z * z - 1.0) <= QUATERNION_ERROR
