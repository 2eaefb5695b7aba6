"""What the companion needs to know of an autopilot. A mode is HEARTBEAT's custom_mode, a number of the autopilot's."""

from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass
from enum import Enum

from companion.autopilot.setup import PreflightItem, Setup
from companion.messages import MessageId, VehicleCommand


class Pilot(Enum):
    """Who moves the vehicle in a mode."""

    AUTOPILOT = "by itself"
    SETPOINTS = "a program's setpoints"
    STICKS = "sticks that ask for velocities"
    HAND = "sticks that ask for an attitude or for rates, and for the thrust"


@dataclass(frozen=True, slots=True)
class Mode:
    """`name`: as the autopilot's own tools print it. `is_guarded`: a guard may take it over by default."""

    name: str
    pilot: Pilot | None
    is_guarded: bool = False


@dataclass(frozen=True, slots=True, kw_only=True)
class Autopilot:
    """Tables and functions of one autopilot; nothing else of the companion names its modes and parameters."""

    name: str
    mav_autopilot: int
    setpoints: int  # the mode that flies setpoints
    hold: int
    land: int
    sticks: int  # the mode that a pilot who moved the sticks is given
    descents: frozenset[int]  # modes that end on the ground
    modes: Mapping[int, Mode]
    mode_mask: int = -1  # of a mode that is not listed the one with these bits alone counts, where it is
    mode_parameters: Callable[[int], tuple[int, int]]  # the second and the third of the command that asks for it
    # A parameter that is a whole number travels as a float of its value, and not as the bytes of the number.
    casts_whole_numbers: bool = False
    attitude_mask: int  # ATTITUDE_TARGET_TYPEMASK of an attitude with a rate of yaw alone
    least_version: tuple[int, int, int] = (0, 0, 0)
    unsigned_throttle_since: tuple[int, int, int] = (0, 0, 0)  # earlier ones send the sticks' throttle from -1000 on
    streams: tuple[VehicleCommand, ...] = ()  # asked for beside those that all autopilots have
    filters_imu: bool = False  # its inertial samples are filtered: none shows that the raw ones were clipped
    lesser_imu: MessageId | None = None  # of boards that do not have HIGHRES_IMU
    estimator_message: MessageId
    sticks_message: MessageId
    is_told_to_take_off: bool = False  # its setpoints do not lift it off the ground: a command does
    wants_setpoints_first: bool  # it takes the mode that flies them only while they come
    # What it is told when it is flown by attitude from now on (True), by position (False), or no more (None).
    changed_law: Callable[[bool | None], VehicleCommand | None]
    # Its position control begins with the tilt that was asked for last, as what wind and a wrong tilt take.
    keeps_trim: bool = False
    attitude_parameters: tuple[str, ...]  # read before it is flown by attitude
    # From these: for so long an attitude is flown on; infinite where no attitude with a thrust can be asked for.
    attitude_held_s: Callable[[Mapping[str, int | float]], float]
    # After a hit its own velocity is too wrong for so long to fly by: until then a dead companion has said a tilt.
    misled_s: float
    # Off the obstacle: the place that is said then. None: it brakes by itself then, and is braked until then.
    last_place_m: float | None = None
    loss_parameter: str  # for so many seconds the last setpoint is flown on
    rate_parameter: str  # of a link's share for streams, for people
    sight: Callable[[Setup], PreflightItem]  # the smallest hit that shows
    parameters: tuple[str, ...]  # that preflight reads, as far as the vehicle has them
    judge_vehicle: tuple[Callable[[Setup], Iterable[PreflightItem]], ...]
    judge_parameters: Callable[[Setup], Iterable[PreflightItem]]
    # Of what preflight finds by listening, and of a vehicle that does not arm, for people.
    remedy_slow_stream: str
    remedy_full_link: str
    remedy_no_time: str
    remedy_no_battery: str
    remedy_no_estimator: str
    remedy_not_armed: str
    stick_deadzone: float  # deflection around the middle that asks for no climb, by default
    stick_override: float  # change of a deflection by which a pilot takes over, by default

    def mode(self, custom_mode: int) -> Mode:
        """One that is not known has a number for its name, and no pilot."""
        known = self.modes.get(custom_mode) or self.modes.get(custom_mode & self.mode_mask)
        return known or Mode(f"mode {self.mode_parameters(custom_mode)[0]}", None)

    def set_mode(self, custom_mode: int) -> VehicleCommand:
        """MAV_CMD_DO_SET_MODE, whose first parameter says that a custom mode follows."""
        parameters = (1, *self.mode_parameters(custom_mode))
        return VehicleCommand(176, parameters, f"mode {self.mode(custom_mode).name}", custom_mode)
