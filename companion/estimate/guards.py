"""Where a guarded vehicle is touched, and what a push there does to it: hypotheses side by side, one a column.

A guard is a hoop; an obstacle with normal n touches it at its rim where the rim faces the obstacle, on the edge that
leans into it. So the push's line of action tells the normal apart from friction's lean: without friction it passes
through the hoop's middle.
"""

import math

import numpy as np
import numpy.typing as npt

from companion.mission.config import GuardsConfig

Floats = npt.NDArray[np.float64]
Ints = npt.NDArray[np.int64]

# Unit vectors of the arms of a quad-x, body FRD.
ARMS_FRD = np.array([[1.0, 1.0, 0.0], [-1.0, -1.0, 0.0], [1.0, -1.0, 0.0], [-1.0, 1.0, 0.0]]) / math.sqrt(2)
# Leaning by this the hoop stands on one edge; less, on both of them in part.
EDGE_LEAN_RAD = 0.1
# A hoop that faces the obstacle by more than 77 degrees has no one place on its rim.
LEAST_SHARE = 0.22
# Of two guards, one that stands back by this much touches first only where the obstacle is narrow.
STANDS_BACK_M, MOST_BACK = 0.02, 6.0


def cross(a: Floats, b: Floats) -> Floats:
    """Of columns; several times faster than numpy's own."""
    return np.stack((a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]))


def foremost(normals_frd: Floats, guards: GuardsConfig) -> tuple[Ints, Floats]:
    """For each normal (3, n): the two guards nearest to the obstacle (n, 2), and how unlikely each is touched first."""
    ahead_m = guards.centre_m * (-normals_frd.T @ ARMS_FRD.T)
    order = np.argsort(-ahead_m, axis=1)[:, :2]
    nearest = np.take_along_axis(ahead_m, order, axis=1)
    return order, np.minimum((nearest[:, :1] - nearest) / STANDS_BACK_M, MOST_BACK)


def touched_at(normals_frd: Floats, guard: Ints, guards: GuardsConfig) -> Floats:
    """Contact points (3, n), body FRD, m, of each normal on its guard, with the arm pressed in a little."""
    against = -normals_frd
    share = np.sqrt(np.maximum(1.0 - against[2] ** 2, LEAST_SHARE**2))
    points = (guards.radius_m / share - guards.give_m) * against
    points[2] += 0.5 * guards.height_m * np.clip(against[2] / EDGE_LEAN_RAD, -1.0, 1.0)
    points[2] -= guards.radius_m / share * against[2]
    placed: Floats = points + guards.centre_m * ARMS_FRD.T[:, guard]
    return placed


def pushed(
    velocity: Floats, rates: Floats, normal: Floats, point: Floats, impulse: Floats, friction: Floats, gyration2: Floats
) -> tuple[Floats, Floats, Floats]:
    """Velocity and rates after a push along the normal, with friction against the sliding; and the whole push.

    All body FRD, columns: m/s, rad/s, m; impulses per unit mass, m/s. Friction gives no more than what ends the sliding
    (Coulomb).
    """
    sliding = velocity + cross(rates, point)
    sliding = sliding - (sliding * normal).sum(axis=0) * normal
    speed = np.sqrt((sliding * sliding).sum(axis=0)) + 1e-6
    along = sliding / speed
    lever = cross(point, along)
    softness = 1.0 + (lever * lever / gyration2).sum(axis=0)
    push = impulse * normal - np.minimum(friction * impulse, speed / softness) * along
    return velocity + push, rates + cross(point, push) / gyration2, push
