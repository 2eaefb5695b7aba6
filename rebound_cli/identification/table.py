"""A CSV file of motion capture, and of a force sensor if it has one, as arrays."""

import csv
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from rebound_cli.identification.hit import Floats, IdentificationError

# A column is known by the end of its name: the plain names of docs/airframes.md, then what a ROS bag
# becomes in CSV. Columns of other topics are ignored.
_TIME = ("time_s", "__time")
_POSITION = ("position_{}_m", "position/{}")
_YAW = ("yaw_rad", "orientation/yaw")
_FORCE = ("force_{}_n", "wrench/force/{}")

# A hit needs a few samples before and after it; below this a file is a fragment.
_FEWEST_POSITIONS = 20


@dataclass(frozen=True, slots=True)
class Table:
    """Positions and forces with a clock each, for the two are often not the same."""

    name: str
    time_s: Floats
    position_m: Floats
    """(n, 2): the horizontal axes of the file's own frame."""
    yaw_rad: Floats | None
    force_time_s: Floats
    force_n: Floats
    """(n, 3); empty without a force sensor."""


def read_table(path: Path) -> Table:
    """Raises IdentificationError with one sentence for a file that is missing, not a table or lacks columns."""
    header, rows = _cells(path)
    time = _column(header, _TIME, path)
    position = [_column(header, [name.format(axis) for name in _POSITION], path) for axis in "xy"]
    yaw = _optional_column(header, _YAW, path)
    force = [_optional_column(header, [name.format(axis) for name in _FORCE], path) for axis in "xyz"]
    has_position = np.isfinite(rows[:, [time, *position]]).all(axis=1)
    if has_position.sum() < _FEWEST_POSITIONS:
        raise IdentificationError(
            f"{path}: only {int(has_position.sum())} rows have a time and a position; "
            f"at least {_FEWEST_POSITIONS} are needed."
        )
    force_columns = [column for column in force if column is not None]
    has_force = np.isfinite(rows[:, [time, *force_columns]]).all(axis=1) if len(force_columns) == 3 else None
    poses = rows[has_position]
    # Rows of several topics are often written out of order.
    poses = poses[np.argsort(poses[:, time], kind="stable")]
    forces = rows[has_force] if has_force is not None else rows[:0]
    return Table(
        name=path.stem,
        time_s=poses[:, time] - poses[0, time],
        position_m=poses[:, position],
        yaw_rad=poses[:, yaw] if yaw is not None and np.isfinite(poses[:, yaw]).all() else None,
        force_time_s=forces[:, time] - forces[0, time] if len(forces) else np.empty(0),
        force_n=forces[:, force_columns] if len(forces) else np.empty((0, 3)),
    )


def _cells(path: Path) -> tuple[list[str], Floats]:
    try:
        with path.open(newline="", encoding="utf-8") as stream:
            lines = list(csv.reader(stream))
    except FileNotFoundError:
        raise IdentificationError(f"{path}: no such file.") from None
    except (OSError, UnicodeDecodeError, csv.Error) as error:
        raise IdentificationError(f"{path}: cannot be read as a CSV file of UTF-8 text.") from error
    if len(lines) < 2:
        raise IdentificationError(f"{path}: a line of column names and rows below it were expected.")
    header = [name.strip() for name in lines[0]]
    rows = np.full((len(lines) - 1, len(header)), np.nan)
    for row, line in zip(rows, lines[1:], strict=True):
        for index, cell in enumerate(line[: len(header)]):
            row[index] = _number(cell)
    return header, rows


def _number(cell: str) -> float:
    """NaN for an empty cell and for text: a table of several topics has both."""
    try:
        return float(cell)
    except ValueError:
        return np.nan


def _column(header: list[str], names: tuple[str, ...] | list[str], path: Path) -> int:
    index = _optional_column(header, names, path)
    if index is None:
        raise IdentificationError(f"{path}: no column is called {' or ends in '.join(names)}; see docs/airframes.md.")
    return index


def _optional_column(header: list[str], names: tuple[str, ...] | list[str], path: Path) -> int | None:
    for name in names:
        found = [index for index, column in enumerate(header) if column == name or column.endswith("/" + name)]
        if len(found) > 1:
            raise IdentificationError(f"{path}: {len(found)} columns end in {name}; keep the one of the vehicle.")
        if found:
            return found[0]
    return None
