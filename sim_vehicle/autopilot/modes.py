"""PX4's flight modes: their numbers on the wire and the one table of how they follow each other.

Sources: commander/px4_custom_mode.h, ModeUtil/mode_requirements.cpp, UserModeIntention.cpp,
failsafe/failsafe.cpp and mavlink/streams/HEARTBEAT.hpp of PX4.
"""

from collections.abc import Iterable
from dataclasses import dataclass
from enum import IntEnum, StrEnum


class Mode(IntEnum):
    """The modes by PX4's NAVIGATION_STATE numbers, and the one failsafe of this vehicle."""

    MANUAL = 0
    ALTCTL = 1
    POSCTL = 2
    MISSION = 3
    LOITER = 4
    RETURN = 5
    ACRO = 10
    OFFBOARD = 14
    STABILIZED = 15
    TAKEOFF = 17
    LAND = 18
    OFFBOARD_LOST = 100
    """Offboard is meant, but its setpoints have stopped: shown as POSCTL while the vehicle sinks."""


class Event(StrEnum):
    """What can change the mode."""

    REQUEST = "requested"
    TAKEOFF_REACHED = "takeoff height reached"
    SETPOINTS_LOST = "setpoints stopped"
    SETPOINTS_BACK = "setpoints came back"
    DISARMED = "disarmed"


class Guard(StrEnum):
    """Condition of a transition."""

    ALWAYS = ""
    DISARMED = "disarmed"
    ARMED = "armed"
    SETPOINTS = "disarmed, or setpoints arrive"


@dataclass(frozen=True, slots=True)
class Transition:
    """One row: from any of ``sources`` (None: from every mode) on ``event`` to ``target``.

    A target of None is the last mode that was meant and in which the vehicle could be armed.
    """

    sources: tuple[Mode, ...] | None
    event: Event
    guard: Guard
    target: Mode | None


def _request(target: Mode, guard: Guard) -> Transition:
    return Transition(None, Event.REQUEST, guard, target)


# Disarmed, PX4 lets every mode be chosen. Armed it wants what the mode needs: sticks for MANUAL,
# ALTCTL, STABILIZED and ACRO and an uploaded mission for MISSION, which this vehicle never has;
# setpoints for OFFBOARD. LAND may always be chosen, whatever it needs. POSCTL stands for a pilot
# taking over with his sticks centred: it is accepted and holds the position.
TRANSITIONS: tuple[Transition, ...] = (
    _request(Mode.MANUAL, Guard.DISARMED),
    _request(Mode.ALTCTL, Guard.DISARMED),
    _request(Mode.STABILIZED, Guard.DISARMED),
    _request(Mode.ACRO, Guard.DISARMED),
    _request(Mode.MISSION, Guard.DISARMED),
    _request(Mode.POSCTL, Guard.ALWAYS),
    _request(Mode.LOITER, Guard.ALWAYS),
    _request(Mode.RETURN, Guard.ALWAYS),
    _request(Mode.TAKEOFF, Guard.ALWAYS),
    _request(Mode.LAND, Guard.ALWAYS),
    _request(Mode.OFFBOARD, Guard.SETPOINTS),
    Transition((Mode.TAKEOFF,), Event.TAKEOFF_REACHED, Guard.ARMED, Mode.LOITER),
    Transition((Mode.OFFBOARD,), Event.SETPOINTS_LOST, Guard.ARMED, Mode.OFFBOARD_LOST),
    Transition((Mode.OFFBOARD_LOST,), Event.SETPOINTS_BACK, Guard.ALWAYS, Mode.OFFBOARD),
    Transition((Mode.OFFBOARD_LOST,), Event.DISARMED, Guard.ALWAYS, Mode.OFFBOARD),
    Transition((Mode.TAKEOFF, Mode.RETURN, Mode.LAND), Event.DISARMED, Guard.ALWAYS, None),
)

# A vehicle in these modes cannot be armed, or would take off again at once: after disarming, PX4
# goes back to the mode before them (UserModeIntention::change).
NOT_KEPT_AFTER_DISARMING = frozenset({Mode.TAKEOFF, Mode.RETURN, Mode.LAND})

# prevent_arming, sticks or a mission required (mode_requirements.cpp). OFFBOARD needs its setpoints.
ARMABLE = frozenset({Mode.LOITER, Mode.TAKEOFF})


@dataclass(frozen=True, slots=True)
class Conditions:
    """What the guards ask about."""

    armed: bool
    setpoints_arrive: bool

    def hold(self, guard: Guard) -> bool:
        """Whether a transition with this guard may happen."""
        if guard is Guard.ALWAYS:
            return True
        if guard is Guard.DISARMED:
            return not self.armed
        if guard is Guard.ARMED:
            return self.armed
        return not self.armed or self.setpoints_arrive


def find_transition(
    mode: Mode, event: Event, conditions: Conditions, requested: Mode | None = None
) -> Transition | None:
    """The row of the table that applies; None where the event is refused or means nothing."""
    for row in TRANSITIONS:
        if row.event is not event or (event is Event.REQUEST and row.target is not requested):
            continue
        if (row.sources is None or mode in row.sources) and conditions.hold(row.guard):
            return row
    return None


@dataclass(frozen=True, slots=True)
class ModeNumbers:
    """How a mode looks on the wire."""

    custom_mode: int
    base_mode: int
    """MAV_MODE_FLAG bits without the armed bit."""
    standard_mode: int
    """MAV_STANDARD_MODE of CURRENT_MODE."""
    title: str
    """PX4's name in texts."""


CUSTOM_FLAG, AUTO_FLAG, GUIDED_FLAG, STABILIZE_FLAG, MANUAL_FLAG, ARMED_FLAG = 1, 4, 8, 16, 64, 128
AUTO_MAIN_MODE = 4
_AUTO = CUSTOM_FLAG | AUTO_FLAG | GUIDED_FLAG | STABILIZE_FLAG
_STICKS = CUSTOM_FLAG | MANUAL_FLAG | STABILIZE_FLAG


def custom_mode(main: int, sub: int = 0) -> int:
    """HEARTBEAT.custom_mode: main mode in bits 16-23, sub mode in bits 24-31."""
    return main << 16 | sub << 24


NUMBERS: dict[Mode, ModeNumbers] = {
    Mode.MANUAL: ModeNumbers(custom_mode(1), _STICKS, 0, "Manual"),
    Mode.ALTCTL: ModeNumbers(custom_mode(2), _STICKS, 4, "Altitude"),
    Mode.POSCTL: ModeNumbers(custom_mode(3), _STICKS, 1, "Position"),
    Mode.TAKEOFF: ModeNumbers(custom_mode(4, 2), _AUTO, 8, "Takeoff"),
    Mode.LOITER: ModeNumbers(custom_mode(4, 3), _AUTO, 0, "Hold"),
    Mode.MISSION: ModeNumbers(custom_mode(4, 4), _AUTO, 6, "Mission"),
    Mode.RETURN: ModeNumbers(custom_mode(4, 5), _AUTO, 5, "Return"),
    Mode.LAND: ModeNumbers(custom_mode(4, 6), _AUTO, 7, "Land"),
    Mode.ACRO: ModeNumbers(custom_mode(5), CUSTOM_FLAG | MANUAL_FLAG, 0, "Acro"),
    # Stabilised too as soon as a setpoint has said what is controlled: see `base_mode`.
    Mode.OFFBOARD: ModeNumbers(custom_mode(6), CUSTOM_FLAG, 0, "Offboard"),
    Mode.STABILIZED: ModeNumbers(custom_mode(7), _STICKS, 0, "Stabilized"),
}

_MODE_OF_CUSTOM = {numbers.custom_mode: mode for mode, numbers in NUMBERS.items()}


def base_mode(mode: Mode, armed: bool, had_setpoint: bool) -> int:
    """HEARTBEAT.base_mode of a shown mode; ``had_setpoint``: any valid offboard setpoint since boot."""
    flags = NUMBERS[mode].base_mode
    if mode is Mode.OFFBOARD and had_setpoint:
        flags |= STABILIZE_FLAG
    return flags | ARMED_FLAG if armed else flags


def mode_from_request(base: int, main: int, sub: int) -> Mode | None:
    """The mode that DO_SET_MODE's three parameters name; None for one this vehicle does not know.

    As Commander.cpp: AUTO without a sub mode is MISSION, any sub mode of POSCTL is POSCTL, and
    without the custom flag the base mode's own bits decide.
    """
    if base & CUSTOM_FLAG:
        if main == AUTO_MAIN_MODE:
            return _MODE_OF_CUSTOM.get(custom_mode(main, sub)) if sub > 0 else Mode.MISSION
        return _MODE_OF_CUSTOM.get(custom_mode(main))
    if base & AUTO_FLAG:
        return Mode.MISSION
    if not base & MANUAL_FLAG:
        return None
    if base & GUIDED_FLAG:
        return Mode.POSCTL
    return Mode.STABILIZED if base & STABILIZE_FLAG else Mode.MANUAL


class ModeState:
    """The mode that is meant and the mode that flies, moved only along the table."""

    def __init__(self) -> None:
        # PX4 boots a multicopter without sticks into Hold.
        self.mode = Mode.LOITER
        self._after_disarming = Mode.LOITER

    @property
    def shown(self) -> Mode:
        """As HEARTBEAT has it."""
        return Mode.POSCTL if self.mode is Mode.OFFBOARD_LOST else self.mode

    @property
    def intended(self) -> Mode:
        """As CURRENT_MODE.intended_custom_mode has it."""
        return Mode.OFFBOARD if self.mode is Mode.OFFBOARD_LOST else self.mode

    @property
    def in_failsafe(self) -> bool:
        """Whether the vehicle flies something else than what is meant."""
        return self.mode is Mode.OFFBOARD_LOST

    def apply(self, event: Event, conditions: Conditions, requested: Mode | None = None) -> bool:
        """Take the event; False where the table has no row for it."""
        row = find_transition(self.mode, event, conditions, requested)
        if row is None:
            return False
        self.mode = self._after_disarming if row.target is None else row.target
        if self.intended not in NOT_KEPT_AFTER_DISARMING:
            self._after_disarming = self.intended
        return True


def mode_diagram(rows: Iterable[Transition] = TRANSITIONS) -> str:
    """The table as a mermaid state diagram."""
    lines = ["stateDiagram-v2", f"    [*] --> {ModeState().mode.name}"]
    for row in rows:
        sources = [mode.name for mode in row.sources] if row.sources else ["ANY_MODE"]
        target = row.target.name if row.target is not None else "MODE_BEFORE"
        guard = f" [{row.guard}]" if row.guard else ""
        lines += [f"    {source} --> {target}: {row.event}{guard}" for source in sources]
    return "\n".join(lines) + "\n"
