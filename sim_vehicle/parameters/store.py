"""What each parameter is, and its value.

The table `px4.csv` has the facts of PX4's own parameter definitions. Defaults are the ones that a multicopter in PX4's
simulation has (rc.mc_defaults, init.d-posix/rcS); the few that describe the vehicle itself are laid over them by
`airframe_values.py`, as PX4's airframe files do.
"""

import csv
import math
from collections.abc import Mapping
from dataclasses import dataclass
from functools import cache
from pathlib import Path

TABLE = Path(__file__).parent / "px4.csv"
_AT_REAL_TIME = {"COM_DL_LOSS_T": 10.0, "COM_RC_LOSS_T": 1.0, "COM_OF_LOSS_T": 0.3}


@dataclass(frozen=True, slots=True)
class Definition:
    """One row of the table."""

    name: str
    is_whole: bool
    """INT32; otherwise FLOAT."""
    default: float
    least: float | None
    most: float | None

    def typed(self, value: float) -> float:
        """Of a whole number an int, which the wire takes alone."""
        return int(value) if self.is_whole else value

    def limited(self, value: float) -> float:
        """``value`` within the range that PX4 states for it; NaN and what has no end become the default."""
        if value != value:
            return self.default
        if self.least is not None and value < self.least:
            return self.least
        if self.most is not None and value > self.most:
            return self.most
        return value if math.isfinite(value) else self.default


@cache
def definitions() -> dict[str, Definition]:
    """All rows by name, in the order of their names, which is that of their indices on the wire."""
    with TABLE.open(newline="") as lines:
        rows = [_definition(row) for row in csv.DictReader(lines)]
    return {row.name: row for row in sorted(rows, key=lambda row: row.name)}


def _definition(row: dict[str, str]) -> Definition:
    is_whole = row["type"] == "INT32"
    number = int if is_whole else float
    return Definition(
        name=row["name"],
        is_whole=is_whole,
        default=number(row["default"]),
        least=number(row["min"]) if row["min"] else None,
        most=number(row["max"]) if row["max"] else None,
    )


def time_outs_at(speed: float) -> dict[str, float]:
    """The parameters for a speed in simulated seconds a second; none at real time, or where there is no speed (0).

    Clients go by the clock, so PX4's simulator start-up multiplies these time-outs by PX4_SIM_SPEED_FACTOR
    (ROMFS/px4fmu_common/init.d-posix/rcS).
    """
    if speed in (0.0, 1.0):
        return {}
    return {name: definitions()[name].limited(speed * seconds) for name, seconds in _AT_REAL_TIME.items()}


class Parameters(dict[str, float]):
    """``parameters["MPC_XY_P"]`` is the value that counts now, in PX4's unit; whole numbers are of type int.

    A dict, so that reading costs nothing; it is changed by `set` alone. PX4 stores whatever number it is
    sent. So does this store (`stored`), but what counts is kept within the range that PX4 states: no code behind it
    was written for more.
    """

    def __init__(self, own_defaults: Mapping[str, float] | None = None) -> None:
        """``own_defaults``: what this airframe has in place of the table's defaults."""
        self.definitions = definitions()
        """What each is; their order is that of their indices."""
        self.names = tuple(self.definitions)
        own = own_defaults or {}
        self.defaults = {name: row.typed(own.get(name, row.default)) for name, row in self.definitions.items()}
        self._stored = dict(self.defaults)
        self.sets = 0
        """Grows with every change of a stored value."""
        self._last_set: dict[str, int] = {}
        super().__init__(self.defaults)

    def stored(self, name: str) -> float:
        """The value as it was set. Raises KeyError for a name without a row in the table."""
        return self._stored[name]

    def set(self, name: str, value: float) -> None:
        """Store ``value``; it counts at once."""
        row = self.definitions[name]
        stored = row.typed(value)
        if stored != self._stored[name]:
            self.sets += 1
            self._last_set[name] = self.sets
        self._stored[name] = stored
        # A default of the airframe may lie outside PX4's range, which is meant for PX4's own control.
        self[name] = stored if stored == self.defaults[name] else row.limited(stored)

    def set_after(self, sets: int) -> list[str]:
        """The names whose stored value has changed since `sets` was that number."""
        return sorted(name for name, at in self._last_set.items() if at > sets)
