"""Whether a log is of a healthy flight: settings learnt from a crash would be deaf to the next one."""

import json
import math
from contextlib import suppress
from pathlib import Path

from companion.messages import Attitude, Heartbeat, ImuSample
from rebound_cli.logs.log import Log
from rebound_cli.run_folder import SUMMARY_NAME

# PX4's failure detector takes a larger tilt for a lost attitude: FD_FAIL_R and FD_FAIL_P, 60 deg by default.
_TILT_DEG = 60.0
# PX4's land detector takes less force, for so long, for a fall: LNDMC_FFALL_THR and LNDMC_FFALL_TTRI.
_FALL_M_S2 = 2.0
_FALL_US = 300_000


def told_hits(folder: Path) -> int:
    """Collisions that the summary of our own flight tells; 0 where there is none to read."""
    with suppress(OSError, ValueError, KeyError, TypeError):
        return len(json.loads((folder / SUMMARY_NAME).read_text(encoding="utf-8"))["collisions"])
    return 0


def crash(log: Log) -> str | None:
    """What speaks against a healthy flight: armed, it tipped over or fell. None where nothing does."""
    armed = False
    falls_from_us: int | None = None
    for heard in log.heard:
        sample = heard.sample
        if isinstance(sample, Heartbeat):
            armed = sample.armed
        elif not armed:
            falls_from_us = None
        elif isinstance(sample, Attitude):
            tilt_deg = _tilt_deg(sample)
            if tilt_deg > _TILT_DEG:
                return f"it tipped to {tilt_deg:.0f} degrees at {log.seconds(heard.at_us):.1f} s"
        elif isinstance(sample, ImuSample):
            if math.hypot(*sample.specific_force_frd_m_s2) > _FALL_M_S2:
                falls_from_us = None
                continue
            falls_from_us = heard.at_us if falls_from_us is None else falls_from_us
            if heard.at_us - falls_from_us >= _FALL_US:
                return f"it fell at {log.seconds(falls_from_us):.1f} s"
    return None


def _tilt_deg(attitude: Attitude) -> float:
    _, x, y, _ = attitude.attitude_wxyz
    return math.degrees(math.acos(max(-1.0, 1.0 - 2.0 * (x * x + y * y))))
