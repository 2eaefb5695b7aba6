"""What the companion needs to know of an autopilot. A mode is HEARTBEAT's custom_mode, a number of the autopilot's."""

from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass
from enum import Enum

from companion.autopilot.setup import PreflightItem, SerialLine, Setup
from companion.messages import SetMode


class Pilot(Enum):
    """Who moves the vehicle in a mode."""

    AUTOPILOT = "by itself"
    SETPOINTS = "a program's setpoints"
    STICKS = "sticks that ask for velocities"
    HAND = "sticks that ask for an attitude or for rates, and for the thrust"


@dataclass(frozen=True, slots=True)
class Remedies:
    """Of what preflight finds by listening, for people."""

    slow_streams: str
    full_link: str
    no_time: str
    no_battery: str
    no_estimator: str


@dataclass(frozen=True, slots=True)
class Defaults:
    """How it flies unless a person has changed it: limits and patience of the companion follow from these."""

    loss_us: int
    """For so long the last setpoint is flown on."""
    position_gain_per_s: float
    """From a distance to the setpoint to the speed towards it."""
    max_speed_m_s: float
    max_yaw_rate_deg_s: float
    turning_deg_s: float
    """With which its own modes turn."""
    landing_m_s: float
    stick_deadzone: float
    """Deflection around the middle that asks for no climb."""
    stick_override: float
    """Change of a deflection by which a pilot takes over."""


@dataclass(frozen=True, slots=True)
class Autopilot:
    """Tables and functions of one autopilot; nothing else of the companion names its modes and parameters."""

    name: str
    mav_autopilot: int
    """MAV_AUTOPILOT, by which HEARTBEAT announces it."""
    setpoints: int
    """The mode that flies setpoints."""
    hold: int
    land: int
    sticks: int
    """The mode that a pilot who moved the sticks is given."""
    descents: frozenset[int]
    """Modes that end on the ground."""
    mode_names: frozenset[str]
    guarded_modes: tuple[str, ...]
    """Names of the modes that a guard may take over by default."""
    mode_name: Callable[[int], str]
    """As the autopilot's own tools print it."""
    pilot: Callable[[int], Pilot | None]
    """None of a mode that is not known."""
    set_mode: Callable[[int], SetMode]
    loss_parameter: str
    """For so many seconds the last setpoint is flown on."""
    rate_parameter: str
    """Of a link's share for streams, for people."""
    integration_parameter: str
    """With so many Hz samples of the IMU are integrated."""
    asked: Callable[[SerialLine | None], tuple[str, ...]]
    """Parameters that preflight reads."""
    judge_vehicle: Callable[[Setup], Iterable[PreflightItem]]
    judge_parameters: Callable[[Setup], Iterable[PreflightItem]]
    remedies: Remedies
    loss_text: Callable[[Mapping[str, int | float]], str]
    """What the vehicle does when setpoints stop, for people."""
    defaults: Defaults
