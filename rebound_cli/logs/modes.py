"""vehicle_status.nav_state as HEARTBEAT.custom_mode packs it (PX4's px4_custom_mode.h, get_px4_custom_mode)."""

from companion.px4_mode import AUTO_LAND, AUTO_LOITER, OFFBOARD

_AUTO = 4
_MODES = {
    0: 1 << 16,  # MANUAL
    1: 2 << 16,  # ALTCTL
    2: 3 << 16,  # POSCTL
    3: _AUTO << 16 | 4 << 24,  # MISSION
    4: AUTO_LOITER,
    5: _AUTO << 16 | 5 << 24,  # RTL
    10: 5 << 16,  # ACRO
    12: AUTO_LAND,  # DESCEND shows as LAND
    13: 1 << 16,  # TERMINATION shows as MANUAL
    14: OFFBOARD,
    15: 7 << 16,  # STABILIZED
    17: _AUTO << 16 | 2 << 24,  # TAKEOFF
    18: AUTO_LAND,
    19: _AUTO << 16 | 8 << 24,  # FOLLOW
    20: _AUTO << 16 | 9 << 24,  # PRECLAND
    21: 3 << 16 | 1 << 24,  # ORBIT shows under POSCTL
}

# MANUAL, ACRO, STABILIZED, RATTITUDE: the sticks ask for an attitude or for rates, and position control is off
# (commander/ModeUtil/control_mode.cpp).
_BY_STICKS_ALONE = (1, 5, 7, 8)


def flies_setpoints(custom_mode: int) -> bool:
    """Whether PX4's position control acts in this mode; it is taken to where the mode is unknown."""
    return custom_mode >> 16 & 0xFF not in _BY_STICKS_ALONE


def custom_mode(nav_state: int) -> int:
    """0 for a state that has no name here."""
    return _MODES.get(nav_state, 0)
