"""The safety envelope: every setpoint passes through it before it is sent.

It bounds position, step, velocity, acceleration, tilt and yaw. It also bounds where the setpoint leads when no other
follows it: off known surfaces, inside the fence, between floor and top. There an acceleration a beside a velocity v
ends, by PX4's velocity loop, at v + a / MPC_Z_VEL_P_ACC. That velocity beside a height ends, by PX4's height loop, at v
/ MPC_Z_P from it.
"""

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from functools import cache

from companion.fence import Fence
from companion.flight.context import Target
from companion.memory.patch import Patch
from companion.memory.surroundings import LEAST_FREE_M
from companion.messages import Vector3
from companion.mission.policy import SetpointLimits
from companion.motion.config import GRAVITY_M_S2
from companion.reflex.attitude_law import held_off
from companion.reflex.config import (
    BEHIND_M,
    BRAKES_M_S2,
    CLIMB_GAIN_PER_S,
    HEIGHT_PER_S,
    HELD_S,
    NOTICED_S,
    PLACE_PER_S,
    VELOCITY_PER_S,
)
from companion.reflex.halfspace import Surface, plus, split
from companion.reflex.laws import MotionState

LOSS_PARAMETER = "COM_OF_LOSS_T"
# PX4's gains of north, east and down.
PLACE_GAINS_PER_S = (PLACE_PER_S, PLACE_PER_S, HEIGHT_PER_S)
VELOCITY_GAINS_PER_S = (VELOCITY_PER_S, VELOCITY_PER_S, CLIMB_GAIN_PER_S)
# At a rebound of 1 m/s a look every 0.2 m.
_TIMES_S = tuple((HELD_S + NOTICED_S) * look / 6 for look in range(1, 7))


@dataclass(frozen=True, slots=True)
class KnownSurface:
    """A surface that is known, local NED. Of a patch: in its own coordinates, how far it goes, and for whom."""

    surface: Surface
    patch: Patch | None = None
    origin_ned_m: Vector3 = (0.0, 0.0, 0.0)
    reach_m: float = 0.0

    def free_m(self, path: Sequence[Vector3], place_ned_m: Vector3) -> float:
        """Clearance of the path beyond what it must keep, m; below 0 it comes too near.

        It must stay off by the clearance, or by what the vehicle now and the place it is to be at leave of it. Behind
        it nothing is in the way.
        """
        offs_m = [self.surface.off_m(place) for place in path]
        if min(offs_m) >= self.surface.distance_m or offs_m[0] < -BEHIND_M:
            return 0.0
        must_m = min(self.surface.distance_m, offs_m[0], self.surface.off_m(place_ned_m))
        beside = [o - must_m for o, place in zip(offs_m, path, strict=True) if self._is_there(o, must_m, place)]
        return min([0.0, *beside])

    def is_before(self, place_ned_m: Vector3) -> bool:
        """Whether a vehicle there is in front of it."""
        off_m = self.surface.off_m(place_ned_m)
        return off_m >= -BEHIND_M and self._is_there(off_m, self.surface.distance_m, place_ned_m)

    def _is_there(self, off_m: float, must_m: float, place_ned_m: Vector3) -> bool:
        """Whether a place that is too near lies in front of the surface, and not past its end."""
        if self.patch is None:
            return True
        before = plus(place_ned_m, max(0.0, must_m - off_m), self.surface.normal_ned)
        n, e, d = (p - o for p, o in zip(before, self.origin_ned_m, strict=True))
        return self.patch.faces((n, e, d), self.reach_m)


def unattended_text(speed_m_s: float) -> str:
    """What happens when the companion dies, for people."""
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
    """The surface that a vehicle with its centre there touched, and the clearance of a held setpoint."""
    return Surface(place_ned_m, normal_ned, LEAST_FREE_M)


def held_path(target: Target, motion: MotionState) -> list[Vector3]:
    """Places that a vehicle which moves so passes, the present one first, the last where it stops."""
    axes = []
    for axis in range(3):
        place_m, speed_m_s = motion.position_ned_m[axis], motion.velocity_ned_m_s[axis]
        axes.append([place_m, *_led(axis, place_m, speed_m_s, *_asked(target, axis))])
    return [(n, e, d) for n, e, d in zip(*axes, strict=True)]


def _asked(target: Target, axis: int) -> tuple[float, float, float]:
    """Place, velocity and acceleration on one axis."""
    velocity, acceleration = target.velocity_ned_m_s, target.acceleration_ned_m_s2
    v_s = 0.0 if velocity is None else velocity[axis]
    return target.position_ned_m[axis], v_s, 0.0 if acceleration is None else acceleration[axis]


def _led(axis: int, x: float, v: float, x_s: float, v_s: float, a_s: float) -> list[float]:
    """Of one axis: at each time, and stopped."""
    k_x, k_v = PLACE_GAINS_PER_S[axis], VELOCITY_GAINS_PER_S[axis]
    asked_m_s2, answers = k_v * (v_s + k_x * (x_s - x)) + a_s, _answers(k_x, k_v)
    path = [x + by_asked * asked_m_s2 + by_speed * v for by_asked, by_speed, _ in answers]
    _, by_speed, left = answers[-1]
    after_m_s = by_speed * asked_m_s2 + left * v
    return [*path, path[-1] + 0.5 * after_m_s * abs(after_m_s) / BRAKES_M_S2]


@cache
def _answers(k_x: float, k_v: float) -> Sequence[tuple[float, float, float]]:
    """At each time what an acceleration asked for makes of the way, the same of a speed, and what is left of that."""
    half, stiff = 0.5 * k_v, k_v * k_x
    turn, found = math.sqrt(max(0.0, stiff - half * half)), list[tuple[float, float, float]]()
    for time_s in _TIMES_S:
        left, cosine = math.exp(-half * time_s), math.cos(turn * time_s)
        sine = math.sin(turn * time_s) / turn if turn else time_s
        found.append(((1.0 - left * (cosine + half * sine)) / stiff, left * sine, left * (cosine - half * sine)))
    return found


# A place is moved only by more than what rounding to MAVLink's single precision would.
_ROUNDING_M = 1e-5
# How far from a height a velocity beside it leads within HELD_S, over that velocity.
_LEADS_S = (1.0 - math.exp(-HEIGHT_PER_S * HELD_S)) / HEIGHT_PER_S
# What is taken from a setpoint is found by halving: to 3 %.
_HALVINGS = 5


class SetpointError(Exception):
    """A setpoint with a value that is not finite: a fault of this program."""


@dataclass(frozen=True, slots=True)
class Surroundings:
    """What the envelope is measured from; local NED. No origin before arming.

    `has_floor`: the fence's floor counts; without it the ground at the origin does, as while climbing from it.
    `last_ned_m`, the place sent `since_last_s` ago, is None where the flight has turned to something else, as after
    a hit: there alone may the setpoint jump.
    """

    vehicle_ned_m: Vector3 | None
    origin_ned_m: Vector3 | None
    has_floor: bool
    last_ned_m: Vector3 | None = None
    since_last_s: float = 0.0
    velocity_ned_m_s: Vector3 | None = None
    known: Sequence[KnownSurface] = ()


def bounded(target: Target, around: Surroundings, fence: Fence, limits: SetpointLimits) -> tuple[Target, str]:
    """The setpoint as it may be sent, and which limits changed it, for people; "" for none.

    A place that is moved loses its velocity and acceleration: the vehicle stops there. The fence has the last word.
    Raises SetpointError for a setpoint with a value that is not finite.
    """
    if not is_finite(target):
        raise SetpointError(f"a value of the setpoint is not finite: {target}")
    if target.lean is not None:
        return _with_lean(target, around, fence), ""
    reasons: list[str] = []
    target = _with_place(target, around, fence, limits, reasons)
    target = _with_velocity(target, limits, reasons)
    target = _with_acceleration(target, limits, reasons)
    target = _with_path(target, around, fence, reasons)
    target = _with_height(target, around, fence, reasons)
    target = _with_acceleration(target, limits, [])
    if target.yaw_rad is not None and abs(target.yaw_rad) > math.pi:
        target = replace(target, yaw_rad=math.remainder(target.yaw_rad, math.tau))
    return target, ", ".join(reasons)


def is_finite(target: Target) -> bool:
    """Whether every number of the setpoint is."""
    parts = (target.position_ned_m, target.velocity_ned_m_s or (), target.acceleration_ned_m_s2 or ())
    values = [value for part in parts for value in part]
    return all(map(math.isfinite, values)) and (target.yaw_rad is None or math.isfinite(target.yaw_rad))


def _with_place(
    target: Target, around: Surroundings, fence: Fence, limits: SetpointLimits, reasons: list[str]
) -> Target:
    """The place within the step and the fence."""
    place, vehicle = target.position_ned_m, around.vehicle_ned_m
    asked = place
    if around.last_ned_m is not None:
        most_m = limits.max_speed_m_s * around.since_last_s + _ROUNDING_M
        place, is_fast = _within_step(place, around.last_ned_m, most_m)
        reasons += [f"moves faster than {limits.max_speed_m_s:g} m/s"] if is_fast else []
    if vehicle is not None:
        place, is_far = _within_step(place, vehicle, limits.max_step_m)
        reasons += [f"more than {limits.max_step_m:g} m from the vehicle"] if is_far else []
    if around.origin_ned_m is not None:
        inside = _within_fence(place, around.origin_ned_m, fence, around.has_floor)
        reasons += ["outside the fence"] if math.dist(inside, place) > _ROUNDING_M else []
        place = inside if math.dist(inside, place) > _ROUNDING_M else place
    if place == asked:
        return target
    return Target(place, target.yaw_rad)


def _with_velocity(target: Target, limits: SetpointLimits, reasons: list[str]) -> Target:
    """A velocity that is too fast, in its own direction; the acceleration that leads to it is left out."""
    velocity, most_m_s = target.velocity_ned_m_s, limits.max_speed_m_s
    if velocity is None or math.hypot(*velocity) <= most_m_s:
        return target
    reasons.append(f"velocity above {most_m_s:g} m/s")
    scale = most_m_s / math.hypot(*velocity)
    n, e, d = velocity
    return replace(target, velocity_ned_m_s=(n * scale, e * scale, d * scale), acceleration_ned_m_s2=None)


def _with_acceleration(target: Target, limits: SetpointLimits, reasons: list[str]) -> Target:
    """Sideways what the tilt allows in hover; down what gravity gives, and as much up."""
    if target.acceleration_ned_m_s2 is None:
        return target
    n, e, d = target.acceleration_ned_m_s2
    most_m_s2, sideways_m_s2 = GRAVITY_M_S2 * math.tan(math.radians(limits.max_tilt_deg)), math.hypot(n, e)
    if sideways_m_s2 > most_m_s2:
        reasons.append(f"tilt above {limits.max_tilt_deg:g} degrees")
        n, e = n * most_m_s2 / sideways_m_s2, e * most_m_s2 / sideways_m_s2
    if abs(d) > GRAVITY_M_S2:
        reasons.append("acceleration up or down above gravity's")
        d = math.copysign(GRAVITY_M_S2, d)
    return replace(target, acceleration_ned_m_s2=(n, e, d))


def _with_path(target: Target, around: Surroundings, fence: Fence, reasons: list[str]) -> Target:
    """What of velocity and acceleration leads, held, out of the fence or too near to what is known, taken away.

    Where that is not enough the place alone is left, or the vehicle's level attitude, if that leads less far.
    """
    if around.vehicle_ned_m is None or around.velocity_ned_m_s is None:
        return target
    if target.velocity_ned_m_s is None and target.acceleration_ned_m_s2 is None:
        return target
    motion = MotionState(around.vehicle_ned_m, around.velocity_ned_m_s)
    known = [*around.known, *_sides(held_path(target, motion), around.origin_ned_m, fence)]

    def free_m(candidate: Target, surfaces: Sequence[KnownSurface] = known) -> float:
        path = held_path(candidate, motion)
        return min((one.free_m(path, candidate.position_ned_m) for one in surfaces), default=0.0)

    asked = target
    for surface in known:
        if free_m(target, [surface]) < 0.0:
            target = _off(target, surface, free_m)
    if target is asked:
        return asked
    reasons.append("leads too near to what is known, or out of the fence")
    return max(target, target.at_rest(), asked, key=free_m)


def _with_lean(target: Target, around: Surroundings, fence: Fence) -> Target:
    """The acceleration, held until PX4 notices a silence, stays off surfaces, fence, floor and top."""
    lean, acceleration = target.lean, target.acceleration_ned_m_s2
    assert lean is not None and acceleration is not None, "a lean is one of an acceleration"
    belief, origin = lean.belief, around.origin_ned_m
    surfaces = [one.surface for one in around.known if one.is_before(belief.position_ned_m)]
    if origin is not None:
        top_m, floor_m = _heights(origin, fence, around.has_floor)
        surfaces += [
            Surface((0.0, 0.0, top_m), (0.0, 0.0, 1.0), 0.0),
            Surface((0.0, 0.0, floor_m), (0.0, 0.0, -1.0), 0.0),
        ]
        ends_m_s = plus(belief.velocity_ned_m_s, lean.held_s, plus(acceleration, 1.0, belief.external_m_s2))
        ends = plus(belief.position_ned_m, 0.5 * lean.held_s, plus(belief.velocity_ned_m_s, 1.0, ends_m_s))
        stops = plus(ends, 0.5 * math.hypot(*ends_m_s) / BRAKES_M_S2, ends_m_s)
        surfaces += [one.surface for one in _sides([belief.position_ned_m, stops], origin, fence)]
    return replace(target, acceleration_ned_m_s2=held_off(acceleration, belief, surfaces, lean.held_s))


def _off(target: Target, known: KnownSurface, free_m: Callable[[Target, Sequence[KnownSurface]], float]) -> Target:
    """With as little as possible taken from what leads towards one surface; all of it where that is not enough."""
    least, most = 0.0, 1.0
    for _ in range(_HALVINGS):
        share = 0.5 * (least + most)
        is_free = free_m(_less(target, known.surface.normal_ned, share), [known]) >= 0.0
        least, most = (least, share) if is_free else (share, most)
    return _less(target, known.surface.normal_ned, most)


def _less(target: Target, normal: Vector3, share: float) -> Target:
    """With a share taken from what of velocity and acceleration leads towards a surface."""

    def less(vector: Vector3 | None) -> Vector3 | None:
        return None if vector is None else plus(vector, -share * min(0.0, split(vector, normal)[0]), normal)

    velocity, acceleration = less(target.velocity_ned_m_s), less(target.acceleration_ned_m_s2)
    return replace(target, velocity_ned_m_s=velocity, acceleration_ned_m_s2=acceleration)


def _sides(path: Sequence[Vector3], origin: Vector3 | None, fence: Fence) -> list[KnownSurface]:
    """The fence as a surface, where a way that begins inside leaves it the furthest."""
    if origin is None:
        return []
    places = [(n - origin[0], e - origin[1]) for n, e, _ in path]
    if not fence.contains(*places[0]):
        return []
    furthest_m, sides = 0.0, list[KnownSurface]()
    for place in places[1:]:
        inside = fence.nearest_inside(*place)
        beyond_m = math.dist(inside, place)
        if beyond_m > furthest_m + _ROUNDING_M:
            furthest_m, normal = beyond_m, ((inside[0] - place[0]) / beyond_m, (inside[1] - place[1]) / beyond_m, 0.0)
            sides = [KnownSurface(Surface((origin[0] + inside[0], origin[1] + inside[1], 0.0), normal, 0.0))]
    return sides


def _with_height(target: Target, around: Surroundings, fence: Fence, reasons: list[str]) -> Target:
    """Velocity and acceleration up and down, so that they lead neither below the floor nor out of the top."""
    velocity, acceleration = target.velocity_ned_m_s, target.acceleration_ned_m_s2
    if around.origin_ned_m is None or (velocity is None and acceleration is None):
        return target
    top_m, floor_m = _heights(around.origin_ned_m, fence, around.has_floor)
    least_m_s = min(0.0, (top_m - target.position_ned_m[2]) / _LEADS_S)
    most_m_s = max(0.0, (floor_m - target.position_ned_m[2]) / _LEADS_S)
    down_m_s = 0.0 if velocity is None else velocity[2]
    down_m_s2 = 0.0 if acceleration is None else acceleration[2]
    leads_m_s = down_m_s + down_m_s2 / CLIMB_GAIN_PER_S
    if least_m_s <= leads_m_s <= most_m_s:
        return target
    reasons.append("leads below the floor" if leads_m_s > most_m_s else "leads out of the top")
    if velocity is not None:
        down_m_s = min(max(down_m_s, least_m_s), most_m_s)
        velocity = (velocity[0], velocity[1], down_m_s)
    if acceleration is not None:
        room = (CLIMB_GAIN_PER_S * (least_m_s - down_m_s), CLIMB_GAIN_PER_S * (most_m_s - down_m_s))
        acceleration = (acceleration[0], acceleration[1], min(max(down_m_s2, room[0]), room[1]))
    return replace(target, velocity_ned_m_s=velocity, acceleration_ned_m_s2=acceleration)


def _within_step(place: Vector3, start: Vector3, most_m: float) -> tuple[Vector3, bool]:
    """The place, or where the way from the start to it is `most_m` long; and whether that is shorter."""
    distance_m = math.dist(place, start)
    if distance_m <= most_m:
        return place, False
    scale = most_m / distance_m
    n, e, d = (s + scale * (p - s) for p, s in zip(place, start, strict=True))
    return (n, e, d), True


def _within_fence(place: Vector3, origin: Vector3, fence: Fence, has_floor: bool) -> Vector3:
    north_m, east_m = fence.nearest_inside(place[0] - origin[0], place[1] - origin[1])
    top_m, floor_m = _heights(origin, fence, has_floor)
    return (origin[0] + north_m, origin[1] + east_m, min(max(place[2], top_m), floor_m))


def _heights(origin: Vector3, fence: Fence, has_floor: bool) -> tuple[float, float]:
    """The fence's top and its floor, or the ground's, as down of the local frame."""
    return origin[2] - fence.max_height_m, origin[2] - (fence.min_height_m if has_floor else 0.0)
