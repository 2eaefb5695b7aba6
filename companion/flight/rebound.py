"""The motion that follows a contact: what of it can be the hit's doing, and what it says of the obstacle."""

import math
from collections.abc import Sequence

from companion.detection.classify import HOVER_M_S
from companion.estimate.approach import VelocityFix
from companion.flight.collision import horizontal_unit
from companion.flight.context import FlightContext
from companion.messages import Vector3
from companion.recovery.climb import Climb
from companion.recovery.direction import away_from
from companion.recovery.interface import Contact, RecoveryLaw
from companion.recovery.way import REST

# Long enough for two velocities of the slowest stream.
LEFT_US = 50_000
# A velocity that changed by less has no direction that 0.08 s of flight and noise could not have made.
TELLING_CHANGE_M_S = 1.0
# Cosine of 30 degrees: friction leans a push by 17, and the estimate of the normal is good to ten.
AGREEING = 0.87
# Of a steady flight the speed up or down is known better by what was asked than by one estimate, four times its noise.
AS_ASKED_M_S = 0.12
# A guard that comes along the obstacle faster than this slides on it, and what the rates say of a throw is not so.
LEVEL_M_S = 0.3


def way_back(velocity_ned_m_s: Vector3) -> Vector3:
    """Where a vehicle that flew with this velocity came from; zero for one that hovered."""
    n, e, _ = velocity_ned_m_s
    return horizontal_unit((-n, -e, 0.0)) if math.hypot(n, e) >= HOVER_M_S else (0.0, 0.0, 0.0)


def agreed_normal(pushed_ned: Vector3, before_ned_m_s: Vector3, after_ned_m_s: Vector3) -> Vector3:
    """The normal by the push, or by what it did to the velocity where the two do not agree.

    The push of a contact of a millisecond is one sample, shaken and clipped; the change of velocity is all of it.
    """
    change = tuple(b - a for a, b in zip(before_ned_m_s, after_ned_m_s, strict=True))
    size = math.hypot(*change)
    moved = away_from((change[0], change[1], change[2]))
    if size < TELLING_CHANGE_M_S or sum(p * m for p, m in zip(pushed_ned, moved, strict=True)) > AGREEING:
        return pushed_ned
    return moved


def lean_left(fixes: Sequence[VelocityFix], boot_us: int) -> Vector3:
    """The horizontal acceleration of a vehicle that nothing pushes, of the last moments before a time; NED, m/s^2."""
    recent = [fix for fix in fixes if boot_us - LEFT_US <= fix.time_boot_us <= boot_us]
    if not recent or recent[0].time_boot_us == recent[-1].time_boot_us:
        return REST
    first, last = recent[0], recent[-1]
    per_s = 1e6 / (last.time_boot_us - first.time_boot_us)
    (n, e, _), (u, v, _) = first.sum_ned_m_s, last.sum_ned_m_s
    return (per_s * (u - n), per_s * (v - e), 0.0)


def climb_of(
    flight: FlightContext, law: RecoveryLaw, contact: Contact, hit_boot_us: int, free_until_boot_us: int
) -> Climb:
    """How the vehicle moves up or down from a contact on; 0 m/s^2 upwards where nothing holds the height after it."""
    mission = flight.mission
    is_upright = law.is_refined and law.holds_height and contact.normal_ned[2] == 0.0
    asked = flight.target.velocity_ned_m_s if flight.target is not None else None
    asked_m_s, speed_m_s = (asked or REST)[2], contact.velocity_ned_m_s[2]
    if abs(speed_m_s - asked_m_s) < AS_ASKED_M_S:
        speed_m_s = asked_m_s
    is_upright &= abs(speed_m_s) < LEVEL_M_S
    return Climb(
        hit_boot_us=hit_boot_us,
        free_until_boot_us=free_until_boot_us,
        velocity_ned_m_s=contact.velocity_ned_m_s,
        guards=mission.companion.estimate.guards,
        upwards_m_s2=mission.recovery.vertical_acceleration_m_s2 if is_upright else 0.0,
        speed_m_s=speed_m_s,
        height_down_m=contact.position_ned_m[2],
    )
