"""A smooth curve through points, flown as fast as limits of speed and acceleration allow."""

import math
from collections.abc import Sequence

import numpy as np
import numpy.typing as npt

from companion.flight.trajectory import REST, SPEEDING_SHARE, TURNING_SHARE, Motion
from companion.messages import Vector3

Floats = npt.NDArray[np.float64]

# Finer than what a vehicle of 0.3 m can follow.
_STEP_M = 0.01
_MOST_STEPS = 100_000
# The table's time step is that of the setpoints: linear in between is exact to a tenth of a millimetre at 2 m/s^2.
_TABLE_STEP_S = 0.02
# The spline's own speed where it turns back on itself; keeps its direction from being a division by nothing.
_LEAST_RATE = 1e-6
# Points nearer to each other than this are one point.
LEAST_GAP_M = 0.01


class CurveProfile:
    """Natural cubic spline over centripetal knots (Catmull-Rom's remedy against loops), timed by its curvature.

    Where the curve bends, v^2 / R stays within its share of the acceleration; a pass forwards and one backwards
    along the curve hold the change of speed within its own (the method of Bobrow, Dubowsky and Gibson, 1985).
    """

    def __init__(
        self,
        points_m: Sequence[Vector3],
        speed_m_s: float,
        acceleration_m_s2: float,
        speeding_up_m_s2: float = math.inf,
    ) -> None:
        points = _distinct(points_m)
        self.target_m: Vector3 = points[-1]
        self.duration_s = self.distance_m = 0.0
        self._table: list[Motion] = []
        if len(points) > 1:
            self._plan(np.array(points), speed_m_s, acceleration_m_s2, speeding_up_m_s2)

    def at(self, elapsed_s: float) -> Motion:
        """Position, velocity and acceleration; before the start at rest there, after the end at the target."""
        if elapsed_s >= self.duration_s:
            return self.target_m, REST, REST
        place = max(0.0, elapsed_s) / _TABLE_STEP_S
        index = min(int(place), len(self._table) - 2)
        part = place - index
        before, after = self._table[index], self._table[index + 1]
        return (
            _between(before[0], after[0], part),
            _between(before[1], after[1], part),
            _between(before[2], after[2], part),
        )

    def _plan(self, points: Floats, speed_m_s: float, acceleration_m_s2: float, speeding_up_m_s2: float) -> None:
        chords = np.linalg.norm(np.diff(points, axis=0), axis=1)
        knots = np.concatenate([[0.0], np.cumsum(np.sqrt(chords))])
        spline = _Spline(knots, points)
        steps = int(np.clip(2.0 * chords.sum() / _STEP_M, 50, _MOST_STEPS))
        u = np.linspace(0.0, knots[-1], steps + 1)
        first = spline(u, 1)
        rate = np.maximum(np.linalg.norm(first, axis=1), _LEAST_RATE)
        pieces_m = 0.5 * (rate[1:] + rate[:-1]) * np.diff(u)
        curvature = _curvature(first / rate[:, None], pieces_m)
        along_m = np.concatenate([[0.0], np.cumsum(pieces_m)])
        top_m_s = np.minimum(speed_m_s, np.sqrt(TURNING_SHARE * acceleration_m_s2 / np.maximum(curvature, 1e-9)))
        braking_m_s2 = SPEEDING_SHARE * acceleration_m_s2
        speeds = _within_acceleration(top_m_s, pieces_m, min(braking_m_s2, speeding_up_m_s2), braking_m_s2)
        times_s = np.concatenate([[0.0], np.cumsum(2.0 * pieces_m / (speeds[1:] + speeds[:-1]))])
        self.distance_m, self.duration_s = float(along_m[-1]), float(times_s[-1])
        self._tabulate(spline, u, along_m, speeds, times_s)

    def _tabulate(self, spline: "_Spline", u: Floats, along_m: Floats, speeds: Floats, times_s: Floats) -> None:
        """Motion at equal steps of time; within a step of the curve the speed changes evenly."""
        count = int(np.ceil(self.duration_s / _TABLE_STEP_S)) + 1
        t = np.minimum(np.arange(count) * _TABLE_STEP_S, self.duration_s)
        index = np.clip(np.searchsorted(times_s, t, side="right") - 1, 0, len(times_s) - 2)
        since_s = t - times_s[index]
        change = ((speeds[1:] - speeds[:-1]) / (times_s[1:] - times_s[:-1]))[index]
        speed = speeds[index] + change * since_s
        at_m = along_m[index] + speeds[index] * since_s + 0.5 * change * since_s**2
        place = np.interp(at_m, along_m, u)
        first, second = spline(place, 1), spline(place, 2)
        rate = np.maximum(np.linalg.norm(first, axis=1, keepdims=True), _LEAST_RATE)
        tangent = first / rate
        bend = (second - tangent * np.sum(second * tangent, axis=1, keepdims=True)) / rate**2
        velocity = tangent * speed[:, None]
        acceleration = tangent * change[:, None] + bend * speed[:, None] ** 2
        self._table = list(zip(_tuples(spline(place)), _tuples(velocity), _tuples(acceleration), strict=True))


class _Spline:
    """The natural cubic spline through points (n, 3): its second derivative is continuous, and zero at both ends."""

    def __init__(self, knots: Floats, points: Floats) -> None:
        gaps = np.diff(knots)
        slopes = np.diff(points, axis=0) / gaps[:, None]
        # Of the derivatives at the knots: continuous second derivatives, one row for each knot.
        first, last = np.append(1.0 / gaps, 0.0), np.insert(1.0 / gaps, 0, 0.0)
        matrix = np.diag(2.0 * (first + last)) + np.diag(1.0 / gaps, 1) + np.diag(1.0 / gaps, -1)
        weighed = 3.0 * slopes / gaps[:, None]
        rates = np.linalg.solve(matrix, np.pad(weighed, ((0, 1), (0, 0))) + np.pad(weighed, ((1, 0), (0, 0))))
        self._knots = knots
        # Of each piece the coefficients of 1, u, u^2, u^3.
        square = (3.0 * slopes - 2.0 * rates[:-1] - rates[1:]) / gaps[:, None]
        cube = (rates[:-1] + rates[1:] - 2.0 * slopes) / gaps[:, None] ** 2
        self._pieces = points[:-1], rates[:-1], square, cube

    def __call__(self, u: Floats, derivative: int = 0) -> Floats:
        """(m, 3): places, or their first or second derivatives."""
        piece = np.clip(np.searchsorted(self._knots, u, side="right") - 1, 0, len(self._knots) - 2)
        x = (u - self._knots[piece])[:, None]
        a, b, c, d = (coefficients[piece] for coefficients in self._pieces)
        if derivative == 0:
            return np.asarray(a + x * (b + x * (c + x * d)))
        return np.asarray(b + x * (2.0 * c + 3.0 * x * d) if derivative == 1 else 2.0 * c + 6.0 * x * d)


def _curvature(tangents: Floats, pieces_m: Floats) -> Floats:
    """Turn over way from each point to its neighbours, the larger; finite where the curve turns back on itself."""
    cosines = np.clip(np.sum(tangents[1:] * tangents[:-1], axis=1), -1.0, 1.0)
    turns = np.arccos(cosines) / pieces_m
    curvature: Floats = np.maximum(np.concatenate([turns[:1], turns]), np.concatenate([turns, turns[-1:]]))
    return curvature


def _within_acceleration(top_m_s: Floats, pieces_m: Floats, speeding_up_m_s2: float, braking_m_s2: float) -> Floats:
    """The fastest speeds from rest to rest below `top` whose change along the way stays within the limits."""
    squares = top_m_s**2
    squares[0] = squares[-1] = 0.0
    gain, loss = 2.0 * speeding_up_m_s2 * pieces_m, 2.0 * braking_m_s2 * pieces_m
    for k in range(len(gain)):
        squares[k + 1] = min(squares[k + 1], squares[k] + gain[k])
    for k in range(len(loss) - 1, -1, -1):
        squares[k] = min(squares[k], squares[k + 1] + loss[k])
    speeds: Floats = np.sqrt(squares)
    return speeds


def _distinct(points_m: Sequence[Vector3]) -> list[Vector3]:
    """Without points that lie on the one before."""
    kept: list[Vector3] = []
    for point in points_m:
        if not kept or float(np.linalg.norm(np.subtract(point, kept[-1]))) >= LEAST_GAP_M:
            kept.append(point)
    return kept


def _tuples(rows: Floats) -> list[Vector3]:
    return [(float(n), float(e), float(d)) for n, e, d in rows]


def _between(a: Vector3, b: Vector3, part: float) -> Vector3:
    return (a[0] + part * (b[0] - a[0]), a[1] + part * (b[1] - a[1]), a[2] + part * (b[2] - a[2]))
