"""Ways from the rebound to rest: at once, or gliding there within limits."""

import math
from dataclasses import dataclass
from typing import Protocol

from companion.messages import Vector3

REST: Vector3 = (0.0, 0.0, 0.0)

# How far the thrust's direction lags behind the acceleration asked for: two over an attitude loop of 12 rad/s,
# critically damped, and a motor's 0.02 s. From 0.1 to 0.2 s it changes the overshoot little; 0.25 s doubles it.
LEAD_S = 0.15
# PX4's velocity loop takes back a share of the acceleration that it measures (MPC_XY_VEL_D_ACC: 0.2, for the simulated
# vehicle 0.1). Without as much more the brakes are too weak, and ways end 2 to 3 cm beyond; with 1.2, 2 cm short.
DAMPED = 1.1
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


def damped(motion: Motion) -> Vector3 | None:
    """The acceleration to send along with a velocity so that the vehicle has the motion's."""
    if motion.acceleration_ned_m_s2 is None:
        return None
    n, e, d = motion.acceleration_ned_m_s2
    return (DAMPED * n, DAMPED * e, d)


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
    """From x_0 with velocity v_0 and acceleration a_0 to rest at the goal x_1 after T.

        x(s T) = x_0 + v_0 T (s - s^3 + s^4 / 2) + a_0 T^2 (s^2 / 2 - 2 s^3 / 3 + s^4 / 4)
                 + e (10 s^3 - 15 s^4 + 6 s^5),          e = x_1 - x_0 - v_0 T / 2 - a_0 T^2 / 12

    The first part only brakes, the second takes back the lean there is; the last covers the rest of the way.
    """

    start_ned_m: Vector3
    velocity_ned_m_s: Vector3
    acceleration_ned_m_s2: Vector3
    goal_ned_m: Vector3
    duration_s: float

    def at(self, elapsed_s: float) -> Motion:
        total_s = self.duration_s
        if elapsed_s >= total_s:
            return Motion(self.goal_ned_m)
        s = max(0.0, elapsed_s) / total_s
        ahead = min(1.0, s + LEAD_S / total_s)
        axes = zip(self.start_ned_m, self.velocity_ned_m_s, self.acceleration_ned_m_s2, self.goal_ned_m, strict=True)
        (x, u, a), (y, v, b), (z, w, c) = (
            _axis(x_0, v_0 * total_s, a_0 * total_s**2, x_1 - x_0, s, ahead) for x_0, v_0, a_0, x_1 in axes
        )
        per, per2 = 1.0 / total_s, 1.0 / total_s**2
        return Motion((x, y, z), (u * per, v * per, w * per), (a * per2, b * per2, c * per2))


def _axis(start: float, drift: float, lean: float, way: float, s: float, ahead: float) -> tuple[float, float, float]:
    """Position, velocity at s, acceleration ahead of it, per share of the duration. `drift`: v_0 T, `lean`: a_0 T^2."""
    rest = way - 0.5 * drift - lean / 12.0
    position = start + s * drift * (1.0 + s * s * (0.5 * s - 1.0)) + rest * s**3 * (10.0 + s * (6.0 * s - 15.0))
    position += lean * s * s * (0.5 + s * (0.25 * s - 2.0 / 3.0))
    velocity = drift * (1.0 + s * s * (2.0 * s - 3.0)) + (lean * s + 30.0 * rest * s * s) * (1.0 - s) ** 2
    acceleration = ahead * (ahead - 1.0) * (6.0 * drift + 60.0 * rest * (2.0 * ahead - 1.0))
    return position, velocity, acceleration + lean * (1.0 - ahead) * (1.0 - 3.0 * ahead)


def glide(
    start_ned_m: Vector3, velocity_ned_m_s: Vector3, leant_ned_m_s2: Vector3, goal_ned_m: Vector3, most_m_s2: float
) -> Glide:
    """The shortest glide that nowhere asks for more than `most_m_s2`, never one that runs past its goal.

    A goal too near for both is reached with the brakes it takes: e >= 0 along the velocity keeps the speed above zero.
    """
    n, e, d = (goal - start for goal, start in zip(goal_ned_m, start_ned_m, strict=True))
    u, v, w = velocity_ned_m_s
    a, b, c = leant_ned_m_s2
    ahead, speed2 = n * u + e * v + d * w, u * u + v * v + w * w
    longest_s = math.inf
    if ahead > AHEAD * math.sqrt(speed2 * (n * n + e * e + d * d)):
        stops2 = 0.25 * speed2**2 + ahead * (a * u + b * v + c * w) / 3.0
        if stops2 >= 0.0:
            longest_s = max(HARDEST_S, 2.0 * ahead / (0.5 * speed2 + math.sqrt(stops2)))
    duration_s = SHORTEST_S
    while duration_s < longest_s and most_of((n, e, d), velocity_ned_m_s, leant_ned_m_s2, duration_s) > most_m_s2:
        duration_s *= STEP
    return Glide(start_ned_m, velocity_ned_m_s, leant_ned_m_s2, goal_ned_m, min(duration_s, longest_s))


# Where a glide's acceleration is looked at: the first part's is greatest at s = 1/2, the second's at 0.21 and 0.79.
_LOOKED_AT = (0.21, 0.3, 0.4, 0.5, 0.6, 0.7, 0.79)


def most_of(way: Vector3, velocity: Vector3, leant: Vector3, duration_s: float) -> float:
    """The largest acceleration of a glide over the way, from the velocity and the acceleration to rest."""
    largest = 0.0
    for s in _LOOKED_AT:
        axes = zip(velocity, leant, way, strict=True)
        n, e, d = (_axis(0.0, v * duration_s, a * duration_s**2, x, s, s)[2] for v, a, x in axes)
        largest = max(largest, math.sqrt(n * n + e * e + d * d))
    return largest / duration_s**2
