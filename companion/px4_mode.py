"""PX4's flight modes as HEARTBEAT.custom_mode packs them: main << 16 | sub << 24 (PX4's px4_custom_mode.h)."""

OFFBOARD = 6 << 16
POSCTL = 3 << 16
AUTO_LOITER = 4 << 16 | 3 << 24
AUTO_LAND = 4 << 16 | 6 << 24
AUTO_PRECLAND = 4 << 16 | 9 << 24
# MANUAL, ACRO, STABILIZED, RATTITUDE: the sticks ask for an attitude or for rates and for the thrust, and position
# control is off (commander/ModeUtil/control_mode.cpp).
_BY_HAND_ALONE = (1, 5, 7, 8)
# ALTCTL, POSCTL: the sticks ask for velocities.
_BY_VELOCITY = (2, 3)

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


def is_auto(custom_mode: int) -> bool:
    """Whether PX4 flies it by itself."""
    return custom_mode >> 16 & 0xFF == AUTO_LOITER >> 16 & 0xFF


def by_hand_alone(custom_mode: int) -> bool:
    """Whether the pilot's hand has the thrust."""
    return custom_mode >> 16 & 0xFF in _BY_HAND_ALONE


def by_sticks(custom_mode: int) -> bool:
    """Whether the pilot's sticks fly it by velocities."""
    return custom_mode >> 16 & 0xFF in _BY_VELOCITY


def is_by_hand(custom_mode: int) -> bool:
    """Whether the pilot's sticks fly it, by thrust or by velocities."""
    return by_hand_alone(custom_mode) or by_sticks(custom_mode)


def mode_name(custom_mode: int) -> str:
    """The mode as PX4's own tools print it, for example OFFBOARD or AUTO.LAND."""
    main, sub = custom_mode >> 16 & 0xFF, custom_mode >> 24 & 0xFF
    name = _MAIN_NAMES.get(main, f"mode {main}")
    if name == "AUTO":
        return f"AUTO.{_AUTO_NAMES.get(sub, str(sub))}"
    return name


MODE_NAMES = frozenset(
    {name for name in _MAIN_NAMES.values() if name != "AUTO"} | {f"AUTO.{name}" for name in _AUTO_NAMES.values()}
)
