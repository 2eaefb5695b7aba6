"""A hit in a table of positions: where it is, how fast the vehicle came and went."""

import itertools
import math

import numpy as np

from rebound_cli.identification.force import force_of
from rebound_cli.identification.hit import Floats, Hit, IdentificationError, Track
from rebound_cli.identification.table import Table

# Speeds are slopes of lines through 35 ms of positions: five samples at 120 Hz, for which 0.3 mm of noise
# are 0.01 m/s, and short enough that a vehicle accelerating at 3 m/s2 changes by 0.1 m/s within it.
SLOPE_S = 0.035
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
_BEFORE_TURN_S = 0.07
_AFTER_TURN_S = 0.11


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
        if (hit := _hardest(table, span, wall_axis, towards)) is not None
    ]
    if not hits:
        raise IdentificationError(
            f"{table.name}: no hit found: nowhere does the vehicle come faster than {_SLOWEST_HIT_M_S} m/s "
            f"and turn around within {_LONGEST_TURN_S} s."
        )
    return max(hits, key=lambda hit: hit.normal_change_m_s)


def slopes(time_s: Floats, value: Floats, interval_s: float) -> Floats:
    """Slope of the least-squares line through the samples around each; NaN where there are too few."""
    count = max(_FEWEST_IN_A_SLOPE, round(SLOPE_S / interval_s) + 1)
    result = np.full(len(value), np.nan)
    if len(value) < count:
        return result
    times = np.lib.stride_tricks.sliding_window_view(time_s, count)
    values = np.lib.stride_tricks.sliding_window_view(value, count)
    centred = times - times.mean(axis=1, keepdims=True)
    result[count // 2 : count // 2 + len(times)] = (centred * values).sum(axis=1) / (centred**2).sum(axis=1)
    return result


def _spans(time_s: Floats) -> list[slice]:
    """Parts of the recording without a gap."""
    steps = np.diff(time_s)
    edges = np.flatnonzero(steps > _GAP_INTERVALS * np.median(steps)) + 1
    bounds = [0, *edges.tolist(), len(time_s)]
    return [slice(a, b) for a, b in itertools.pairwise(bounds) if b - a >= 4 * _FEWEST_IN_A_SLOPE]


def _even(time_s: Floats) -> tuple[Floats, float]:
    """Times of evenly taken samples from the times of their arrival.

    A recorder that polls 120 Hz of motion capture 100 times a second stamps five samples 10 ms apart and the
    sixth together with the fifth; differences of such stamps are speeds 17 % low or infinite.
    """
    count = np.arange(len(time_s))
    interval, start = np.polyfit(count, time_s, 1)
    even = start + interval * count
    if np.std(time_s - even) > interval:
        return time_s, float(np.median(np.diff(time_s)))
    return even, float(interval)


def _hardest(table: Table, span: slice, axis: int, towards: float) -> Hit | None:
    """The hardest turn in one gapless part, if there is one as hard as a hit."""
    time_s, interval_s = _even(table.time_s[span])
    if interval_s <= 0.0:
        # All rows of one time: no column of times.
        return None
    position = towards * table.position_m[span, axis]
    speed = slopes(time_s, position, interval_s)
    reach = max(1, round(_LONGEST_TURN_S / interval_s))
    best: tuple[float, int, int] | None = None
    for start in np.flatnonzero(speed > _SLOWEST_HIT_M_S):
        after = speed[start + 1 : start + 1 + reach]
        if not np.isfinite(after).any():
            continue
        end = int(start + 1 + np.nanargmin(after))
        change = float(speed[start] - speed[end])
        hard = change > _LEAST_DECELERATION_M_S2 * (time_s[end] - time_s[start])
        if speed[end] < -_SLOWEST_REBOUND_M_S and hard and (best is None or change > best[0]):
            best = change, int(start), end
    if best is None:
        return None
    return _measured(table, span, axis, towards, time_s[(best[1] + best[2]) // 2])


def _measured(table: Table, span: slice, axis: int, towards: float, at_s: float) -> Hit | None:
    """The hit near ``at_s``, with the clock made even again over its neighbourhood alone."""
    near = np.flatnonzero(np.abs(table.time_s[span] - at_s) < _AROUND_S) + (span.start or 0)
    time_s, interval_s = _even(table.time_s[near])
    position = towards * table.position_m[near, axis]
    speed = slopes(time_s, position, interval_s)
    turn = int(np.argmax(np.where(np.abs(time_s - at_s) < _LONGEST_TURN_S, position, -np.inf)))
    before = (time_s >= time_s[turn] - _BEFORE_TURN_S) & (time_s <= time_s[turn]) & np.isfinite(speed)
    after = (time_s > time_s[turn]) & (time_s <= time_s[turn] + _AFTER_TURN_S) & np.isfinite(speed)
    if not before.any() or not after.any():
        return None
    start = int(np.argmax(np.where(before, speed, -np.inf)))
    end = int(np.argmin(np.where(after, speed, np.inf)))
    along = slopes(time_s, table.position_m[near, 1 - axis], interval_s)
    half_s = SLOPE_S / 2
    used = (time_s > time_s[start] - half_s - _APPROACH_S) & (time_s < time_s[end] + half_s + interval_s / 2)
    noise_m = _noise(time_s, position, start)
    count = max(_FEWEST_IN_A_SLOPE, round(SLOPE_S / interval_s) + 1)
    return Hit(
        name=table.name,
        at_s=float(time_s[start]),
        speed_in_m_s=float(speed[start]),
        speed_out_m_s=float(-speed[end]),
        speed_sigma_m_s=noise_m / (interval_s * math.sqrt(count * (count**2 - 1) / 12)),
        along_in_m_s=float(along[start]),
        along_out_m_s=float(along[end]),
        guards=_guards(table.yaw_rad[near] if table.yaw_rad is not None else None, start, axis),
        force=force_of(table),
        track=Track(time_s[used] - time_s[start], position[used], interval_s),
    )


def _noise(time_s: Floats, position: Floats, start: int) -> float:
    """Standard deviation of the positions about a parabola through the approach, in metres."""
    before = slice(max(0, start - 10), start + 2)
    fit = np.polyfit(time_s[before], position[before], 2)
    rest = position[before] - np.polyval(fit, time_s[before])
    return float(np.sqrt((rest**2).sum() / max(1, len(rest) - 3)))


def _guards(yaw_rad: Floats | None, index: int, axis: int) -> int:
    """2 where the nose, or a side, faces the wall to 22.5 degrees; 1 at the diagonals; 2 if unknown."""
    if yaw_rad is None:
        return 2
    off_rad = (float(yaw_rad[index]) - axis * math.pi / 2 + math.pi / 4) % (math.pi / 2) - math.pi / 4
    return 2 if abs(off_rad) < math.pi / 8 else 1
