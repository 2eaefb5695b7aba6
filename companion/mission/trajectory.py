"""Ways to fly with limited speed and acceleration, from rest to rest: lines, circles, curves, one after the other."""

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from itertools import accumulate
from typing import TypeAlias

import numpy as np
import numpy.typing as npt

from companion.messages import Vector3
from companion.motion.vector import ZERO, minus, plus, towards

# Position, velocity and acceleration; any frame, SI units.
Motion: TypeAlias = tuple[Vector3, Vector3, Vector3]

# On a curve the acceleration is shared: 0.8 of the limit turns, 0.6 changes the speed; 0.8^2 + 0.6^2 = 1.
TURNING_SHARE = 0.8
SPEEDING_SHARE = 0.6


@dataclass(frozen=True)
class Ramps:
    """A trapezoidal speed along a way of any shape: speed up, cruise, brake."""

    distance_m: float
    speed_m_s: float
    speeding_up_m_s2: float
    braking_m_s2: float

    @cached_property
    def _ramps_s2_per_m(self) -> float:
        """Times a top speed squared, what both ramps together take of the way."""
        return 0.5 / self.speeding_up_m_s2 + 0.5 / self.braking_m_s2

    @cached_property
    def top_speed_m_s(self) -> float:
        """The cruise speed, or what a way too short for it allows."""
        return min(self.speed_m_s, math.sqrt(self.distance_m / self._ramps_s2_per_m))

    @cached_property
    def duration_s(self) -> float:
        top = self.top_speed_m_s
        return self.distance_m / top + top * self._ramps_s2_per_m if top > 0.0 else 0.0

    def at(self, elapsed_s: float) -> tuple[float, float, float]:
        """Distance covered, speed and acceleration; at a time within the duration."""
        top, growth, braking = self.top_speed_m_s, self.speeding_up_m_s2, self.braking_m_s2
        ramp_s, remaining_s = top / growth, self.duration_s - elapsed_s
        if elapsed_s < ramp_s:
            return 0.5 * growth * elapsed_s**2, growth * elapsed_s, growth
        if remaining_s < top / braking:
            return self.distance_m - 0.5 * braking * remaining_s**2, braking * remaining_s, -braking
        return 0.5 * growth * ramp_s**2 + top * (elapsed_s - ramp_s), top, 0.0


@dataclass(frozen=True)
class LineProfile:
    """A straight line, never faster than `speed`, never changing faster than `acceleration`.

    `speeding_up_m_s2` limits how fast the horizontal speed grows (see FlightConfig).
    """

    start_m: Vector3
    target_m: Vector3
    speed_m_s: float
    acceleration_m_s2: float
    speeding_up_m_s2: float = math.inf

    @cached_property
    def distance_m(self) -> float:
        return math.dist(self.start_m, self.target_m)

    @cached_property
    def _ramps(self) -> Ramps:
        growth, level_m = self.acceleration_m_s2, math.dist(self.start_m[:2], self.target_m[:2])
        if level_m > 0.0:
            growth = min(growth, self.speeding_up_m_s2 * self.distance_m / level_m)
        return Ramps(self.distance_m, self.speed_m_s, growth, self.acceleration_m_s2)

    @cached_property
    def duration_s(self) -> float:
        return self._ramps.duration_s

    def at(self, elapsed_s: float) -> Motion:
        if elapsed_s >= self.duration_s:
            return self.target_m, ZERO, ZERO
        way, rate, change = self._ramps.at(max(0.0, elapsed_s))
        n, e, d = (part / self.distance_m for part in minus(self.target_m, self.start_m))
        return plus(self.start_m, way, (n, e, d)), (n * rate, e * rate, d * rate), (n * change, e * change, d * change)

    def moved(self, by_m: Vector3) -> "LineProfile":
        return replace(self, start_m=plus(self.start_m, 1.0, by_m), target_m=plus(self.target_m, 1.0, by_m))


@dataclass(frozen=True)
class CircleProfile:
    """Round a centre at its height, from an angle (clockwise from north, seen from above) through `angle_rad`."""

    centre_m: Vector3
    radius_m: float
    start_rad: float
    angle_rad: float  # positive clockwise
    speed_m_s: float
    acceleration_m_s2: float
    speeding_up_m_s2: float = math.inf

    @cached_property
    def distance_m(self) -> float:
        return abs(self.angle_rad) * self.radius_m

    @cached_property
    def _ramps(self) -> Ramps:
        # v^2 / R sideways within its share of the acceleration, and no more than what speeds up.
        turning_m_s = math.sqrt(min(TURNING_SHARE * self.acceleration_m_s2, self.speeding_up_m_s2) * self.radius_m)
        braking = SPEEDING_SHARE * self.acceleration_m_s2
        growth = min(braking, self.speeding_up_m_s2)
        return Ramps(self.distance_m, min(self.speed_m_s, turning_m_s), growth, braking)

    @cached_property
    def duration_s(self) -> float:
        return self._ramps.duration_s

    @property
    def target_m(self) -> Vector3:
        return self._place(self.start_rad + self.angle_rad)

    def at(self, elapsed_s: float) -> Motion:
        if elapsed_s >= self.duration_s:
            return self.target_m, ZERO, ZERO
        way, rate, change = self._ramps.at(max(0.0, elapsed_s))
        sense = math.copysign(1.0, self.angle_rad)
        angle = self.start_rad + sense * way / self.radius_m
        c, s = math.cos(angle), math.sin(angle)
        inwards = rate**2 / self.radius_m
        velocity = (-s * sense * rate, c * sense * rate, 0.0)
        acceleration = (-s * sense * change - c * inwards, c * sense * change - s * inwards, 0.0)
        return self._place(angle), velocity, acceleration

    def _place(self, angle_rad: float) -> Vector3:
        n, e, d = self.centre_m
        return (n + self.radius_m * math.cos(angle_rad), e + self.radius_m * math.sin(angle_rad), d)


@dataclass(frozen=True)
class Chain:
    """One trajectory after the other; each begins where the one before it ends."""

    parts: Sequence["Trajectory"]

    @cached_property
    def distance_m(self) -> float:
        return sum(part.distance_m for part in self.parts)

    @cached_property
    def duration_s(self) -> float:
        return sum(part.duration_s for part in self.parts)

    @property
    def target_m(self) -> Vector3:
        return self.parts[-1].target_m

    def at(self, elapsed_s: float) -> Motion:
        for part in self.parts[:-1]:
            duration_s = part.duration_s
            if elapsed_s < duration_s:
                return part.at(elapsed_s)
            elapsed_s -= duration_s
        return self.parts[-1].at(elapsed_s)

    def ahead(self, elapsed_s: float) -> list[Vector3]:
        """The ends of its parts that are not reached by then."""
        ends_s = accumulate(part.duration_s for part in self.parts)
        return [part.target_m for part, end_s in zip(self.parts, ends_s, strict=True) if end_s > elapsed_s]


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

    Where the curve bends, v^2 / R stays within its share of the acceleration, and no more than what speeds up; a pass
    forwards and one backwards along the curve hold the change of speed within its own (the method of Bobrow, Dubowsky
    and Gibson, 1985).
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
        self._points_m, self._passed_s = points, [0.0]
        if len(points) > 1:
            self._plan(np.array(points), speed_m_s, acceleration_m_s2, speeding_up_m_s2)

    def at(self, elapsed_s: float) -> Motion:
        """Position, velocity and acceleration; before the start at rest there, after the end at the target."""
        if elapsed_s >= self.duration_s:
            return self.target_m, ZERO, ZERO
        steps = max(0.0, elapsed_s) / _TABLE_STEP_S
        index = min(int(steps), len(self._table) - 2)
        before, after = self._table[index : index + 2]
        place, velocity, acceleration = (towards(a, b, steps - index) for a, b in zip(before, after, strict=True))
        return place, velocity, acceleration

    def ahead(self, elapsed_s: float) -> list[Vector3]:
        """The points that are not passed by then."""
        return [place for place, passed_s in zip(self._points_m, self._passed_s, strict=True) if passed_s > elapsed_s]

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
        turning_m_s2 = min(TURNING_SHARE * acceleration_m_s2, speeding_up_m_s2)
        top_m_s = np.minimum(speed_m_s, np.sqrt(turning_m_s2 / np.maximum(curvature, 1e-9)))
        braking_m_s2 = SPEEDING_SHARE * acceleration_m_s2
        speeds = _within_acceleration(top_m_s, pieces_m, min(braking_m_s2, speeding_up_m_s2), braking_m_s2)
        times_s = np.concatenate([[0.0], np.cumsum(2.0 * pieces_m / (speeds[1:] + speeds[:-1]))])
        self.distance_m, self.duration_s = float(along_m[-1]), float(times_s[-1])
        self._passed_s = np.interp(knots, u, times_s).tolist()
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


# Where to be when, from rest to rest: how long the way is, how long it takes, where it ends, and the motion at a time.
# Before the start that is at rest there, after the end at rest at the target.
Trajectory: TypeAlias = LineProfile | CircleProfile | Chain | CurveProfile


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
    # Lists: one number of an array takes several times as long to look at.
    squares = (top_m_s**2).tolist()
    squares[0] = squares[-1] = 0.0
    gain, loss = ((2.0 * change_m_s2 * pieces_m).tolist() for change_m_s2 in (speeding_up_m_s2, braking_m_s2))
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
    return [(n, e, d) for n, e, d in rows.tolist()]
