"""PX4's flight modes on the wire: their numbers, both ways.

Sources: commander/px4_custom_mode.h, commander/Commander.cpp and mavlink/streams/HEARTBEAT.hpp of PX4.
"""

from dataclasses import dataclass

from sim_vehicle.autopilot.modes import Mode


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
    Mode.ALTCTL: ModeNumbers(custom_mode(2), _STICKS, 4, "Altitude"),
    Mode.POSCTL: ModeNumbers(custom_mode(3), _STICKS, 1, "Position"),
    Mode.ORBIT: ModeNumbers(custom_mode(3, 1), _AUTO, 2, "Orbit"),
    Mode.TAKEOFF: ModeNumbers(custom_mode(4, 2), _AUTO, 8, "Takeoff"),
    Mode.LOITER: ModeNumbers(custom_mode(4, 3), _AUTO, 0, "Hold"),
    Mode.MISSION: ModeNumbers(custom_mode(4, 4), _AUTO, 6, "Mission"),
    Mode.RETURN: ModeNumbers(custom_mode(4, 5), _AUTO, 5, "Return"),
    Mode.LAND: ModeNumbers(custom_mode(4, 6), _AUTO, 7, "Land"),
    Mode.FOLLOW_TARGET: ModeNumbers(custom_mode(4, 8), _AUTO, 0, "Follow Target"),
    Mode.OFFBOARD: ModeNumbers(custom_mode(6), CUSTOM_FLAG | STABILIZE_FLAG, 0, "Offboard"),
    Mode.STABILIZED: ModeNumbers(custom_mode(7), _STICKS, 0, "Stabilized"),
    Mode.TERMINATION: ModeNumbers(custom_mode(10), CUSTOM_FLAG, 0, "Termination"),
    # Sinking without a position shows itself as landing.
    Mode.DESCEND: ModeNumbers(custom_mode(4, 6), _AUTO, 0, "Descend"),
}

_NOT_BY_NUMBER = (Mode.DESCEND, Mode.TERMINATION, Mode.ORBIT)
_MODE_OF_CUSTOM = {numbers.custom_mode: mode for mode, numbers in NUMBERS.items() if mode not in _NOT_BY_NUMBER}
_POSITION_MAIN_MODE = 3


def base_mode(mode: Mode, armed: bool) -> int:
    """HEARTBEAT.base_mode of a shown mode."""
    return NUMBERS[mode].base_mode | (ARMED_FLAG if armed else 0)


def mode_from_request(base: int, main: int, sub: int) -> Mode | None:
    """The mode that DO_SET_MODE's three parameters name; None for one this vehicle does not know.

    As Commander.cpp: AUTO without a sub mode is MISSION, and POSCTL takes every sub mode for itself. Modes by the base
    mode's own bits, which nobody has asked a PX4 for since there are custom modes, are unknown here.
    """
    if not base & CUSTOM_FLAG:
        return None
    if main == _POSITION_MAIN_MODE:
        return Mode.POSCTL
    if main == AUTO_MAIN_MODE:
        return _MODE_OF_CUSTOM.get(custom_mode(main, sub)) if sub > 0 else Mode.MISSION
    return _MODE_OF_CUSTOM.get(custom_mode(main))
