"""The obstacle's normal, from the course of the push: friction leans it against the way the contact slides.

Coulomb friction tilts each part of the impulse from the normal by up to atan(mu), against the sliding. How the contact
slides follows from v_c, what the impulse has changed it by, and the turning: s = t . v - l a . w for a contact l from
the centre, in the plane about a. But t, the tangent, hangs on the normal that is sought: so every normal near the push
and every friction up to 0.3 is tried, and each counts by how well it explains the tilt of all parts.

The plane is that of the push and the approach; where the two nearly agree, the horizontal one, in which a vehicle that
is hit beside its centre is turned.
"""

import math
from collections.abc import Sequence

import numpy as np
import numpy.typing as npt

from companion.messages import Vector3

# Part of the impulse (m/s), body rates (rad/s) during it and the impulse before it (m/s), all NED.
Part = tuple[Vector3, Vector3, Vector3]

# Guards of plastic on a painted wall have 0.3; the normal is then at most 17 degrees from the push.
FRICTIONS = np.linspace(0.0, 0.3, 7)
TRIED_RAD = np.radians(np.arange(-20.0, 20.5, 1.0))
# v_c is good to 0.05 m/s: below twice that the direction of sliding says little.
SLIDING_M_S = 0.1
# How far a right normal and friction may leave the parts: 3.5 degrees, the scatter of a sample's direction.
SCATTER_RAD = 0.06
# Weak wish for an ordinary friction, as a share of squared angle: decides where the push says nothing.
USUAL_FRICTION, WISH = 0.12, 0.05
# No part is further off than this: a last, weak sample must not outvote the strong ones.
MOST_RAD = 0.3
# Push and approach nearer to one line than 12 degrees (sine) span no plane that noise would not turn.
LEAST_SINE = 0.2
# Steeper pushes are from above or below.
STEEP = 0.7
DOWN = np.array([0.0, 0.0, 1.0])

Floats = npt.NDArray[np.float64]


def normal_of(parts: Sequence[Part], velocity_ned_m_s: Vector3, reach_m: float) -> Vector3:
    """Unit vector out of the obstacle, NED; zero where nothing pushed. `velocity_ned_m_s` is v_c."""
    pushes = np.array([part for part, _, _ in parts]).reshape(-1, 3)
    push = pushes.sum(axis=0)
    size = float(np.linalg.norm(push))
    if size == 0.0:
        return (0.0, 0.0, 0.0)
    velocity = np.array(velocity_ned_m_s)
    axis = np.cross(push, velocity)
    sine = float(np.linalg.norm(axis)) / max(size * float(np.linalg.norm(velocity)), 1e-9)
    if sine < LEAST_SINE and abs(push[2]) > STEEP * size:
        n, e, d = push / size
        return (float(n), float(e), float(d))
    axis = DOWN if sine < LEAST_SINE else axis / np.linalg.norm(axis)
    along = push - (push @ axis) * axis
    ahead = along / np.linalg.norm(along)
    aside = np.cross(axis, ahead)
    rates = np.array([rate for _, rate, _ in parts])
    velocities = velocity + np.array([before for _, _, before in parts]) + 0.5 * pushes
    plane = np.stack([ahead, aside], axis=1)
    lean = _lean_rad(pushes @ plane, velocities @ plane, reach_m * (rates @ axis))
    normal = np.linalg.norm(along) * (math.cos(lean) * ahead + math.sin(lean) * aside) + (push @ axis) * axis
    n, e, d = normal / size
    return (float(n), float(e), float(d))


def _lean_rad(pushes: Floats, velocities: Floats, turning_m_s: Floats) -> float:
    """How far the normal is turned from the push, in the plane: the mean of all, by how well they explain.

    ``pushes`` and ``velocities`` (parts, 2) along the push and aside; ``turning_m_s`` (parts,) of the contact point.
    """
    weights = np.linalg.norm(pushes, axis=1)
    normals = TRIED_RAD[:, None]
    sliding_m_s = velocities[:, 1] * np.cos(normals) - velocities[:, 0] * np.sin(normals) - turning_m_s
    way = np.clip(sliding_m_s / SLIDING_M_S, -1.0, 1.0)
    turned = np.arctan2(pushes[:, 1], pushes[:, 0]) - normals
    leans = (turned + np.pi) % (2.0 * np.pi) - np.pi
    angles = np.arctan(FRICTIONS)[:, None, None]
    misfit = np.minimum((leans + angles * way) ** 2, MOST_RAD**2) @ weights / weights.sum()
    misfit += WISH * (angles[:, :, 0] - math.atan(USUAL_FRICTION)) ** 2
    likely = np.exp((misfit.min() - misfit) / SCATTER_RAD**2).sum(axis=0)
    return float(likely @ TRIED_RAD / likely.sum())
