"""What each parameter is: the table `px4.csv`, whose facts are those of PX4's own parameter definitions.

Defaults are the ones that a multicopter in PX4's simulation has (rc.mc_defaults, init.d-posix/rcS); the few that
describe the vehicle itself are laid over them by `airframe_values.py`, as PX4's airframe files do.
"""

import csv
import math
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
    needs_reboot: bool
    """Whether a new value counts only after the next reboot."""

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
        needs_reboot=row["needs_reboot"] == "yes",
    )


def time_outs_at(speed: float) -> dict[str, float]:
    """The parameters for a speed in simulated seconds a second; none at real time, or where there is no speed (0).

    Clients go by the clock, so PX4's simulator start-up multiplies these time-outs by PX4_SIM_SPEED_FACTOR
    (ROMFS/px4fmu_common/init.d-posix/rcS).
    """
    if speed in (0.0, 1.0):
        return {}
    return {name: definitions()[name].limited(speed * seconds) for name, seconds in _AT_REAL_TIME.items()}
