"""Copter's flight modes as HEARTBEAT.custom_mode numbers them (ArduCopter/mode.h)."""

from companion.autopilot.interface import Mode, Pilot

GUIDED, LOITER, LAND, BRAKE = 4, 5, 9, 17

# Guarded are modes in which Copter itself holds a position or a height; of the others see those of PX4 (px4.modes).
MODES = {
    LOITER: Mode("LOITER", Pilot.STICKS, is_guarded=True),
    16: Mode("POSHOLD", Pilot.STICKS, is_guarded=True),
    2: Mode("ALT_HOLD", Pilot.STICKS, is_guarded=True),
    22: Mode("FLOWHOLD", Pilot.STICKS, is_guarded=True),
    24: Mode("ZIGZAG", Pilot.STICKS, is_guarded=True),
    GUIDED: Mode("GUIDED", Pilot.SETPOINTS, is_guarded=True),
    3: Mode("AUTO", Pilot.AUTOPILOT, is_guarded=True),
    6: Mode("RTL", Pilot.AUTOPILOT, is_guarded=True),
    21: Mode("SMART_RTL", Pilot.AUTOPILOT, is_guarded=True),
    27: Mode("AUTO_RTL", Pilot.AUTOPILOT, is_guarded=True),
    BRAKE: Mode("BRAKE", Pilot.AUTOPILOT, is_guarded=True),
    7: Mode("CIRCLE", Pilot.AUTOPILOT, is_guarded=True),
    23: Mode("FOLLOW", Pilot.AUTOPILOT, is_guarded=True),
    LAND: Mode("LAND", Pilot.AUTOPILOT),
    15: Mode("AUTOTUNE", Pilot.STICKS),
    18: Mode("THROW", Pilot.AUTOPILOT),
    19: Mode("AVOID_ADSB", Pilot.AUTOPILOT),
    20: Mode("GUIDED_NOGPS", Pilot.SETPOINTS),
    0: Mode("STABILIZE", Pilot.HAND),
    1: Mode("ACRO", Pilot.HAND),
    11: Mode("DRIFT", Pilot.HAND),
    13: Mode("SPORT", Pilot.HAND),
    14: Mode("FLIP", Pilot.HAND),
    25: Mode("SYSTEMID", Pilot.HAND),
    26: Mode("AUTOROTATE", Pilot.HAND),
    28: Mode("TURTLE", Pilot.HAND),
}
