"""What an obstacle covers of the ground, seen from above."""

import itertools
import math

import numpy as np
import numpy.typing as npt
from scipy.spatial import ConvexHull, QhullError

from sim_vehicle.world import Box, Obstacle, Pole

Floats = npt.NDArray[np.float64]

_ROUND_CORNERS = 24


def footprint(obstacle: Obstacle) -> Floats:
    """Corners (n, 2) of its outline, north and east, world coordinates, where it stands at first."""
    if isinstance(obstacle, Pole):
        points = np.concatenate([_ring(end, obstacle.radius_m) for end in obstacle.ends()])
    else:
        points = _corners(obstacle if isinstance(obstacle, Box) else obstacle.box())
    try:
        hull: Floats = points[ConvexHull(points).vertices]
    except QhullError:
        # thinner than can be told from a line
        return points
    return hull


def _ring(centre_ned_m: Floats, radius_m: float) -> Floats:
    angles = np.arange(_ROUND_CORNERS) * math.tau / _ROUND_CORNERS
    return centre_ned_m[:2] + radius_m * np.column_stack([np.cos(angles), np.sin(angles)])


def _corners(box: Box) -> Floats:
    halves = 0.5 * np.array(box.sizes_m)
    signs = np.array(list(itertools.product((-1.0, 1.0), repeat=3)))
    corners: Floats = np.array(box.centre_ned_m) + (signs * halves) @ np.array(box.axes_ned)
    return corners[:, :2]
