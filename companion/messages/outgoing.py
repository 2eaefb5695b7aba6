"""Typed commands out; see `samples` for frames and units."""

from dataclasses import dataclass
from typing import ClassVar, TypeAlias

from companion.messages.samples import Severity, Vector3


@dataclass(frozen=True, slots=True)
class SetMode:
    """MAV_CMD_DO_SET_MODE; `custom_mode` in PX4's packing (main << 16 | sub << 24)."""

    command_id: ClassVar[int] = 176
    custom_mode: int


@dataclass(frozen=True, slots=True)
class SetArmed:
    """MAV_CMD_COMPONENT_ARM_DISARM, never forced."""

    command_id: ClassVar[int] = 400
    armed: bool


@dataclass(frozen=True, slots=True)
class SetMessageInterval:
    """MAV_CMD_SET_MESSAGE_INTERVAL."""

    command_id: ClassVar[int] = 511
    message_id: int
    interval_us: int


@dataclass(frozen=True, slots=True)
class RequestMessage:
    """MAV_CMD_REQUEST_MESSAGE."""

    command_id: ClassVar[int] = 512
    message_id: int


@dataclass(frozen=True, slots=True)
class Reposition:
    """MAV_CMD_DO_REPOSITION with a change to AUTO.LOITER: hold there. Altitude above mean sea level."""

    command_id: ClassVar[int] = 192
    latitude_deg: float
    longitude_deg: float
    altitude_m: float


VehicleCommand: TypeAlias = SetMode | SetArmed | SetMessageInterval | RequestMessage | Reposition


@dataclass(frozen=True, slots=True)
class SendCommand:
    """A command with its transmission count, as COMMAND_LONG.confirmation wants it."""

    command: VehicleCommand
    confirmation: int


@dataclass(frozen=True, slots=True)
class PositionSetpoint:
    """Setpoint in the vehicle's local NED; a None part is left to the vehicle.

    `leans_only`: north and east are asked for by the acceleration alone, whatever place and velocity are given;
    `is_height_free`: down by velocity and acceleration, whatever height is given.
    """

    time_us: int
    position_ned_m: Vector3
    yaw_rad: float | None
    velocity_ned_m_s: Vector3 | None = None
    acceleration_ned_m_s2: Vector3 | None = None
    leans_only: bool = False
    is_height_free: bool = False


@dataclass(frozen=True, slots=True)
class OnboardHeartbeat:
    """Our own HEARTBEAT as an onboard computer; `active` while a flight is under way."""

    active: bool


@dataclass(frozen=True, slots=True)
class TimeSyncReply:
    vehicle_time_ns: int
    companion_time_ns: int


@dataclass(frozen=True, slots=True)
class TimeSyncAsk:
    """TIMESYNC of our own; the vehicle echoes the time."""

    companion_time_ns: int


@dataclass(frozen=True, slots=True)
class ReadParameter:
    """PARAM_REQUEST_READ."""

    name: str


@dataclass(frozen=True, slots=True)
class SetParameter:
    """PARAM_SET; an int is sent as INT32, a float as REAL32, as PX4 has them."""

    name: str
    value: int | float


@dataclass(frozen=True, slots=True)
class StatusText:
    """STATUSTEXT, in as many packets as its length needs."""

    severity: Severity
    text: str


@dataclass(frozen=True, slots=True)
class NamedValue:
    """NAMED_VALUE_FLOAT: a number to plot; the name has at most ten characters."""

    time_us: int
    name: str
    value: float


@dataclass(frozen=True, slots=True)
class DebugVector:
    """DEBUG_VECT: three numbers to plot; the name has at most ten characters."""

    time_us: int
    name: str
    vector: Vector3


@dataclass(frozen=True, slots=True)
class ComputerStatus:
    """ONBOARD_COMPUTER_STATUS; `at_us` since the epoch, a MiB is 2^20 bytes, a temperature nobody measures None."""

    at_us: int
    uptime_ms: int
    cpu_percent: tuple[int, ...]  # of each core
    temperature_deg_c: int | None
    memory_used_mib: int
    memory_total_mib: int
    disk_used_mib: int
    disk_total_mib: int


Outgoing: TypeAlias = (
    SendCommand
    | PositionSetpoint
    | OnboardHeartbeat
    | TimeSyncReply
    | TimeSyncAsk
    | ReadParameter
    | SetParameter
    | StatusText
    | NamedValue
    | DebugVector
    | ComputerStatus
)
