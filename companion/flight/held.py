"""Where a setpoint leads that nothing follows: PX4's loops until it notices, and then its own stop.

A companion that dies sends nothing more. PX4 flies its last setpoint on for COM_OF_LOSS_T, on each axis by

    x'' = k_v (v_s + k_x (x_s - x) - x') + a_s,    k_x: MPC_XY_P, MPC_Z_P,    k_v: MPC_XY_VEL_P_ACC, MPC_Z_VEL_P_ACC

of which what is not asked for falls away: of a lean all but a_s, where the vehicle knows how it leans (see envelope).
"""

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from functools import cache

from companion.flight.context import Target
from companion.memory.patch import Patch
from companion.memory.surroundings import LEAST_FREE_M
from companion.messages import Vector3
from companion.reflex import config
from companion.reflex.config import BEHIND_M
from companion.reflex.halfspace import Surface, plus
from companion.reflex.planner import Moving

LOSS_PARAMETER = "COM_OF_LOSS_T"
# PX4's defaults: COM_OF_LOSS_T, then the gains of north, east and down.
HELD_S = 1.0
PLACE_PER_S = (config.PLACE_PER_S, config.PLACE_PER_S, config.HEIGHT_PER_S)
VELOCITY_PER_S = (config.VELOCITY_PER_S, config.VELOCITY_PER_S, config.CLIMB_GAIN_PER_S)
# PX4 notices the silence late: with 1 s set, a real one went into hold after 1.04 to 1.13 s (docs/px4.md).
NOTICED_S = 0.13
# PX4's own modes brake with it by default: MPC_ACC_HOR, MPC_ACC_DOWN_MAX.
BRAKES_M_S2 = 3.0
# After a lean PX4 brings to rest what its estimate says, which is wrong. After a hit at 2 m/s it was right again within
# 0.4 s with the parameters of `rebound airframe px4`, within 1.5 s with PX4's own (docs/px4.md).
REPAIRED_S = 1.5
# At a rebound of 1 m/s a look every 0.2 m.
_TIMES_S = tuple((HELD_S + NOTICED_S) * look / 6 for look in range(1, 7))


@dataclass(frozen=True, slots=True)
class Known:
    """A surface that is known, local NED. Of a patch: in its own coordinates, how far it goes, and for whom."""

    surface: Surface
    patch: Patch | None = None
    origin_ned_m: Vector3 = (0.0, 0.0, 0.0)
    reach_m: float = 0.0

    def free_m(self, way: Sequence[Vector3], place_ned_m: Vector3) -> float:
        """How much further off the way stays than it must; below 0 it leads too near.

        It must stay off by the clearance, or by what the vehicle now and the place it is to be at leave of it. Behind
        it nothing is in the way.
        """
        offs_m = [self.surface.off_m(place) for place in way]
        if min(offs_m) >= self.surface.distance_m or offs_m[0] < -BEHIND_M:
            return 0.0
        must_m = min(self.surface.distance_m, offs_m[0], self.surface.off_m(place_ned_m))
        beside = [o - must_m for o, place in zip(offs_m, way, strict=True) if self._is_there(o, must_m, place)]
        return min([0.0, *beside])

    def _is_there(self, off_m: float, must_m: float, place_ned_m: Vector3) -> bool:
        """Whether a place that is too near is so beside what is known of the surface, and not past its end."""
        if self.patch is None:
            return True
        before = plus(place_ned_m, max(0.0, must_m - off_m), self.surface.normal_ned)
        n, e, d = (p - o for p, o in zip(before, self.origin_ned_m, strict=True))
        return self.patch.faces((n, e, d), self.reach_m)


def unattended_text(speed_m_s: float) -> str:
    """What a companion that dies leaves behind, for people."""
    return (
        f"if the companion dies, PX4 flies its last setpoint on for COM_OF_LOSS_T, made safe for {HELD_S:g} s; "
        f"every second more is {speed_m_s:g} m unattended at {speed_m_s:g} m/s"
    )


def longer_loss_text(loss_s: float) -> str:
    """One that is longer than a setpoint is safe, for people."""
    return (
        f"COM_OF_LOSS_T is {loss_s:g} s: if the companion dies, PX4 flies its last setpoint on for "
        f"{loss_s - HELD_S:g} s more than it is made safe for"
    )


def touched(place_ned_m: Vector3, normal_ned: Vector3) -> Surface:
    """What a vehicle touched whose centre was there, and how far off a held setpoint is to lead it."""
    return Surface(place_ned_m, normal_ned, LEAST_FREE_M)


def held_way(target: Target, motion: Moving) -> list[Vector3]:
    """Places that a vehicle which moves so passes, the present one first, the last where it stops.

    The motion's own acceleration comes to that of a lean.
    """
    axes = []
    for axis in range(3):
        place_m, speed_m_s = motion.position_ned_m[axis], motion.velocity_ned_m_s[axis]
        axes.append([place_m, *_led(axis, place_m, speed_m_s, *_asked(target, motion, axis))])
    return [(n, e, d) for n, e, d in zip(*axes, strict=True)]


def _asked(target: Target, motion: Moving, axis: int) -> tuple[float | None, float | None, float]:
    """Place, velocity and acceleration on one axis; None where it is not asked for."""
    velocity, acceleration = target.velocity_ned_m_s, target.acceleration_ned_m_s2
    a_s = 0.0 if acceleration is None else acceleration[axis]
    v_s = None if velocity is None else velocity[axis]
    if not target.leans_only:
        return target.position_ned_m[axis], v_s, a_s
    if axis < 2:
        return None, None, a_s + motion.acceleration_ned_m_s2[axis]
    return None if target.is_height_free else target.position_ned_m[2], v_s, a_s


def _led(axis: int, x: float, v: float, x_s: float | None, v_s: float | None, a_s: float) -> Iterator[float]:
    """Of one axis: at each time, and stopped."""
    k_x, off_m = (0.0, 0.0) if x_s is None else (PLACE_PER_S[axis], x_s - x)
    leans = x_s is None and v_s is None
    k_v = 0.0 if leans else VELOCITY_PER_S[axis]
    asked_m_s2, way, after_m_s = k_v * ((v_s or 0.0) + k_x * off_m) + a_s, x, v
    for by_asked, by_speed, left in _answers(k_x, k_v):
        way, after_m_s = x + by_asked * asked_m_s2 + by_speed * v, by_speed * asked_m_s2 + left * v
        yield way
    yield way + after_m_s * (REPAIRED_S if leans else 0.5 * abs(after_m_s) / BRAKES_M_S2)


@cache
def _answers(k_x: float, k_v: float) -> Sequence[tuple[float, float, float]]:
    """At each time what an acceleration asked for makes of the way, the same of a speed, and what is left of that."""
    half, stiff = 0.5 * k_v, k_v * k_x
    turn, found = math.sqrt(max(0.0, stiff - half * half)), list[tuple[float, float, float]]()
    for time_s in _TIMES_S:
        left, cosine = math.exp(-half * time_s), math.cos(turn * time_s)
        sine = math.sin(turn * time_s) / turn if turn else time_s
        if stiff:
            found.append(((1.0 - left * (cosine + half * sine)) / stiff, left * sine, left * (cosine - half * sine)))
        elif k_v:
            fades_s = (1.0 - math.exp(-k_v * time_s)) / k_v
            found.append(((time_s - fades_s) / k_v, fades_s, 1.0 - k_v * fades_s))
        else:
            found.append((0.5 * time_s**2, time_s, 1.0))
    return found
