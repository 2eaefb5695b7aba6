"""What the autopilot hears and says, as values; bytes exist only in `sim_vehicle.mavlink`.

At the end what steers the flight beside commands: setpoints, sticks and targets to follow.
"""

from dataclasses import dataclass
from enum import IntEnum
from typing import NamedTuple, TypeAlias

from sim_vehicle.geography import Place
from sim_vehicle.quantities import Axis3, Quaternion, Vector3

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


@dataclass(frozen=True, slots=True)
class PositionTarget:
    """SET_POSITION_TARGET_LOCAL_NED with the ignored and the NaN fields as None.

    In frame 8 all vectors are forward, right, down; in all others they are local NED.
    """

    frame: int
    position_m: Axis3
    velocity_m_s: Axis3
    acceleration_m_s2: Axis3
    yaw_rad: float | None
    yaw_rate_rad_s: float | None
    is_force: bool
    """The mask's bit 9: the acceleration is meant as a force, which PX4 does not support."""


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


class Texts(list[StatusText]):
    """What is to be told to the ground stations, by whichever part of the autopilot, in the order in which it came."""

    def say(self, severity: Severity, text: str) -> None:
        """One more."""
        self.append(StatusText(severity, text))


@dataclass(frozen=True, slots=True)
class AttitudeTarget:
    """SET_ATTITUDE_TARGET with the ignored fields as None."""

    attitude_wxyz: Quaternion | None
    rates_frd_rad_s: Axis3
    thrust: float | None
    """Along -z of the body, a fraction of the greatest; None where the mask leaves it out."""


class StickInput(NamedTuple):
    """Sticks from -1 to 1: right, forward, up and right are positive."""

    roll: float
    pitch: float
    throttle: float
    yaw: float
    source: object
    """The link over which they came."""


@dataclass(frozen=True, slots=True)
class FollowTarget:
    """FOLLOW_TARGET: where a target is and how it moves."""

    place: Place
    velocity_ned_m_s: Vector3


FlightInput: TypeAlias = PositionTarget | AttitudeTarget | StickInput | FollowTarget
