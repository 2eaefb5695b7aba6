"""The obstacle's normal, from the course of the push: friction leans it against the way the contact slides.

Coulomb friction tilts each part of the impulse from the normal by up to atan(mu), against the sliding. How the contact
slides follows from v_c, what the impulse has changed it by, and the turning: s = t . v - l r for a contact l from the
centre and a yaw rate r. But t, the tangent, hangs on the normal that is sought: so every normal near the push and every
friction up to 0.3 is tried, and each counts by how well it explains the tilt of all parts. Horizontal; a push that is
steep keeps its own direction.
"""

import math
from collections.abc import Sequence

import numpy as np

from companion.messages import Vector3

# Part of the impulse (m/s), yaw rate (rad/s, about down) during it and the impulse before it (m/s), all NED.
Part = tuple[Vector3, float, Vector3]

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
# Steeper pushes are from above or below.
STEEP = 0.7


def normal_of(parts: Sequence[Part], velocity_ned_m_s: Vector3, reach_m: float) -> Vector3:
    """Unit vector out of the obstacle, NED; zero where nothing pushed. `velocity_ned_m_s` is v_c."""
    n, e, d = (sum(part[axis] for part, _, _ in parts) for axis in range(3))
    flat, size = math.hypot(n, e), math.sqrt(n * n + e * e + d * d)
    if size == 0.0:
        return (0.0, 0.0, 0.0)
    if abs(d) > STEEP * size:
        return (n / size, e / size, d / size)
    direction = math.atan2(e, n) + _lean_rad(parts, velocity_ned_m_s, reach_m, math.atan2(e, n))
    return (flat / size * math.cos(direction), flat / size * math.sin(direction), d / size)


def _lean_rad(parts: Sequence[Part], velocity_ned_m_s: Vector3, reach_m: float, push_rad: float) -> float:
    """How far the normal is turned from the push, clockwise from above: the mean of all, by how well they explain."""
    pushes = np.array([part[:2] for part, _, _ in parts])
    yaw_rates = np.array([rate for _, rate, _ in parts])
    velocities = np.array([before[:2] for _, _, before in parts]) + 0.5 * pushes + velocity_ned_m_s[:2]
    weights = np.hypot(pushes[:, 0], pushes[:, 1])
    normals = push_rad + TRIED_RAD[:, None]
    sliding_m_s = velocities[:, 1] * np.cos(normals) - velocities[:, 0] * np.sin(normals) - reach_m * yaw_rates
    way = np.clip(sliding_m_s / SLIDING_M_S, -1.0, 1.0)
    turned = np.arctan2(pushes[:, 1], pushes[:, 0]) - normals
    leans = (turned + np.pi) % (2.0 * np.pi) - np.pi
    angles = np.arctan(FRICTIONS)[:, None, None]
    misfit = np.minimum((leans + angles * way) ** 2, MOST_RAD**2) @ weights / weights.sum()
    misfit += WISH * (angles[:, :, 0] - math.atan(USUAL_FRICTION)) ** 2
    likely = np.exp((misfit.min() - misfit) / SCATTER_RAD**2).sum(axis=0)
    return float(likely @ TRIED_RAD / likely.sum())
