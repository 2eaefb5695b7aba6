"""What was touched, from the push's direction, the motion before it and what the flight was about."""

import math

from companion.detection.interface import ImpactKind, Situation
from companion.messages import Vector3

# A vehicle slower than this did not run into anything: the obstacle came to it. Six times the noise of a good estimate.
HOVER_M_S = 0.2
# Push within 45 degrees of the vertical: from a ceiling or a floor.
STEEP = 0.7
# An estimate of the height drifts by this much in a flight by barometer or satellites.
GROUND_M = 1.0
# Turn for each m/s of impulse: lever over the squared radius of gyration, 0.04 m / 0.004 m^2 for the paper's vehicle.
TURN_RAD_S_PER_M_S = 10.0


def hovers(velocity_ned_m_s: Vector3 | None) -> bool:
    """Whether a vehicle with this velocity is too slow to have run into anything; not where it is unknown."""
    return velocity_ned_m_s is not None and math.hypot(*velocity_ned_m_s) < HOVER_M_S


def kind_of(
    impulse_ned_m_s: Vector3, velocity_ned_m_s: Vector3 | None, turn_rad_s: float, situation: Situation
) -> ImpactKind:
    """By direction and circumstances alone: no magnitude of the push decides, so that none can be mistaken.

    Touching the ground at the end of a commanded descent is a landing however hard it is; the same push without a
    descent having been asked for is a strike. `turn_rad_s` is by how much the contact changed the rates.
    """
    push = impulse_ned_m_s
    size = math.sqrt(push[0] ** 2 + push[1] ** 2 + push[2] ** 2)
    up = -push[2] / size if size > 0.0 else 0.0
    height_m = situation.height_m
    near_ground = height_m is None or height_m < GROUND_M
    if situation.descent_commanded and (near_ground or up > STEEP):
        return ImpactKind.LANDING
    is_hovering = hovers(velocity_ned_m_s)
    if up > STEEP:
        return ImpactKind.STRUCK if is_hovering and not near_ground else ImpactKind.FLOOR
    if is_hovering:
        return ImpactKind.STRUCK
    if up < -STEEP:
        return ImpactKind.CEILING
    return ImpactKind.OFF_CENTRE if turn_rad_s > TURN_RAD_S_PER_M_S * size else ImpactKind.WALL
