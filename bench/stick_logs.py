"""Sticks as people moved them, out of ArduPilot's logs (RCIN); pymavlink reads the files."""

import struct
from functools import lru_cache
from pathlib import Path
from typing import Any

import numpy as np
from pymavlink import DFReader

from bench.guarded import STICKS_S
from companion.errors import ReboundError

Floats = np.ndarray[Any, np.dtype[np.float64]]

READERS = {".bin": DFReader.DFReader_binary, ".log": DFReader.DFReader_text}
# Of a radio's pulses, in microseconds.
CENTRE_US, HALF_US = 1500.0, 500.0
# The throttle of a vehicle in the air is above this.
FLIES_US = 1250.0
# At 5 Hz, as in PX4's own logs, a flick of the stick is not there any more.
LEAST_HZ = 8.0
# Sticks that nobody moves, and flights of a moment, fly nothing hard.
MOVED, LEAST_S = 0.05, 20.0


class StickLogError(ReboundError):
    """A folder of logs without sticks."""


def logs_with_sticks(folder: Path) -> list[Path]:
    """In the order of their names. Raises StickLogError where there is none."""
    files = sorted(path for path in folder.rglob("*") if path.suffix.lower() in READERS)
    found = [path for path in files if len(sticks_of(path)) > 0]
    if not found:
        raise StickLogError(
            f"{folder}: no log in it has moving sticks; give a folder of ArduPilot's .bin or .log files."
        )
    return found


@lru_cache(maxsize=4)
def sticks_of(path: Path) -> Floats:
    """Roll, pitch, throttle from its middle in the air, yaw: from -1 to 1, one row every STICKS_S; no row for none."""
    nothing = np.empty((0, 4))
    try:
        log = READERS[path.suffix.lower()](str(path))
        rows = []
        while (message := log.recv_match(type=["RCIN"])) is not None:
            rows.append((message._timestamp, message.C1, message.C2, message.C3, message.C4))
    except (OSError, ValueError, IndexError, KeyError, AttributeError, TypeError, struct.error):
        return nothing  # damaged, or no log of that kind
    table = np.array(rows, dtype=np.float64).reshape(-1, 5)
    table = table[np.flatnonzero(np.diff(table[:, 0], prepend=-np.inf) > 0.0)]
    flies = np.flatnonzero(table[:, 3] > FLIES_US)
    if len(flies) < 2:
        return nothing
    table = table[flies[0] : flies[-1] + 1]
    lasts_s = table[-1, 0] - table[0, 0]
    if lasts_s < LEAST_S or len(table) < LEAST_HZ * lasts_s:
        return nothing
    grid_s = np.arange(table[0, 0], table[-1, 0], STICKS_S)
    table[:, 3] += CENTRE_US - np.median(table[:, 3])
    sticks = np.stack([np.interp(grid_s, table[:, 0], table[:, channel]) for channel in range(1, 5)], axis=1)
    sticks = np.clip((sticks - CENTRE_US) / HALF_US, -1.0, 1.0)
    return sticks if float(sticks[:, :2].std()) > MOVED else nothing
