"""PX4 behind the interface of autopilots."""

from companion.autopilot.interface import Autopilot
from companion.autopilot.px4 import modes

PX4 = Autopilot(
    name="PX4",
    mav_autopilot=12,
    setpoints=modes.OFFBOARD,
    hold=modes.AUTO_LOITER,
    land=modes.AUTO_LAND,
    sticks=modes.POSCTL,
    descents=frozenset({modes.AUTO_LAND, modes.AUTO_PRECLAND}),
    mode_names=modes.MODE_NAMES,
    guarded_modes=modes.GUARDED,
    mode_name=modes.mode_name,
    pilot=modes.pilot,
    set_mode=modes.set_mode,
)
