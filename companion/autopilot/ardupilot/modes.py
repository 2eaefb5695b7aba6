"""Copter's flight modes as HEARTBEAT.custom_mode numbers them (ArduCopter/mode.h)."""

from companion.autopilot.interface import Pilot
from companion.messages import SetMode

GUIDED, LOITER, RTL, LAND, BRAKE, SMART_RTL, AUTO_RTL = 4, 5, 6, 9, 17, 21, 27

_NAMES = {
    0: "STABILIZE",
    1: "ACRO",
    2: "ALT_HOLD",
    3: "AUTO",
    GUIDED: "GUIDED",
    LOITER: "LOITER",
    RTL: "RTL",
    7: "CIRCLE",
    LAND: "LAND",
    11: "DRIFT",
    13: "SPORT",
    14: "FLIP",
    15: "AUTOTUNE",
    16: "POSHOLD",
    BRAKE: "BRAKE",
    18: "THROW",
    19: "AVOID_ADSB",
    20: "GUIDED_NOGPS",
    SMART_RTL: "SMART_RTL",
    22: "FLOWHOLD",
    23: "FOLLOW",
    24: "ZIGZAG",
    25: "SYSTEMID",
    26: "AUTOROTATE",
    AUTO_RTL: "AUTO_RTL",
    28: "TURTLE",
}
MODE_NAMES = frozenset(_NAMES.values())
# Modes in which Copter itself holds a position or a height; of the others see those of PX4 (px4.modes).
GUARDED = (
    *("LOITER", "POSHOLD", "ALT_HOLD", "FLOWHOLD", "ZIGZAG", "GUIDED", "AUTO", "RTL", "SMART_RTL", "AUTO_RTL"),
    *("BRAKE", "CIRCLE", "FOLLOW"),
)
_HAND = frozenset({"STABILIZE", "ACRO", "DRIFT", "SPORT", "FLIP", "SYSTEMID", "AUTOROTATE", "TURTLE"})
_STICKS = frozenset({"ALT_HOLD", "LOITER", "POSHOLD", "FLOWHOLD", "ZIGZAG", "AUTOTUNE"})
_SETPOINTS = frozenset({"GUIDED", "GUIDED_NOGPS"})


def pilot(custom_mode: int) -> Pilot | None:
    name = _NAMES.get(custom_mode)
    if name is None:
        return None
    if name in _SETPOINTS:
        return Pilot.SETPOINTS
    if name in _HAND:
        return Pilot.HAND
    return Pilot.STICKS if name in _STICKS else Pilot.AUTOPILOT


def mode_name(custom_mode: int) -> str:
    """For example GUIDED."""
    return _NAMES.get(custom_mode, f"mode {custom_mode}")


def set_mode(custom_mode: int) -> SetMode:
    return SetMode(custom_mode, mode_name(custom_mode), (custom_mode, 0))
