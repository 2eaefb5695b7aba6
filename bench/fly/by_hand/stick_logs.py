"""Sticks as people moved them in real flights, out of their logs."""

from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from bench.fly.by_hand.watched import STICKS_S
from companion.errors import ReboundError
from companion.messages import Sticks as StickSample
from rebound_cli.logs.log import LogError
from rebound_cli.logs.reader import read_log

Floats = np.ndarray[Any, np.dtype[np.float64]]

SUFFIXES = (".ulg", ".bin", ".log", ".tlog")
# The throttle of a vehicle in the air is above this.
FLIES = -0.5
# At 5 Hz, as in PX4's own logs, a flick of the stick is not there any more.
LEAST_HZ = 8.0
# Sticks that nobody moves, and flights of a moment, fly nothing hard.
MOVED, LEAST_S = 0.05, 20.0


class StickLogError(ReboundError):
    """A folder of logs without sticks."""


@dataclass(frozen=True, slots=True)
class LoggedSticks:
    """Roll, pitch, throttle from its middle in the air, yaw: from -1 to 1, one row every STICKS_S."""

    log: str
    rows: Floats


def logs_in(folder: Path) -> list[Path]:
    """What looks like a log, by its name, in the order of the names."""
    return sorted(path for path in folder.rglob("*") if path.suffix.lower() in SUFFIXES)


def logs_with_sticks(folder: Path, most: int) -> list[LoggedSticks]:
    """In the order of their names. Raises StickLogError where there is none."""
    found = [logged for _, logged in zip(range(most), _found(folder), strict=False)]
    if not found:
        raise StickLogError(f"{folder}: no log in it has moving sticks; give a folder of ArduPilot's logs.")
    return found


def _found(folder: Path) -> Iterator[LoggedSticks]:
    for path in logs_in(folder):
        try:
            heard = read_log(path).heard
        except (LogError, OSError):
            continue  # damaged, or of something else
        sticks = [(1e-6 * at.at_us, *at.sample.deflections) for at in heard if isinstance(at.sample, StickSample)]
        rows = moved(np.array(sticks, dtype=np.float64).reshape(-1, 5))
        if len(rows) > 0:
            yield LoggedSticks(path.name, rows)


def moved(table: Floats) -> Floats:
    """The flight's part of seconds, pitch, roll, throttle and yaw, as LoggedSticks has it; no row where nobody flew."""
    nothing = np.empty((0, 4))
    flies = np.flatnonzero(table[:, 3] > FLIES)
    if len(flies) < 2:
        return nothing
    table = table[flies[0] : flies[-1] + 1]
    lasts_s = table[-1, 0] - table[0, 0]
    if lasts_s < LEAST_S or len(table) < LEAST_HZ * lasts_s:
        return nothing
    grid_s = np.arange(table[0, 0], table[-1, 0], STICKS_S)
    pitch, roll, throttle, yaw = (np.interp(grid_s, table[:, 0], column) for column in table[:, 1:].T)
    sticks = np.clip(np.stack([roll, pitch, throttle - np.median(throttle), yaw], axis=1), -1.0, 1.0)
    return sticks if float(sticks[:, :2].std()) > MOVED else nothing
