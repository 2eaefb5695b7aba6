"""What the autopilot hears and says, as values; bytes exist only in `sim_vehicle.mavlink`."""

from dataclasses import dataclass
from enum import IntEnum
from typing import NamedTuple

from sim_vehicle.setpoint import Axis3

EVERY_ID = 0
"""A target of 0 addresses every system, or every component."""


class Identity(NamedTuple):
    """Who the vehicle is on the wire: MAV_SYS_ID and MAV_COMP_ID."""

    system: int = 1
    component: int = 1

    def is_addressed(self, target_system: int, target_component: int) -> bool:
        """Whether something sent to these ids is meant for this vehicle, too."""
        return target_system in (self.system, EVERY_ID) and target_component in (self.component, EVERY_ID)


class Result(IntEnum):
    """MAV_RESULT, as far as it is used here."""

    ACCEPTED = 0
    TEMPORARILY_REJECTED = 1
    DENIED = 2
    UNSUPPORTED = 3
    FAILED = 4


class Severity(IntEnum):
    """MAV_SEVERITY of the texts that are sent."""

    CRITICAL = 2
    WARNING = 4
    INFO = 6


@dataclass(frozen=True, slots=True)
class PeerHeartbeat:
    """HEARTBEAT of another component; `type` is a MAV_TYPE."""

    system_id: int
    component_id: int
    type: int


@dataclass(frozen=True, slots=True)
class Command:
    """COMMAND_LONG or COMMAND_INT; parameters as sent, so possibly NaN."""

    source_system: int
    source_component: int
    target_system: int
    target_component: int
    command: int
    param1: float = 0.0
    param2: float = 0.0
    param3: float = 0.0
    param4: float = 0.0
    param5: float = 0.0
    """Latitude in degrees, where it is one; a COMMAND_LONG carries it with 24 bits only."""
    param6: float = 0.0
    param7: float = 0.0
    confirmation: int = 0
    frame: int | None = None
    """MAV_FRAME of a COMMAND_INT; None for a COMMAND_LONG."""


@dataclass(frozen=True, slots=True)
class PositionTarget:
    """SET_POSITION_TARGET_LOCAL_NED with the ignored and the NaN fields as None.

    In frame 1 all vectors are local NED; in frame 8 they are forward, right, down.
    """

    target_system: int
    target_component: int
    frame: int
    position_m: Axis3
    velocity_m_s: Axis3
    acceleration_m_s2: Axis3
    yaw_rad: float | None
    yaw_rate_rad_s: float | None
    is_force: bool
    """The mask's bit 9: the acceleration is meant as a force, which PX4 does not support."""


@dataclass(frozen=True, slots=True)
class TimeSyncRequest:
    """TIMESYNC with tc1 = 0: the peer asks for our clock; an answer to our own request never gets here."""

    peer_time_ns: int


@dataclass(frozen=True, slots=True)
class SigningSetup:
    """SETUP_SIGNING."""

    key: bytes
    time_stamp: int


@dataclass(frozen=True, slots=True)
class PingRequest:
    """PING to everybody: it is sent back."""

    time_us: int
    number: int
    source_system: int
    source_component: int


@dataclass(frozen=True, slots=True)
class SetMode:
    """SET_MODE, as the command that PX4 makes of it."""

    command: Command


@dataclass(frozen=True, slots=True)
class CommandAck:
    command: int
    result: Result
    target_system: int
    target_component: int


@dataclass(frozen=True, slots=True)
class StatusText:
    severity: Severity
    text: str
    """Without PX4's closing tab, which the encoder adds."""
