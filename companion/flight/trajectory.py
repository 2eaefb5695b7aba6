"""Ways to fly with limited speed and acceleration, from rest to rest: lines, circles, and one after the other."""

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Protocol, TypeAlias

from companion.messages import Vector3

REST: Vector3 = (0.0, 0.0, 0.0)

# Position, velocity and acceleration; any frame, SI units.
Motion: TypeAlias = tuple[Vector3, Vector3, Vector3]

# On a curve the acceleration is shared: 0.8 of the limit turns, 0.6 changes the speed; 0.8^2 + 0.6^2 = 1.
TURNING_SHARE = 0.8
SPEEDING_SHARE = 0.6


class Trajectory(Protocol):
    """Where to be when. Starts and ends at rest."""

    @property
    def duration_s(self) -> float: ...

    @property
    def distance_m(self) -> float:
        """Length of the way."""
        ...

    @property
    def target_m(self) -> Vector3:
        """Where it ends."""
        ...

    def at(self, elapsed_s: float) -> Motion:
        """Before the start at rest there, after the end at rest at the target."""
        ...


@dataclass(frozen=True, slots=True)
class Ramps:
    """A trapezoidal speed along a way of any shape: speed up, cruise, brake."""

    distance_m: float
    speed_m_s: float
    speeding_up_m_s2: float
    braking_m_s2: float

    @property
    def _ramps_s2_per_m(self) -> float:
        """Times a top speed squared, what both ramps together take of the way."""
        return 0.5 / self.speeding_up_m_s2 + 0.5 / self.braking_m_s2

    @property
    def top_speed_m_s(self) -> float:
        """The cruise speed, or what a way too short for it allows."""
        return min(self.speed_m_s, math.sqrt(self.distance_m / self._ramps_s2_per_m))

    @property
    def duration_s(self) -> float:
        top = self.top_speed_m_s
        return self.distance_m / top + top * self._ramps_s2_per_m if top > 0.0 else 0.0

    def at(self, elapsed_s: float, remaining_s: float) -> tuple[float, float, float]:
        """Distance covered, speed and acceleration; at a time within the duration."""
        top, growth, braking = self.top_speed_m_s, self.speeding_up_m_s2, self.braking_m_s2
        ramp_s = top / growth
        if elapsed_s < ramp_s:
            return 0.5 * growth * elapsed_s**2, growth * elapsed_s, growth
        if remaining_s < top / braking:
            return self.distance_m - 0.5 * braking * remaining_s**2, braking * remaining_s, -braking
        return 0.5 * growth * ramp_s**2 + top * (elapsed_s - ramp_s), top, 0.0


@dataclass(frozen=True, slots=True)
class LineProfile:
    """A straight line, never faster than `speed`, never changing faster than `acceleration`.

    `speeding_up_m_s2` limits how fast the horizontal speed grows (see FlightConfig).
    """

    start_m: Vector3
    target_m: Vector3
    speed_m_s: float
    acceleration_m_s2: float
    speeding_up_m_s2: float = math.inf

    @property
    def distance_m(self) -> float:
        return math.dist(self.start_m, self.target_m)

    @property
    def _ramps(self) -> Ramps:
        growth, level_m = self.acceleration_m_s2, math.dist(self.start_m[:2], self.target_m[:2])
        if level_m > 0.0:
            growth = min(growth, self.speeding_up_m_s2 * self.distance_m / level_m)
        return Ramps(self.distance_m, self.speed_m_s, growth, self.acceleration_m_s2)

    @property
    def duration_s(self) -> float:
        return self._ramps.duration_s

    def at(self, elapsed_s: float) -> Motion:
        ramps = self._ramps
        remaining_s = ramps.duration_s - elapsed_s
        if remaining_s <= 0.0:
            return self.target_m, REST, REST
        way, rate, change = ramps.at(max(0.0, elapsed_s), remaining_s)
        distance = ramps.distance_m
        s = self.start_m
        n, e, d = ((t - f) / distance for f, t in zip(s, self.target_m, strict=True))
        position = (s[0] + n * way, s[1] + e * way, s[2] + d * way)
        return position, (n * rate, e * rate, d * rate), (n * change, e * change, d * change)


@dataclass(frozen=True, slots=True)
class CircleProfile:
    """Round a centre at its height, from an angle (clockwise from north, seen from above) through `angle_rad`."""

    centre_m: Vector3
    radius_m: float
    start_rad: float
    angle_rad: float  # positive clockwise
    speed_m_s: float
    acceleration_m_s2: float
    speeding_up_m_s2: float = math.inf

    @property
    def distance_m(self) -> float:
        return abs(self.angle_rad) * self.radius_m

    @property
    def _ramps(self) -> Ramps:
        # v^2 / R sideways within its share of the acceleration
        turning_m_s = math.sqrt(TURNING_SHARE * self.acceleration_m_s2 * self.radius_m)
        braking = SPEEDING_SHARE * self.acceleration_m_s2
        growth = min(braking, self.speeding_up_m_s2)
        return Ramps(self.distance_m, min(self.speed_m_s, turning_m_s), growth, braking)

    @property
    def duration_s(self) -> float:
        return self._ramps.duration_s

    @property
    def target_m(self) -> Vector3:
        return self._place(self.start_rad + self.angle_rad)

    def at(self, elapsed_s: float) -> Motion:
        ramps = self._ramps
        remaining_s = ramps.duration_s - elapsed_s
        if remaining_s <= 0.0:
            return self.target_m, REST, REST
        way, rate, change = ramps.at(max(0.0, elapsed_s), remaining_s)
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


@dataclass(frozen=True, slots=True)
class Chain:
    """One trajectory after the other; each begins where the one before it ends."""

    parts: Sequence[Trajectory]

    @property
    def distance_m(self) -> float:
        return sum(part.distance_m for part in self.parts)

    @property
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
