"""The safety envelope: every setpoint passes through it before it is sent.

It bounds position, step, velocity, acceleration, tilt and yaw. It also bounds where the setpoint leads when no other
follows it: off known surfaces, inside the fence, between floor and top. That is one projection onto half-spaces, of a
position, of a velocity beside it, and of the acceleration that is flown by attitude.
"""

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace

from companion.autopilot.interface import Autopilot
from companion.fence import Fence
from companion.flight.context import Target
from companion.memory.patch import Patch
from companion.messages import Vector3
from companion.mission.policy import SetpointLimits
from companion.motion.config import GRAVITY_M_S2
from companion.motion.vector import ZERO, along, limited, minus, plus, towards
from companion.reflex.config import BEHIND_M, BRAKES_M_S2, HELD_S, NOTICED_S
from companion.reflex.recovery.attitude_law import brakable_m_s, held_off
from companion.reflex.surface import Surface, projected


@dataclass(frozen=True, slots=True)
class KnownSurface:
    """A surface that is known, local NED. Of a patch: in its own coordinates, how far it goes, and for whom."""

    surface: Surface
    patch: Patch | None = None
    origin_ned_m: Vector3 = (0.0, 0.0, 0.0)
    reach_m: float = 0.0

    def is_ahead(self, start_ned_m: Vector3, end_ned_m: Vector3) -> bool:
        """Whether it is in the way: the start is not behind it, and start or end is in front of it, within its ends."""
        if self.surface.off_m(start_ned_m) < -BEHIND_M:
            return False
        return self.patch is None or any(self._faces(self.patch, place) for place in (start_ned_m, end_ned_m))

    def _faces(self, patch: Patch, place_ned_m: Vector3) -> bool:
        """Whether the patch lies behind that place, or where it is too near, behind the place that is not."""
        short_m = max(0.0, self.surface.distance_m - self.surface.off_m(place_ned_m))
        return patch.faces(minus(plus(place_ned_m, short_m, self.surface.normal_ned), self.origin_ned_m), self.reach_m)


def unattended_text(autopilot: Autopilot) -> str:
    """What happens when the companion dies, for people."""
    flown_on = f"if the companion dies, {autopilot.name} flies its last setpoint on for {autopilot.loss_parameter}"
    return f"{flown_on}, made safe for {HELD_S:g} s"


def longer_loss_text(autopilot: Autopilot, loss_s: float) -> str:
    """Of a vehicle that flies it on for longer."""
    return f"{unattended_text(autopilot)}; it is {loss_s:g} s, {loss_s - HELD_S:g} s more than that"


# A place is moved only by more than what rounding to MAVLink's single precision would.
_ROUNDING_M = 1e-5


class SetpointError(Exception):
    """A setpoint with a value that is not finite: a fault of this program."""


@dataclass(frozen=True, slots=True)
class Surroundings:
    """What the envelope is measured from; local NED."""

    vehicle_ned_m: Vector3 | None
    origin_ned_m: Vector3 | None  # None before arming
    has_floor: bool  # the fence's; without it the ground at the origin counts, as while climbing from it
    # The place that was sent before. None where the flight has turned to something else, as after a hit: there alone
    # may the setpoint jump.
    last_ned_m: Vector3 | None = None
    since_last_s: float = 0.0
    held_s: float = HELD_S + NOTICED_S  # for so long PX4 flies on with what nothing follows
    known: Sequence[KnownSurface] = ()


def bounded(target: Target, around: Surroundings, fence: Fence, limits: SetpointLimits) -> tuple[Target, str]:
    """The setpoint as it may be sent, and which limits changed it, for people; "" for none.

    A place that is moved loses its velocity and acceleration: the vehicle stops there. The fence has the last word.
    Raises SetpointError for a setpoint with a value that is not finite.
    """
    if not is_finite(target):
        raise SetpointError(f"a value of the setpoint is not finite: {target}")
    if target.lean is not None:
        return _with_lean(target, around, fence, limits), ""
    reasons: list[str] = []
    target = _with_place(target, around, fence, limits, reasons)
    target = _with_velocity(target, limits, reasons)
    target = _with_acceleration(target, limits, reasons)
    target = _with_lead(target, around, fence, reasons)
    if target.yaw_rad is not None and abs(target.yaw_rad) > math.pi:
        target = replace(target, yaw_rad=math.remainder(target.yaw_rad, math.tau))
    return target, ", ".join(reasons)


def is_finite(target: Target) -> bool:
    values = [*target.position_ned_m, *(target.velocity_ned_m_s or ()), *(target.acceleration_ned_m_s2 or ())]
    if target.lean is not None:
        belief = target.lean.belief
        values += (*belief.attitude_wxyz, *belief.level_m_s2, belief.yaw_rate_rad_s, belief.heading_error_rad)
    return all(map(math.isfinite, (*values, target.yaw_rad or 0.0)))


def _with_place(
    target: Target, around: Surroundings, fence: Fence, limits: SetpointLimits, reasons: list[str]
) -> Target:
    """The place in front of what is known, within the step and the fence."""
    place, vehicle = target.position_ned_m, around.vehicle_ned_m
    # One that does not move is where a recovery or an item has it on purpose.
    if vehicle is not None and target.velocity_ned_m_s is not None:
        ahead = [one.surface for one in around.known if one.is_ahead(vehicle, place)]
        # As near as the vehicle itself is.
        place = projected(place, [(one.normal_ned, min(one.level_m, along(vehicle, one.normal_ned))) for one in ahead])
        reasons += ["too near to what is known"] if place is not target.position_ned_m else []
    farthest_m = limits.max_speed_m_s * around.since_last_s + _ROUNDING_M
    steps = (
        (around.last_ned_m, farthest_m, f"moves faster than {limits.max_speed_m_s:g} m/s"),
        (vehicle, limits.max_step_m, f"more than {limits.max_step_m:g} m from the vehicle"),
    )
    for start, most_m, reason in steps:
        if start is not None and (distance_m := math.dist(place, start)) > most_m:
            place = towards(start, place, most_m / distance_m)
            reasons.append(reason)
    if around.origin_ned_m is not None:
        inside = _within_fence(place, around.origin_ned_m, fence, around.has_floor)
        if math.dist(inside, place) > _ROUNDING_M:
            place = inside
            reasons.append("outside the fence")
    return target if place == target.position_ned_m else Target(place, target.yaw_rad)


def _with_velocity(target: Target, limits: SetpointLimits, reasons: list[str]) -> Target:
    """A velocity that is too fast, in its own direction; the acceleration that leads to it is left out."""
    velocity, most_m_s = target.velocity_ned_m_s, limits.max_speed_m_s
    if velocity is None or math.hypot(*velocity) <= most_m_s:
        return target
    reasons.append(f"velocity above {most_m_s:g} m/s")
    return replace(target, velocity_ned_m_s=limited(velocity, most_m_s), acceleration_ned_m_s2=None)


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


def _with_lead(target: Target, around: Surroundings, fence: Fence, reasons: list[str]) -> Target:
    """Without what of velocity and acceleration leads, held, too near to what is known."""
    velocity, acceleration, here = target.velocity_ned_m_s or ZERO, target.acceleration_ned_m_s2, around.vehicle_ned_m
    fastest = plus(velocity, around.held_s, acceleration or ZERO)
    if here is None or velocity == fastest == ZERO:
        return target
    place = target.position_ned_m
    sides = []
    for surface in _ahead(around, fence, here, plus(place, around.held_s, fastest)):
        room_m = min(surface.off_m(here), surface.off_m(place)) - surface.distance_m
        sides.append((surface.normal_ned, -brakable_m_s(room_m, around.held_s)))
    if _is_inside(velocity, sides) and _is_inside(fastest, sides):
        return target
    reasons.append("leads too near to what is known, or out of the fence")
    if target.velocity_ned_m_s is not None and not _is_inside(velocity, sides):
        velocity = projected(velocity, sides)
        target = replace(target, velocity_ned_m_s=velocity if _is_inside(velocity, sides) else ZERO)
    return replace(target, acceleration_ned_m_s2=None)


def _is_inside(vector: Vector3, sides: Sequence[tuple[Vector3, float]]) -> bool:
    return all(along(vector, normal) >= least - _ROUNDING_M for normal, least in sides)


def _with_lean(target: Target, around: Surroundings, fence: Fence, limits: SetpointLimits) -> Target:
    """The acceleration, held until PX4 notices a silence, stays off surfaces, fence, floor and top."""
    lean, acceleration = target.lean, target.acceleration_ned_m_s2
    assert lean is not None and acceleration is not None, "a lean is one of an acceleration"
    belief, most_tilt_rad = lean.belief, math.radians(limits.max_tilt_deg)
    if most_tilt_rad < lean.most_tilt_rad:
        lean = replace(lean, most_tilt_rad=most_tilt_rad)
    ends_m_s = plus(belief.velocity_ned_m_s, lean.held_s, plus(acceleration, 1.0, belief.external_m_s2))
    ends = plus(belief.position_ned_m, 0.5 * lean.held_s, plus(belief.velocity_ned_m_s, 1.0, ends_m_s))
    stops = plus(ends, 0.5 * math.hypot(*ends_m_s) / BRAKES_M_S2, ends_m_s)
    surfaces = _ahead(around, fence, belief.position_ned_m, stops)
    return replace(target, acceleration_ned_m_s2=held_off(acceleration, belief, surfaces, lean.held_s), lean=lean)


def _ahead(around: Surroundings, fence: Fence, start: Vector3, end: Vector3) -> list[Surface]:
    """What is in the way from start to end: known surfaces, top and floor, and the fence where the end is outside."""
    surfaces = [one.surface for one in around.known if one.is_ahead(start, end)]
    origin = around.origin_ned_m
    if origin is None:
        return surfaces
    top_m, floor_m = _heights(origin, fence, around.has_floor)
    surfaces.append(Surface((0.0, 0.0, top_m), (0.0, 0.0, 1.0), 0.0))
    surfaces.append(Surface((0.0, 0.0, floor_m), (0.0, 0.0, -1.0), 0.0))
    north_m, east_m, _ = minus(end, origin)
    inside_n, inside_e = fence.nearest_inside(north_m, east_m)
    beyond_m = math.dist((inside_n, inside_e), (north_m, east_m))
    if beyond_m > _ROUNDING_M and fence.contains(start[0] - origin[0], start[1] - origin[1]):
        normal = ((inside_n - north_m) / beyond_m, (inside_e - east_m) / beyond_m, 0.0)
        surfaces.append(Surface((origin[0] + inside_n, origin[1] + inside_e, 0.0), normal, 0.0))
    return surfaces


def _within_fence(place: Vector3, origin: Vector3, fence: Fence, has_floor: bool) -> Vector3:
    north_m, east_m = fence.nearest_inside(place[0] - origin[0], place[1] - origin[1])
    top_m, floor_m = _heights(origin, fence, has_floor)
    return (origin[0] + north_m, origin[1] + east_m, min(max(place[2], top_m), floor_m))


def _heights(origin: Vector3, fence: Fence, has_floor: bool) -> tuple[float, float]:
    """The fence's top and its floor, or the ground's, as down of the local frame."""
    return origin[2] - fence.max_height_m, origin[2] - (fence.min_height_m if has_floor else 0.0)
