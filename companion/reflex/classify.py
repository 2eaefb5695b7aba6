"""The kind of an impact, from the contact force's direction, the motion before it and the flight's situation."""

import math

from companion.messages import Vector3
from companion.motion.config import SAME_M_S
from companion.reflex.config import GROUND_M, STEEP
from companion.reflex.detector import ImpactKind, Situation


def hovers(velocity_ned_m_s: Vector3 | None) -> bool:
    """Whether the velocity is known, and too small to have run into anything: the obstacle came to the vehicle."""
    return velocity_ned_m_s is not None and math.hypot(*velocity_ned_m_s) < SAME_M_S


def kind_of(force_ned: Vector3, velocity_ned_m_s: Vector3 | None, situation: Situation) -> ImpactKind:
    """The kind by direction and situation alone; the size of the force has no influence.

    Contact with the ground at the end of a commanded descent is a landing, however hard. The same force without a
    commanded descent is a strike.
    """
    size = math.hypot(*force_ned)
    up = -force_ned[2] / size if size > 0.0 else 0.0
    height_m = situation.height_m
    near_ground = height_m is None or height_m < GROUND_M
    if situation.descent_commanded and (near_ground or up > STEEP):
        return ImpactKind.LANDING
    is_hovering = hovers(velocity_ned_m_s)
    if up > STEEP:
        return ImpactKind.STRUCK if is_hovering and not near_ground else ImpactKind.FLOOR
    if is_hovering:
        return ImpactKind.STRUCK
    return ImpactKind.CEILING if up < -STEEP else ImpactKind.WALL
