"""Ways to fly with limited speed and acceleration, from rest to rest: lines, circles, curves, one after the other."""

import math
from abc import ABC, abstractmethod
from collections.abc import Sequence
from dataclasses import dataclass, replace
from itertools import accumulate
from typing import TypeAlias

import numpy as np
import numpy.typing as npt

from companion.messages import Vector3
from companion.motion.vector import ZERO, minus, plus

# Position, velocity and acceleration; any frame, SI units.
Motion: TypeAlias = tuple[Vector3, Vector3, Vector3]

# On a curve the acceleration is shared: 0.8 of the limit turns, 0.6 changes the speed; 0.8^2 + 0.6^2 = 1.
TURNING_SHARE = 0.8
SPEEDING_SHARE = 0.6


class _Ramped(ABC):
    """From rest to rest along a way of any shape by a trapezoidal speed: speed up, cruise, brake."""

    target_m: Vector3

    def _plan(self, distance_m: float, speed_m_s: float, growth_m_s2: float, braking_m_s2: float) -> None:
        """`growth_m_s2`: the acceleration along the way while the speed grows."""
        # Times a top speed squared, what both ramps together take of the way.
        ramps_s2_per_m = 0.5 / growth_m_s2 + 0.5 / braking_m_s2
        # The cruise speed, or what a way too short for it allows.
        self._top_m_s = top_m_s = min(speed_m_s, math.sqrt(distance_m / ramps_s2_per_m))
        self._growth_m_s2, self._braking_m_s2 = growth_m_s2, braking_m_s2
        self.distance_m = distance_m
        self.duration_s = distance_m / top_m_s + top_m_s * ramps_s2_per_m if top_m_s > 0.0 else 0.0

    def at(self, elapsed_s: float) -> Motion:
        top, growth, braking = self._top_m_s, self._growth_m_s2, self._braking_m_s2
        elapsed_s = max(0.0, elapsed_s)
        ramp_s, remaining_s = top / growth, self.duration_s - elapsed_s
        if remaining_s <= 0.0:
            return self.target_m, ZERO, ZERO
        if elapsed_s < ramp_s:
            return self._motion(0.5 * growth * elapsed_s**2, growth * elapsed_s, growth)
        if remaining_s < top / braking:
            return self._motion(self.distance_m - 0.5 * braking * remaining_s**2, braking * remaining_s, -braking)
        return self._motion(0.5 * growth * ramp_s**2 + top * (elapsed_s - ramp_s), top, 0.0)

    @abstractmethod
    def _motion(self, way_m: float, rate_m_s: float, change_m_s2: float) -> Motion:
        """The motion so far along the way, at a speed and an acceleration along it."""


@dataclass
class LineProfile(_Ramped):
    """A straight line, never faster than `speed`, never changing faster than `acceleration`.

    `speeding_up_m_s2` limits how fast the horizontal speed grows (see FlightConfig).
    """

    start_m: Vector3
    target_m: Vector3
    speed_m_s: float
    acceleration_m_s2: float
    speeding_up_m_s2: float = math.inf

    def __post_init__(self) -> None:
        distance_m, level_m = math.dist(self.start_m, self.target_m), math.dist(self.start_m[:2], self.target_m[:2])
        growth = self.acceleration_m_s2
        if level_m > 0.0:
            growth = min(growth, self.speeding_up_m_s2 * distance_m / level_m)
        self._plan(distance_m, self.speed_m_s, growth, self.acceleration_m_s2)

    def _motion(self, way_m: float, rate_m_s: float, change_m_s2: float) -> Motion:
        n, e, d = (part / self.distance_m for part in minus(self.target_m, self.start_m))
        velocity, acceleration = ((n * size, e * size, d * size) for size in (rate_m_s, change_m_s2))
        return plus(self.start_m, way_m, (n, e, d)), velocity, acceleration

    def moved(self, by_m: Vector3) -> "LineProfile":
        return replace(self, start_m=plus(self.start_m, 1.0, by_m), target_m=plus(self.target_m, 1.0, by_m))


@dataclass
class CircleProfile(_Ramped):
    """Round a centre at its height, from an angle (clockwise from north, seen from above) through `angle_rad`."""

    centre_m: Vector3
    radius_m: float
    start_rad: float
    angle_rad: float  # positive clockwise
    speed_m_s: float
    acceleration_m_s2: float
    speeding_up_m_s2: float = math.inf

    def __post_init__(self) -> None:
        self.target_m = self._place(self.start_rad + self.angle_rad)
        # v^2 / R sideways within its share of the acceleration, and no more than what speeds up.
        turning_m_s = math.sqrt(min(TURNING_SHARE * self.acceleration_m_s2, self.speeding_up_m_s2) * self.radius_m)
        braking = SPEEDING_SHARE * self.acceleration_m_s2
        growth = min(braking, self.speeding_up_m_s2)
        self._plan(abs(self.angle_rad) * self.radius_m, min(self.speed_m_s, turning_m_s), growth, braking)

    def _motion(self, way_m: float, rate_m_s: float, change_m_s2: float) -> Motion:
        sense = math.copysign(1.0, self.angle_rad)
        angle = self.start_rad + sense * way_m / self.radius_m
        c, s = math.cos(angle), math.sin(angle)
        inwards = rate_m_s**2 / self.radius_m
        velocity = (-s * sense * rate_m_s, c * sense * rate_m_s, 0.0)
        acceleration = (-s * sense * change_m_s2 - c * inwards, c * sense * change_m_s2 - s * inwards, 0.0)
        return self._place(angle), velocity, acceleration

    def _place(self, angle_rad: float) -> Vector3:
        n, e, d = self.centre_m
        return (n + self.radius_m * math.cos(angle_rad), e + self.radius_m * math.sin(angle_rad), d)


@dataclass
class Chain:
    """One trajectory after the other; each begins where the one before it ends."""

    parts: Sequence["Trajectory"]

    def __post_init__(self) -> None:
        self.distance_m: float = sum(part.distance_m for part in self.parts)
        ends_s = accumulate(part.duration_s for part in self.parts)
        # The end of each part, and when it is reached.
        self.passes = [(end_s, part.target_m) for end_s, part in zip(ends_s, self.parts, strict=True)]
        self.duration_s: float = self.passes[-1][0]
        self.target_m: Vector3 = self.passes[-1][1]

    def at(self, elapsed_s: float) -> Motion:
        for part in self.parts[:-1]:
            if elapsed_s < part.duration_s:
                return part.at(elapsed_s)
            elapsed_s -= part.duration_s
        return self.parts[-1].at(elapsed_s)


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


@dataclass
class CurveProfile:
    """Natural cubic spline over centripetal knots (Catmull-Rom's remedy against loops), timed by its curvature.

    Where the curve bends, v^2 / R stays within its share of the acceleration, and no more than what speeds up; a pass
    forwards and one backwards along the curve hold the change of speed within its own (the method of Bobrow, Dubowsky
    and Gibson, 1985).
    """

    points_m: Sequence[Vector3]
    speed_m_s: float
    acceleration_m_s2: float
    speeding_up_m_s2: float = math.inf

    def __post_init__(self) -> None:
        points: list[Vector3] = []
        for point in self.points_m:
            if not points or math.dist(point, points[-1]) >= LEAST_GAP_M:
                points.append(point)
        self.target_m = points[-1]
        self.distance_m = self.duration_s = 0.0
        if len(points) > 1:
            self._plan(points)

    def at(self, elapsed_s: float) -> Motion:
        if elapsed_s >= self.duration_s:
            return self.target_m, ZERO, ZERO
        steps = max(0.0, elapsed_s) / _TABLE_STEP_S
        index = min(int(steps), len(self._table) - 2)
        before, after = self._table[index : index + 2]
        place, velocity, acceleration = map(tuple, (before + (steps - index) * (after - before)).tolist())
        return place, velocity, acceleration

    def _plan(self, points_m: list[Vector3]) -> None:
        points = np.array(points_m)
        chords = np.linalg.norm(np.diff(points, axis=0), axis=1)
        knots = np.concatenate([[0.0], np.cumsum(np.sqrt(chords))])
        spline = _Spline(knots, points)
        steps = int(np.clip(2.0 * chords.sum() / _STEP_M, 50, _MOST_STEPS))
        u = np.linspace(0.0, knots[-1], steps + 1)
        _, first, _ = spline(u)
        rate = np.maximum(np.linalg.norm(first, axis=1), _LEAST_RATE)
        pieces_m = 0.5 * (rate[1:] + rate[:-1]) * np.diff(u)
        along_m = np.concatenate([[0.0], np.cumsum(pieces_m)])
        speeds = self._speeds(first / rate[:, None], pieces_m)
        times_s = np.concatenate([[0.0], np.cumsum(2.0 * pieces_m / (speeds[1:] + speeds[:-1]))])
        self.distance_m, self.duration_s = float(along_m[-1]), float(times_s[-1])
        # Each point, and when it is passed.
        self.passes = list(zip(np.interp(knots, u, times_s).tolist(), points_m, strict=True))
        self._tabulate(spline, u, along_m, speeds, times_s)

    def _speeds(self, tangents: Floats, pieces_m: Floats) -> Floats:
        """The fastest speeds from rest to rest within the limits."""
        # Turn over way from each point to its neighbours, the larger; finite where the curve turns back on itself.
        cosines = np.clip(np.sum(tangents[1:] * tangents[:-1], axis=1), -1.0, 1.0)
        turns = np.pad(np.arccos(cosines) / pieces_m, 1, mode="edge")
        curvature = np.maximum(np.maximum(turns[:-1], turns[1:]), 1e-9)
        turning_m_s2 = min(TURNING_SHARE * self.acceleration_m_s2, self.speeding_up_m_s2)
        squares = np.minimum(self.speed_m_s, np.sqrt(turning_m_s2 / curvature)) ** 2
        squares[0] = squares[-1] = 0.0
        braking_m_s2 = SPEEDING_SHARE * self.acceleration_m_s2
        squares = _slowed(squares, 2.0 * min(braking_m_s2, self.speeding_up_m_s2) * pieces_m)
        squares = _slowed(squares[::-1], 2.0 * braking_m_s2 * pieces_m[::-1])[::-1]
        # What rounds to rest in between would take for ever.
        squares[1:-1] = np.maximum(squares[1:-1], _LEAST_RATE**2)
        return np.asarray(np.sqrt(squares))

    def _tabulate(self, spline: "_Spline", u: Floats, along_m: Floats, speeds: Floats, times_s: Floats) -> None:
        """Motion at equal steps of time; within a step of the curve the speed changes evenly."""
        count = int(np.ceil(self.duration_s / _TABLE_STEP_S)) + 1
        t = np.minimum(np.arange(count) * _TABLE_STEP_S, self.duration_s)
        index = np.clip(np.searchsorted(times_s, t, side="right") - 1, 0, len(times_s) - 2)
        since_s = t - times_s[index]
        change = (np.diff(speeds) / np.diff(times_s))[index]
        speed = speeds[index] + change * since_s
        at_m = along_m[index] + speeds[index] * since_s + 0.5 * change * since_s**2
        place, first, second = spline(np.interp(at_m, along_m, u))
        rate = np.maximum(np.linalg.norm(first, axis=1, keepdims=True), _LEAST_RATE)
        tangent = first / rate
        bend = (second - tangent * np.sum(second * tangent, axis=1, keepdims=True)) / rate**2
        acceleration = tangent * change[:, None] + bend * speed[:, None] ** 2
        self._table = np.stack([place, tangent * speed[:, None], acceleration], axis=1)


def _slowed(most: Floats, gains: Floats) -> Floats:
    """The largest values below `most` (n) that grow from one to the next by `gains` (n - 1) at most."""
    # Less all gains so far, they may not grow. In whole arrays: no setpoint is sent meanwhile.
    grown = np.concatenate([[0.0], np.cumsum(gains)])
    return grown + np.minimum.accumulate(most - grown)


class _Spline:
    """The natural cubic spline through points (n, 3): its second derivative is continuous, and zero at both ends."""

    def __init__(self, knots: Floats, points: Floats) -> None:
        gaps = np.diff(knots)[:, None]
        slopes = np.diff(points, axis=0) / gaps
        # Of the derivatives at the knots: continuous second derivatives, one row for each knot.
        between = 1.0 / gaps[:, 0]
        matrix = np.diag(between, 1) + np.diag(between, -1)
        matrix += np.diag(2.0 * matrix.sum(axis=0))
        weighed = 3.0 * slopes / gaps
        rates = np.linalg.solve(matrix, np.pad(weighed, ((0, 1), (0, 0))) + np.pad(weighed, ((1, 0), (0, 0))))
        square = (3.0 * slopes - 2.0 * rates[:-1] - rates[1:]) / gaps
        cube = (rates[:-1] + rates[1:] - 2.0 * slopes) / gaps**2
        # Of each piece the coefficients of 1, u, u^2, u^3.
        self._knots, self._pieces = knots, np.stack([points[:-1], rates[:-1], square, cube])

    def __call__(self, u: Floats) -> tuple[Floats, Floats, Floats]:
        """Places (m, 3), their first and their second derivatives."""
        piece = np.clip(np.searchsorted(self._knots, u, side="right") - 1, 0, len(self._knots) - 2)
        # From where on its piece each is, and that piece's coefficients.
        x, (a, b, c, d) = (u - self._knots[piece])[:, None], self._pieces[:, piece]
        return a + x * (b + x * (c + x * d)), b + x * (2.0 * c + 3.0 * x * d), 2.0 * c + 6.0 * x * d


# Where to be when, from rest to rest: how long the way is, how long it takes, where it ends, and the motion at a time.
# Before the start that is at rest there, after the end at rest at the target.
Trajectory: TypeAlias = LineProfile | CircleProfile | Chain | CurveProfile
