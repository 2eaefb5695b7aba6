"""A hit in a CSV file of motion capture."""

import csv
import itertools
import math
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from rebound_cli.identification.hit import Floats, Hit, IdentificationError, Track, guards_at

# A column is known by the end of its name: the plain names of docs/how-to/airframes.md, then what a ROS bag
# becomes in CSV. Columns of other topics are ignored.
_TIME = ("time_s", "__time")
_POSITION = ("position_{}_m", "position/{}")
_YAW = ("yaw_rad", "orientation/yaw")
# A hit needs a few samples before and after it; below this a file is a fragment.
_FEWEST_POSITIONS = 20

# Speeds are slopes of lines through 35 ms of positions: five samples at 120 Hz, for which 0.3 mm of noise
# are 0.01 m/s, and short enough that a vehicle accelerating at 3 m/s2 changes by 0.1 m/s within it.
_SLOPE_S = 0.035
_FEWEST_IN_A_SLOPE = 4
# A hit turns the vehicle around within this; the foldable vehicle takes 0.10 s, plus a slope on each side.
_LONGEST_TURN_S = 0.2
# Slower than this the rebound drowns in what the autopilot does.
_SLOWEST_HIT_M_S = 0.15
_SLOWEST_REBOUND_M_S = 0.02
# Both speeds over the time between them: an autopilot would turn around like this with 22 degrees of tilt.
# The soft hits of the foldable vehicle are as hard from 0.5 m/s on.
_LEAST_DECELERATION_M_S2 = 4.0
# Samples further apart than this many times the usual are a gap in the recording.
_GAP_INTERVALS = 3.5
# Positions before the fastest moment that the fit sees: long enough for a line.
_APPROACH_S = 0.05
_AROUND_S = 0.3
# The fastest moments lie within these of the furthest point: half a slope and, for the foldable vehicle of
# eq. 2, 38 ms from touch to turn and 63 ms from turn to release. More would take in the autopilot's doing.
_BEFORE_TURN_S, _AFTER_TURN_S = 0.07, 0.11


@dataclass(frozen=True, slots=True)
class Table:
    """Positions (n, 2) on the horizontal axes of the file's own frame, in the order of time."""

    name: str
    time_s: Floats
    position_m: Floats
    yaw_rad: Floats | None


def read_table(path: Path) -> Table:
    """Raises IdentificationError with one sentence for a file that is not a table or lacks columns."""
    try:
        with path.open(newline="", encoding="utf-8") as stream:
            header, *lines = csv.reader(stream)
    except (ValueError, csv.Error) as error:
        text = "a CSV file of UTF-8 text with a line of column names and rows below it was expected"
        raise IdentificationError(f"{path}: {text}.") from error

    def column(names: tuple[str, ...], axis: str = "", is_needed: bool = True) -> Floats | None:
        for name in (name.format(axis) for name in names):
            found = [index for index, title in enumerate(header) if f"/{title.strip()}".endswith(f"/{name}")]
            if len(found) > 1:
                raise IdentificationError(f"{path}: {len(found)} columns end in {name}; keep the one of the vehicle.")
            if found:
                return np.array([_number(line, found[0]) for line in lines])
        if is_needed:
            wanted = " or ends in ".join(names).format(axis, axis)
            raise IdentificationError(f"{path}: no column is called {wanted}; see docs/how-to/airframes.md.")
        return None

    columns = [column(_TIME), *(column(_POSITION, axis) for axis in "xy")]
    poses = np.column_stack([values for values in columns if values is not None])
    sound = np.isfinite(poses).all(axis=1)
    if sound.sum() < _FEWEST_POSITIONS:
        text = f"only {int(sound.sum())} rows have a time and a position; at least {_FEWEST_POSITIONS} are needed"
        raise IdentificationError(f"{path}: {text}.")
    # Rows of several topics are often written out of order.
    order = np.flatnonzero(sound)[np.argsort(poses[sound, 0], kind="stable")]
    yaw = column(_YAW, is_needed=False)
    return Table(
        name=path.stem,
        time_s=poses[order, 0] - poses[order[0], 0],
        position_m=poses[order, 1:],
        yaw_rad=yaw[order] if yaw is not None and np.isfinite(yaw[order]).all() else None,
    )


def _number(line: list[str], index: int) -> float:
    """NaN for an empty cell and for text: a table of several topics has both."""
    try:
        return float(line[index])
    except (ValueError, IndexError):
        return math.nan


def find_hit(table: Table, axis: int | None = None) -> Hit:
    """The hardest hit in the table, on a wall square to one of the frame's horizontal axes.

    ``axis`` 0 or 1 says which; without it the one along which the vehicle turned around hardest.
    Raises IdentificationError where the vehicle turns around nowhere as at a wall.
    """
    hits = [
        hit
        for wall_axis in ((0, 1) if axis is None else (axis,))
        for span in _spans(table.time_s)
        for towards in (1.0, -1.0)
        if (at_s := _hardest_turn(table.time_s[span], towards * table.position_m[span, wall_axis])) is not None
        if (hit := _measured(table, span, wall_axis, towards, at_s)) is not None
    ]
    if not hits:
        raise IdentificationError(
            f"{table.name}: no hit found: nowhere does the vehicle come faster than {_SLOWEST_HIT_M_S} m/s "
            f"and turn around within {_LONGEST_TURN_S} s."
        )
    return max(hits, key=lambda hit: hit.normal_change_m_s)


def _slopes(time_s: Floats, value: Floats, count: int) -> Floats:
    """Slope of the least-squares line through the `count` samples around each; NaN where there are too few."""
    result = np.full(len(value), np.nan)
    if len(value) >= count:
        times = np.lib.stride_tricks.sliding_window_view(time_s, count)
        values = np.lib.stride_tricks.sliding_window_view(value, count)
        centred = times - times.mean(axis=1, keepdims=True)
        result[count // 2 : count // 2 + len(times)] = (centred * values).sum(axis=1) / (centred**2).sum(axis=1)
    return result


def _samples_in_a_slope(interval_s: float) -> int:
    return max(_FEWEST_IN_A_SLOPE, round(_SLOPE_S / interval_s) + 1)


def _spans(time_s: Floats) -> list[slice]:
    """Parts of the recording without a gap."""
    steps = np.diff(time_s)
    edges = np.flatnonzero(steps > _GAP_INTERVALS * np.median(steps)) + 1
    bounds = [0, *edges.tolist(), len(time_s)]
    return [slice(a, b) for a, b in itertools.pairwise(bounds) if b - a >= 4 * _FEWEST_IN_A_SLOPE]


def _even(time_s: Floats) -> tuple[Floats, float]:
    """Times of evenly taken samples from the times of their arrival, and the interval between them.

    A recorder that polls 120 Hz of motion capture 100 times a second stamps five samples 10 ms apart and the
    sixth together with the fifth; differences of such stamps are speeds 17 % low or infinite.
    """
    count = np.arange(len(time_s))
    interval, start = np.polyfit(count, time_s, 1)
    even = start + interval * count
    if np.std(time_s - even) > interval:
        return time_s, float(np.median(np.diff(time_s)))
    return even, float(interval)


def _hardest_turn(time_s: Floats, position: Floats) -> float | None:
    """When the vehicle turned around hardest in a part without a gap; None where nowhere as hard as at a hit."""
    time_s, interval_s = _even(time_s)
    if interval_s <= 0.0:  # all rows of one time: no column of times
        return None
    speed = _slopes(time_s, position, _samples_in_a_slope(interval_s))
    reach = max(1, round(_LONGEST_TURN_S / interval_s))
    best: tuple[float, int] | None = None
    for start in np.flatnonzero(speed > _SLOWEST_HIT_M_S).tolist():
        after = speed[start + 1 : start + 1 + reach]
        if not np.isfinite(after).any():
            continue
        end = start + 1 + int(np.nanargmin(after))
        change = float(speed[start] - speed[end])
        is_hard = change > _LEAST_DECELERATION_M_S2 * (time_s[end] - time_s[start])
        if speed[end] < -_SLOWEST_REBOUND_M_S and is_hard and (best is None or change > best[0]):
            best = change, (start + end) // 2
    return None if best is None else float(time_s[best[1]])


def _measured(table: Table, span: slice, axis: int, towards: float, at_s: float) -> Hit | None:
    """The hit near ``at_s``, with the clock made even again over its neighbourhood alone."""
    near = np.flatnonzero(np.abs(table.time_s[span] - at_s) < _AROUND_S) + span.start
    time_s, interval_s = _even(table.time_s[near])
    position, count = towards * table.position_m[near, axis], _samples_in_a_slope(interval_s)
    speed = _slopes(time_s, position, count)
    turn = int(np.argmax(np.where(np.abs(time_s - at_s) < _LONGEST_TURN_S, position, -np.inf)))
    before = (time_s >= time_s[turn] - _BEFORE_TURN_S) & (time_s <= time_s[turn]) & np.isfinite(speed)
    after = (time_s > time_s[turn]) & (time_s <= time_s[turn] + _AFTER_TURN_S) & np.isfinite(speed)
    if not before.any() or not after.any():
        return None
    start = int(np.argmax(np.where(before, speed, -np.inf)))
    end = int(np.argmin(np.where(after, speed, np.inf)))
    along = _slopes(time_s, table.position_m[near, 1 - axis], count)
    first_s, last_s = time_s[start] - _SLOPE_S / 2 - _APPROACH_S, time_s[end] + _SLOPE_S / 2 + interval_s / 2
    used = (time_s > first_s) & (time_s < last_s)
    return Hit(
        name=table.name,
        at_s=float(time_s[start]),
        speed_in_m_s=float(speed[start]),
        speed_out_m_s=float(-speed[end]),
        speed_sigma_m_s=_noise(time_s, position, start) / (interval_s * math.sqrt(count * (count**2 - 1) / 12)),
        along_in_m_s=float(along[start]),
        along_out_m_s=float(along[end]),
        guards=2 if table.yaw_rad is None else guards_at(float(table.yaw_rad[near[start]]) - axis * math.pi / 2),
        track=Track(time_s[used] - time_s[start], position[used], interval_s),
    )


def _noise(time_s: Floats, position: Floats, start: int) -> float:
    """Standard deviation of the positions about a parabola through the approach, in metres."""
    before = slice(max(0, start - 10), start + 2)
    fit = np.polyfit(time_s[before], position[before], 2)
    rest = position[before] - np.polyval(fit, time_s[before])
    return float(np.sqrt((rest**2).sum() / max(1, len(rest) - 3)))
