"""What the companion needs to know of an autopilot. A mode is HEARTBEAT's custom_mode, a number of the autopilot's."""

from collections.abc import Callable
from dataclasses import dataclass
from enum import Enum

from companion.messages import SetMode


class Pilot(Enum):
    """Who moves the vehicle in a mode."""

    AUTOPILOT = "by itself"
    SETPOINTS = "a program's setpoints"
    STICKS = "sticks that ask for velocities"
    HAND = "sticks that ask for an attitude or for rates, and for the thrust"


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
