"""Which way an obstacle faces: by its normal as it was found or as it pushed, and by where the vehicle came from."""

import math

from companion.estimate.contact_force import ContactForce, unit
from companion.messages import Vector3

# An obstacle's own motion may come from any side; a vehicle faster than this ran into it.
APPROACH_M_S = 0.5
# Cosine of 75 degrees: a clipped push further than that from where the vehicle came from has lost its direction; one
# that was not clipped came from something that moved.
GLANCING = 0.26
# A force no larger than this, found because the rates jumped, is what drag and thrust have become after the contact.
FAINT_M_S2 = 3.0


def final_normal(contact: ContactForce, found_ned: Vector3 | None, velocity_ned_m_s: Vector3) -> Vector3:
    """When the contact is over: as a search found it or it pushed; half way to the way back where that is blurred."""
    normal, back = found_ned or unit(contact.impulse_ned_m_s), _opposite(velocity_ned_m_s)
    if not contact.is_blurred or _is_grazing(normal, back):
        return plausible_normal(contact, normal, velocity_ned_m_s)
    return unit((normal[0] + back[0], normal[1] + back[1], normal[2] + back[2]))


def plausible_normal(contact: ContactForce | None, normal_ned: Vector3, velocity_ned_m_s: Vector3) -> Vector3:
    """The normal; the way back where a push went along the obstacle that clipped, each axis by itself, or that fell
    between the samples."""
    back = _opposite(velocity_ned_m_s)
    is_lost = contact is None or contact.clipped or contact.peak_m_s2 < FAINT_M_S2
    return back if is_lost and _is_grazing(normal_ned, back) else normal_ned


def _opposite(velocity_ned_m_s: Vector3) -> Vector3:
    """Where the vehicle came from, which is known to be free; zero for one that hardly moved."""
    v = velocity_ned_m_s
    return unit((-v[0], -v[1], -v[2])) if math.hypot(*v) > APPROACH_M_S else (0.0, 0.0, 0.0)


def _is_grazing(normal_ned: Vector3, back_ned: Vector3) -> bool:
    """Whether a vehicle that came from there would have met an obstacle with that normal along its surface."""
    return back_ned != (0.0, 0.0, 0.0) and sum(n * b for n, b in zip(normal_ned, back_ned, strict=True)) < GLANCING
