"""PX4's flight modes as HEARTBEAT.custom_mode packs them: main << 16 | sub << 24 (PX4's px4_custom_mode.h)."""

from companion.autopilot.interface import Pilot
from companion.messages import SetMode

OFFBOARD = 6 << 16
POSCTL = 3 << 16
AUTO_LOITER = 4 << 16 | 3 << 24
AUTO_LAND = 4 << 16 | 6 << 24
AUTO_PRECLAND = 4 << 16 | 9 << 24

# MANUAL, ACRO, STABILIZED, RATTITUDE have position control off (commander/ModeUtil/control_mode.cpp).
_PILOTS = {
    **dict.fromkeys((1, 5, 7, 8), Pilot.HAND),
    **dict.fromkeys((2, 3), Pilot.STICKS),
    4: Pilot.AUTOPILOT,
    6: Pilot.SETPOINTS,
}
_MAIN_NAMES = {1: "MANUAL", 2: "ALTCTL", 3: "POSCTL", 4: "AUTO", 5: "ACRO", 6: "OFFBOARD", 7: "STABILIZED"}
_AUTO_NAMES = {
    1: "READY",
    2: "TAKEOFF",
    3: "LOITER",
    4: "MISSION",
    5: "RTL",
    6: "LAND",
    8: "FOLLOW",
    9: "PRECLAND",
}
MODE_NAMES = frozenset(
    {name for name in _MAIN_NAMES.values() if name != "AUTO"} | {f"AUTO.{name}" for name in _AUTO_NAMES.values()}
)
# Modes in which PX4 itself holds a position or a height. Not AUTO.LAND: its end is a hit on the ground. Not the modes
# that a pilot flies by attitude: there the stick is the only brake, and it is not to be taken away unasked.
GUARDED = (
    *("POSCTL", "ALTCTL", "OFFBOARD"),
    *("AUTO.TAKEOFF", "AUTO.LOITER", "AUTO.MISSION", "AUTO.RTL", "AUTO.FOLLOW"),
)


def _parts(custom_mode: int) -> tuple[int, int]:
    return custom_mode >> 16 & 0xFF, custom_mode >> 24 & 0xFF


def pilot(custom_mode: int) -> Pilot | None:
    return _PILOTS.get(custom_mode >> 16 & 0xFF)


def mode_name(custom_mode: int) -> str:
    """For example OFFBOARD or AUTO.LAND."""
    main, sub = _parts(custom_mode)
    name = _MAIN_NAMES.get(main, f"mode {main}")
    return f"AUTO.{_AUTO_NAMES.get(sub, str(sub))}" if name == "AUTO" else name


def set_mode(custom_mode: int) -> SetMode:
    return SetMode(custom_mode, mode_name(custom_mode), _parts(custom_mode))
