"""The obstacle's normal from the fit, the contact force, and the direction that the vehicle came from."""

import math

from companion.estimate.contact_force import ContactForce, unit
from companion.messages import Vector3

# A vehicle faster than this ran into the obstacle. A slower one may have been struck from any side.
APPROACH_M_S = 0.5
# Cosine of 75 degrees between the force and the direction that the vehicle came from. Beyond it a clipped force has no
# reliable direction; one that was not clipped is that of a moving obstacle.
GLANCING = 0.26
# A smaller force, detected by a jump of the rates, is a change of drag and thrust after the contact.
FAINT_M_S2 = 3.0


def final_normal(contact: ContactForce, found_ned: Vector3 | None, velocity_ned_m_s: Vector3) -> Vector3:
    """Unit normal after the contact: the fitted one or the impulse's direction.

    A blurred impulse is averaged with the direction that the vehicle came from.
    """
    normal, back = found_ned or unit(contact.impulse_ned_m_s), _opposite(velocity_ned_m_s)
    if not contact.is_blurred or _is_grazing(normal, back):
        return plausible_normal(contact, normal, velocity_ned_m_s)
    return unit((normal[0] + back[0], normal[1] + back[1], normal[2] + back[2]))


def plausible_normal(contact: ContactForce | None, normal_ned: Vector3, velocity_ned_m_s: Vector3) -> Vector3:
    """The normal; or the direction that the vehicle came from, where the force is lost or clipped and grazes that."""
    back = _opposite(velocity_ned_m_s)
    is_lost = contact is None or contact.clipped or contact.peak_m_s2 < FAINT_M_S2
    return back if is_lost and _is_grazing(normal_ned, back) else normal_ned


def _opposite(velocity_ned_m_s: Vector3) -> Vector3:
    """Unit direction that the vehicle came from, which is free; zero for a slow vehicle."""
    v = velocity_ned_m_s
    return unit((-v[0], -v[1], -v[2])) if math.hypot(*v) > APPROACH_M_S else (0.0, 0.0, 0.0)


def _is_grazing(normal_ned: Vector3, back_ned: Vector3) -> bool:
    """Whether a vehicle from that direction would have moved along a surface with this normal."""
    return back_ned != (0.0, 0.0, 0.0) and sum(n * b for n, b in zip(normal_ned, back_ned, strict=True)) < GLANCING
