"""The safety envelope: every setpoint passes through it on its way out, whoever asked for it."""

import math
from dataclasses import dataclass, replace

from companion.flight.context import Target
from companion.messages import Vector3
from companion.mission.fence import Fence
from companion.mission.policy import Limits

# A place is moved only by more than what rounding to MAVLink's single precision would.
_ROUNDING_M = 1e-5


@dataclass(frozen=True, slots=True)
class Surroundings:
    """What the envelope is measured from; local NED. No origin before arming, no floor while climbing from it.

    `last_ned_m`, the place sent `since_last_s` ago, is None where the flight has turned to something else, as after
    a hit: there alone may the setpoint jump.
    """

    vehicle_ned_m: Vector3 | None
    origin_ned_m: Vector3 | None
    has_floor: bool
    last_ned_m: Vector3 | None = None
    since_last_s: float = 0.0


def bounded(target: Target, around: Surroundings, fence: Fence, limits: Limits) -> tuple[Target, str]:
    """The setpoint as it may be sent, and which limits changed it, for people; "" for none.

    A place that is moved loses its velocity and acceleration: the vehicle stops there. The fence has the last word.
    """
    place, reasons = target.position_ned_m, []
    if around.last_ned_m is not None:
        most_m = limits.max_speed_m_s * around.since_last_s + _ROUNDING_M
        place, is_fast = _within_step(place, around.last_ned_m, most_m)
        reasons += [f"moves faster than {limits.max_speed_m_s:g} m/s"] if is_fast else []
    if around.vehicle_ned_m is not None:
        place, is_far = _within_step(place, around.vehicle_ned_m, limits.max_step_m)
        reasons += [f"more than {limits.max_step_m:g} m from the vehicle"] if is_far else []
    if around.origin_ned_m is not None:
        inside = _within_fence(place, around.origin_ned_m, fence, around.has_floor)
        reasons += ["outside the fence"] if math.dist(inside, place) > _ROUNDING_M else []
        place = inside if math.dist(inside, place) > _ROUNDING_M else place
    if place != target.position_ned_m:
        target = Target(place, target.yaw_rad)
    speed_m_s = 0.0 if target.velocity_ned_m_s is None else math.hypot(*target.velocity_ned_m_s)
    if target.velocity_ned_m_s is not None and speed_m_s > limits.max_speed_m_s:
        scale = limits.max_speed_m_s / speed_m_s
        n, e, d = target.velocity_ned_m_s
        slower = (n * scale, e * scale, d * scale)
        target = replace(target, velocity_ned_m_s=slower, acceleration_ned_m_s2=None)
        reasons.append(f"velocity above {limits.max_speed_m_s:g} m/s")
    return target, ", ".join(reasons)


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
    down_m = max(place[2] - origin[2], -fence.max_height_m)
    if has_floor:
        down_m = min(down_m, -fence.min_height_m)
    return (origin[0] + north_m, origin[1] + east_m, origin[2] + down_m)
