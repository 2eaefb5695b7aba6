"""Ways from the rebound to rest: at once, or gliding there within limits."""

import math
from dataclasses import dataclass
from typing import Protocol

from companion.messages import Vector3

REST: Vector3 = (0.0, 0.0, 0.0)

# How far the thrust's direction lags behind the acceleration asked for: two over an attitude loop of 12 rad/s,
# critically damped, and a motor's 0.02 s. From 0.1 to 0.2 s it changes the overshoot little; 0.25 s doubles it.
LEAD_S = 0.15
# A shorter way is over before the vehicle has leant (0.2 s) both ways, and ends beyond its goal: with 1 s by 5 to 9 cm
# after slow hits in random missions, with this by 4 to 6.
SHORTEST_S = 1.25
# Braking before a fence asks for all there is; in less than the vehicle takes to lean there is nothing to be gained.
HARDEST_S = 0.2
# Cosine of 60 degrees: a goal further aside is not run past but turned to, which brakes cannot hasten.
AHEAD = 0.5
# Durations are tried in steps of a hundredth.
STEP = 1.01


@dataclass(frozen=True, slots=True)
class Motion:
    """What the setpoint asks for; local NED. Without a velocity the vehicle is to stop at the position."""

    position_ned_m: Vector3
    velocity_ned_m_s: Vector3 | None = None
    acceleration_ned_m_s2: Vector3 | None = None


class Way(Protocol):
    """What to ask for when, after it was begun."""

    @property
    def goal_ned_m(self) -> Vector3: ...

    def at(self, elapsed_s: float) -> Motion: ...


@dataclass(frozen=True, slots=True)
class AtOnce:
    """The goal, from the first moment on: the paper's way."""

    goal_ned_m: Vector3

    def at(self, elapsed_s: float) -> Motion:
        return Motion(self.goal_ned_m)


@dataclass(frozen=True, slots=True)
class Glide:
    """From x_0 with velocity v_0 to rest at the goal x_1 after T, without acceleration at either end.

        x(s T) = x_0 + v_0 T (s - s^3 + s^4 / 2) + e (10 s^3 - 15 s^4 + 6 s^5),  e = x_1 - x_0 - v_0 T / 2

    The first part only brakes; the second covers the rest of the way.
    """

    start_ned_m: Vector3
    velocity_ned_m_s: Vector3
    goal_ned_m: Vector3
    duration_s: float

    def at(self, elapsed_s: float) -> Motion:
        total_s = self.duration_s
        if elapsed_s >= total_s:
            return Motion(self.goal_ned_m)
        s = max(0.0, elapsed_s) / total_s
        ahead = min(1.0, s + LEAD_S / total_s)
        axes = zip(self.start_ned_m, self.velocity_ned_m_s, self.goal_ned_m, strict=True)
        (x, u, a), (y, v, b), (z, w, c) = (_axis(x_0, v_0 * total_s, x_1 - x_0, s, ahead) for x_0, v_0, x_1 in axes)
        per, per2 = 1.0 / total_s, 1.0 / total_s**2
        return Motion((x, y, z), (u * per, v * per, w * per), (a * per2, b * per2, c * per2))


def _axis(start: float, drift: float, way: float, s: float, ahead: float) -> tuple[float, float, float]:
    """Position and velocity at s, acceleration ahead of it; per share of the duration. `drift` is v_0 T."""
    rest = way - 0.5 * drift
    position = start + s * drift * (1.0 + s * s * (0.5 * s - 1.0)) + rest * s**3 * (10.0 + s * (6.0 * s - 15.0))
    velocity = drift * (1.0 + s * s * (2.0 * s - 3.0)) + 30.0 * rest * (s * (1.0 - s)) ** 2
    acceleration = ahead * (ahead - 1.0) * (6.0 * drift + 60.0 * rest * (2.0 * ahead - 1.0))
    return position, velocity, acceleration


def glide(start_ned_m: Vector3, velocity_ned_m_s: Vector3, goal_ned_m: Vector3, most_m_s2: float) -> Glide:
    """The shortest glide that nowhere asks for more than `most_m_s2`, never one that runs past its goal.

    A goal too near for both is reached with the brakes it takes: v_0 T <= 2 d keeps the speed above zero all along.
    """
    n, e, d = (goal - start for goal, start in zip(goal_ned_m, start_ned_m, strict=True))
    u, v, w = velocity_ned_m_s
    ahead, speed2 = n * u + e * v + d * w, u * u + v * v + w * w
    is_ahead = ahead > AHEAD * math.sqrt(speed2 * (n * n + e * e + d * d))
    longest_s = max(HARDEST_S, 2.0 * ahead / speed2) if is_ahead else math.inf
    duration_s = SHORTEST_S
    while duration_s < longest_s and most_of((n, e, d), velocity_ned_m_s, duration_s) > most_m_s2:
        duration_s *= STEP
    return Glide(start_ned_m, velocity_ned_m_s, goal_ned_m, min(duration_s, longest_s))


# Where a glide's acceleration is looked at: the first part's is greatest at s = 1/2, the second's at 0.21 and 0.79.
_LOOKED_AT = (0.21, 0.3, 0.4, 0.5, 0.6, 0.7, 0.79)


def most_of(way: Vector3, velocity: Vector3, duration_s: float) -> float:
    """The largest acceleration of a glide over the way, from the velocity to rest."""
    largest = 0.0
    for s in _LOOKED_AT:
        n, e, d = (_axis(0.0, v * duration_s, x, s, s)[2] for v, x in zip(velocity, way, strict=True))
        largest = max(largest, math.sqrt(n * n + e * e + d * d))
    return largest / duration_s**2
