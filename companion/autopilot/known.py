"""The autopilots that can be flown."""

from companion.autopilot.ardupilot.firmware import ARDUPILOT
from companion.autopilot.px4 import defaults as defaults
from companion.autopilot.px4.firmware import PX4

AUTOPILOTS = {autopilot.mav_autopilot: autopilot for autopilot in (PX4, ARDUPILOT)}
# Of a vehicle that has not announced itself yet. `defaults` are its, too: only this file knows which one that is.
ASSUMED = PX4
NAMES = " or ".join(autopilot.name for autopilot in AUTOPILOTS.values())
_MODES = [mode for autopilot in AUTOPILOTS.values() for mode in autopilot.modes.values()]
MODE_NAMES = frozenset(mode.name for mode in _MODES)
GUARDED_MODES = tuple(mode.name for mode in _MODES if mode.is_guarded)
