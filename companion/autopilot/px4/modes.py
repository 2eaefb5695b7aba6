"""PX4's flight modes as HEARTBEAT.custom_mode packs them: main << 16 | sub << 24 (PX4's px4_custom_mode.h)."""

from companion.autopilot.interface import Mode, Pilot

OFFBOARD = 6 << 16
POSCTL = 3 << 16
AUTO_LOITER = 4 << 16 | 3 << 24
AUTO_LAND = 4 << 16 | 6 << 24
AUTO_PRECLAND = 4 << 16 | 9 << 24
# Of a mode with a sub mode that is not listed the main mode counts.
MAIN = 0xFF << 16

# Guarded are modes in which PX4 itself holds a position or a height. Not AUTO.LAND: its end is a hit on the ground. Not
# the modes that a pilot flies by attitude, which have position control off (commander/ModeUtil/control_mode.cpp): there
# the stick is the only brake, and it is not to be taken away unasked.
MODES = {
    POSCTL: Mode("POSCTL", Pilot.STICKS, is_guarded=True),
    3 << 16 | 1 << 24: Mode("ORBIT", Pilot.AUTOPILOT, is_guarded=True),
    2 << 16: Mode("ALTCTL", Pilot.STICKS, is_guarded=True),
    OFFBOARD: Mode("OFFBOARD", Pilot.SETPOINTS, is_guarded=True),
    4 << 16 | 2 << 24: Mode("AUTO.TAKEOFF", Pilot.AUTOPILOT, is_guarded=True),
    AUTO_LOITER: Mode("AUTO.LOITER", Pilot.AUTOPILOT, is_guarded=True),
    4 << 16 | 4 << 24: Mode("AUTO.MISSION", Pilot.AUTOPILOT, is_guarded=True),
    4 << 16 | 5 << 24: Mode("AUTO.RTL", Pilot.AUTOPILOT, is_guarded=True),
    4 << 16 | 8 << 24: Mode("AUTO.FOLLOW", Pilot.AUTOPILOT, is_guarded=True),
    4 << 16: Mode("AUTO", Pilot.AUTOPILOT),
    4 << 16 | 1 << 24: Mode("AUTO.READY", Pilot.AUTOPILOT),
    AUTO_LAND: Mode("AUTO.LAND", Pilot.AUTOPILOT),
    AUTO_PRECLAND: Mode("AUTO.PRECLAND", Pilot.AUTOPILOT),
    1 << 16: Mode("MANUAL", Pilot.HAND),
    5 << 16: Mode("ACRO", Pilot.HAND),
    7 << 16: Mode("STABILIZED", Pilot.HAND),
    8 << 16: Mode("RATTITUDE", Pilot.HAND),
}
