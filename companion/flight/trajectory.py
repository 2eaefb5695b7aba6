"""Straight lines with a trapezoidal speed: accelerate, cruise, brake."""

import math
from dataclasses import dataclass

from companion.messages import Vector3

REST: Vector3 = (0.0, 0.0, 0.0)


@dataclass(frozen=True, slots=True)
class LineProfile:
    """From rest at `start` to rest at `target`, never faster than `speed`, never changing faster than
    `acceleration`. Any frame, SI units."""

    start_m: Vector3
    target_m: Vector3
    speed_m_s: float
    acceleration_m_s2: float

    @property
    def distance_m(self) -> float:
        return math.dist(self.start_m, self.target_m)

    @property
    def top_speed_m_s(self) -> float:
        """The cruise speed, or what a line too short for it allows."""
        return min(self.speed_m_s, math.sqrt(self.distance_m * self.acceleration_m_s2))

    @property
    def duration_s(self) -> float:
        top = self.top_speed_m_s
        return self.distance_m / top + top / self.acceleration_m_s2 if top > 0.0 else 0.0

    def at(self, elapsed_s: float) -> tuple[Vector3, Vector3, Vector3]:
        """Position, velocity and acceleration; before the start at rest there, after the end at the target."""
        remaining_s = self.duration_s - elapsed_s
        if remaining_s <= 0.0:
            return self.target_m, REST, REST
        way, rate, change = self._along(max(0.0, elapsed_s), remaining_s)
        distance = self.distance_m
        s = self.start_m
        n, e, d = ((t - f) / distance for f, t in zip(s, self.target_m, strict=True))
        position = (s[0] + n * way, s[1] + e * way, s[2] + d * way)
        return position, (n * rate, e * rate, d * rate), (n * change, e * change, d * change)

    def _along(self, elapsed_s: float, remaining_s: float) -> tuple[float, float, float]:
        """Distance covered, speed and acceleration."""
        top, acceleration = self.top_speed_m_s, self.acceleration_m_s2
        ramp_s = top / acceleration
        if elapsed_s < ramp_s:
            return 0.5 * acceleration * elapsed_s**2, acceleration * elapsed_s, acceleration
        if remaining_s < ramp_s:
            return self.distance_m - 0.5 * acceleration * remaining_s**2, acceleration * remaining_s, -acceleration
        return 0.5 * acceleration * ramp_s**2 + top * (elapsed_s - ramp_s), top, 0.0
