"""What an obstacle covers of the ground, seen from above."""

import itertools

import numpy as np
import numpy.typing as npt
from shapely import MultiPoint, get_coordinates

from sim_vehicle.world import Box, Obstacle, Pole

Floats = npt.NDArray[np.float64]


def footprint(obstacle: Obstacle) -> Floats:
    """Corners (n, 2) of its outline, north and east, world coordinates, where it stands at first."""
    if isinstance(obstacle, Pole):
        ends_ne_m = [end[:2] for end in obstacle.ends()]
        outline = MultiPoint(ends_ne_m).convex_hull.buffer(obstacle.radius_m)
    else:
        outline = MultiPoint(_corners(obstacle if isinstance(obstacle, Box) else obstacle.box())).convex_hull
    corners: Floats = get_coordinates(outline)
    return corners


def _corners(box: Box) -> Floats:
    halves = 0.5 * np.array(box.sizes_m)
    signs = np.array(list(itertools.product((-1.0, 1.0), repeat=3)))
    corners: Floats = np.array(box.centre_ned_m) + (signs * halves) @ np.array(box.axes_ned)
    return corners[:, :2]
