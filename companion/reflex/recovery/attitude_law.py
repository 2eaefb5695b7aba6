"""The law of the first second: attitude and collective thrust, for each IMU sample, from the companion's own belief.

With position x, velocity v and the acceleration e by the wind, and b the acceleration by the thrust at the tilt of
TILT_AHEAD_S later, horizontally

    a = k (v_o - v) - (b + e) - e,        k = BRAKING_PER_S

v_o is the slowest velocity that leads off each surface by RETURN_PER_S times what will be missing of its clearance
when the thrust has turned, LEAD_S later.
Vertically a_d = h^2 (d_0 - d) - 2 h v_d, h = HEIGHT_RAD_S. What PX4 makes of it, held until it notices that nothing
follows, stays off every half-space (`held_off`). The thrust's axis is along a - g; its size carries the vehicle at the
present tilt.
"""

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace

from companion.messages import AttitudeSetpoint, Quaternion, Vector3
from companion.motion.config import GRAVITY_M_S2
from companion.motion.rotation import body_to_ned
from companion.motion.vector import ZERO, along, flat, limited, minus, plus, unit
from companion.reflex import config as reflex
from companion.reflex.belief.motion_estimator import Belief
from companion.reflex.surface import Surface, projected


@dataclass(frozen=True, slots=True)
class Lean:
    """What makes attitude and thrust of an acceleration."""

    belief: Belief
    surfaces: Sequence[Surface]
    full_m_s2: float  # specific force at full thrust
    held_s: float  # for so long PX4 flies it on, if nothing follows
    most_tilt_rad: float = reflex.MOST_TILT_RAD  # as who flies limits it

    def tilted_by(self, acceleration_ned_m_s2: Vector3) -> "Lean":
        """Of a vehicle that has the tilt of this acceleration already: its thrust is that tilt's."""
        n, e, _ = acceleration_ned_m_s2
        attitude_wxyz = tilted((n, e, -GRAVITY_M_S2), turn_rad(self.belief.attitude_wxyz))
        return replace(self, belief=replace(self.belief, attitude_wxyz=attitude_wxyz))

    def setpoint(self, time_us: int, acceleration_ned_m_s2: Vector3) -> AttitudeSetpoint:
        """As it is sent."""
        attitude_wxyz, thrust = attitude_and_thrust(acceleration_ned_m_s2, self)
        turns_rad_s = self.belief.yaw_rate_rad_s
        # So that no more than BRAKED_RAD_S of the present turn is left to brake.
        kept_rad_s = turns_rad_s - min(max(turns_rad_s, -reflex.BRAKED_RAD_S), reflex.BRAKED_RAD_S)
        return AttitudeSetpoint(time_us, attitude_wxyz, thrust, kept_rad_s)


def wanted(belief: Belief, surfaces: Sequence[Surface], down_m: float) -> Vector3:
    """The acceleration, besides that by wind and drag, that brings the vehicle to rest clear of the surfaces."""
    place, velocity, external = belief.position_ned_m, belief.velocity_ned_m_s, belief.external_m_s2
    v_d = velocity[2]
    near = []
    for one in surfaces:
        off_m = one.off_m(place)
        # What pushes the vehicle goes along with it, and is not left.
        off_m += min(reflex.LEAD_S * _certain_m_s(belief, one.normal_ned), max(off_m, 0.0))
        if off_m < one.distance_m:
            off_m_s = reflex.RETURN_PER_S * (one.distance_m - off_m)
            near.append((one.normal_ned, off_m_s))
            velocity = _certain(velocity, one.normal_ned, belief.spread_m_s, off_m_s)
    off = projected(ZERO, near)
    short, moves = minus(off, velocity), plus(belief.tilt_m_s2, 1.0, external)
    n, e, _ = minus(plus(plus(ZERO, -1.0, external), reflex.BRAKING_PER_S, short), moves)
    climbs = reflex.HEIGHT_RAD_S * (reflex.HEIGHT_RAD_S * (down_m - place[2]) - 2.0 * v_d)
    return (n, e, min(max(climbs, -reflex.MOST_CLIMB_M_S2), reflex.MOST_CLIMB_M_S2))


def held_off(acceleration_ned_m_s2: Vector3, belief: Belief, surfaces: Sequence[Surface], held_s: float) -> Vector3:
    """The acceleration whose speed towards each surface, after `held_s`, can still be braked in front of it."""
    sides = []
    for surface in surfaces:
        speed_m_s = _certain_m_s(belief, surface.normal_ned)
        # The present speed's half of the way until then; the other half is that of the speed then.
        room_m = surface.off_m(belief.position_ned_m) - surface.distance_m + 0.5 * speed_m_s * held_s
        by_wind = along(belief.external_m_s2, surface.normal_ned)
        sides.append((surface.normal_ned, (-brakable_m_s(room_m, 0.5 * held_s) - speed_m_s) / held_s - by_wind))
    return projected(acceleration_ned_m_s2, sides)


def braked(belief: Belief, normal_ned: Vector3, within_s: float) -> Vector3:
    """The level acceleration that ends the speed within a time."""
    return plus(ZERO, -1.0 / within_s, _certain(flat(belief.velocity_ned_m_s), normal_ned, belief.spread_m_s))


def _certain_m_s(belief: Belief, normal: Vector3) -> float:
    """The speed along a normal; away from the surface, what is certain of it."""
    speed_m_s = along(belief.velocity_ned_m_s, normal)
    return speed_m_s - min(max(speed_m_s, 0.0), belief.spread_m_s)


def _certain(velocity_m_s: Vector3, normal: Vector3, spread_m_s: float, off_m_s: float = 0.0) -> Vector3:
    """Of the speed away from a surface, beyond the wanted one, only what is certain is braked."""
    faster_m_s = max(0.0, along(velocity_m_s, normal) - off_m_s)
    return plus(velocity_m_s, -min(faster_m_s, spread_m_s), normal)


def brakable_m_s(room_m: float, later_s: float) -> float:
    """The largest speed s that, braked so much later, ends within the room r: s t + s^2 / 2 a = r."""
    lost_m_s = reflex.BRAKES_M_S2 * later_s
    return math.sqrt(lost_m_s**2 + 2.0 * reflex.BRAKES_M_S2 * max(0.0, room_m)) - lost_m_s


def attitude_and_thrust(acceleration_ned_m_s2: Vector3, lean: Lean) -> tuple[Quaternion, float]:
    """Attitude in the vehicle's own frame, and the collective thrust as a share of the most."""
    belief, full_m_s2, turns_rad_s = lean.belief, lean.full_m_s2, abs(lean.belief.yaw_rate_rad_s)
    # To stay below the top of a fence may take more than gravity, which no upright vehicle has.
    d = min(max(acceleration_ned_m_s2[2], -reflex.MOST_CLIMB_M_S2), reflex.MOST_CLIMB_M_S2)
    lifts_m_s2 = GRAVITY_M_S2 - d
    margin = reflex.TURN_MARGIN if turns_rad_s > reflex.BRAKED_RAD_S else reflex.HOVER_MARGIN
    least_cosine = min(max(math.cos(lean.most_tilt_rad), margin * GRAVITY_M_S2 / full_m_s2), 1.0)
    most_m_s2 = lifts_m_s2 * math.sqrt(1.0 - least_cosine**2) / least_cosine
    # One that turns by more than a radian within its attitude's lag does not get the tilt that is asked for.
    most_m_s2 /= max(1.0, turns_rad_s * reflex.LEAD_S)
    n, e, _ = limited(flat(acceleration_ned_m_s2), most_m_s2)
    thrust = min(max(_thrust_m_s2((n, e, d), lean) / full_m_s2, reflex.LEAST_THRUST), 1.0)
    n, e, d = minus((n, e, -lifts_m_s2), belief.level_m_s2)
    turned_rad = belief.heading_error_rad
    c, s = math.cos(turned_rad), math.sin(turned_rad)
    # No heading is asked for but the vehicle's own: motors that turn it have no thrust left to lift it.
    return tilted((n * c - e * s, n * s + e * c, d), turn_rad(belief.attitude_wxyz) + turned_rad), thrust


def _thrust_m_s2(asked_m_s2: Vector3, lean: Lean) -> float:
    """What carries the vehicle at its tilt; where that leans on a near surface, the part that leads off it."""
    n, e, d = asked_m_s2
    place, up = lean.belief.position_ned_m, body_to_ned(lean.belief.attitude_wxyz, (0.0, 0.0, -1.0))
    # A hit turns it sooner than its motors give less: the tilt by then counts.
    tilt_n, tilt_e, _ = lean.belief.tilt_m_s2
    ahead = unit((tilt_n, tilt_e, -GRAVITY_M_S2))
    near = [one for one in lean.surfaces if one.off_m(place) < one.distance_m and along(ahead, one.normal_ned) < 0.0]
    if not near and -up[2] >= reflex.UPRIGHT_COSINE:
        return (GRAVITY_M_S2 - d) / -up[2]
    # One that lies on a surface does not climb: the thrust for that presses it on.
    lies = any(one.off_m(place) <= 0.0 for one in near)
    thrust_m_s2 = along((n, e, (max(d, 0.0) if lies else d) - GRAVITY_M_S2), ahead if near else up)
    for one in near:
        # What a hit has turned onto it, and is to lean off it, presses by less than tips it over.
        if one.off_m(place) < reflex.PLACE_SPREAD_M and along((n, e, d - GRAVITY_M_S2), one.normal_ned) > 0.0:
            thrust_m_s2 = min(thrust_m_s2, -reflex.HELD_M_S2 / along(ahead, one.normal_ned))
    return thrust_m_s2


def turn_rad(attitude_wxyz: Quaternion) -> float:
    """The turn from north about body z that, after the shortest tilt from level, makes an attitude."""
    w, _, _, z = attitude_wxyz
    return 2.0 * math.atan2(z, w)


def tilted(force_ned: Vector3, yaw_rad: float) -> Quaternion:
    """The shortest tilt from level that has the thrust along a force, with that heading."""
    size = math.hypot(*force_ned)
    n, e, d = (-part / size for part in force_ned)
    w, x, y = 1.0 + d, -e, n
    size, c, s = math.sqrt(w * w + x * x + y * y), math.cos(0.5 * yaw_rad), math.sin(0.5 * yaw_rad)
    return (w * c / size, (x * c + y * s) / size, (y * c - x * s) / size, w * s / size)
