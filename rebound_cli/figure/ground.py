"""What stands on the ground, seen from above."""

import itertools
from collections.abc import Sequence
from typing import Any

import numpy as np
import numpy.typing as npt
from matplotlib.patches import Polygon
from shapely import MultiPoint, get_coordinates

from companion.memory.patch import Patch
from companion.memory.shape import outline
from sim_vehicle.scene import Scene
from sim_vehicle.world import Box, Obstacle, Pole

Floats = npt.NDArray[np.float64]

OBSTACLE = "tab:brown"
REMEMBERED = "tab:purple"


def footprint(obstacle: Obstacle) -> Floats:
    """Corners (n, 2) of its outline, north and east, world coordinates, where it stands at first."""
    if isinstance(obstacle, Pole):
        shape = MultiPoint([end[:2] for end in obstacle.ends()]).convex_hull.buffer(obstacle.radius_m)
    else:
        box = obstacle if isinstance(obstacle, Box) else obstacle.box()
        signs = np.array(list(itertools.product((-1.0, 1.0), repeat=3)))
        places = np.array(box.centre_ned_m) + (signs * 0.5 * np.array(box.sizes_m)) @ np.array(box.axes_ned)
        shape = MultiPoint(places[:, :2]).convex_hull
    corners: Floats = get_coordinates(shape)
    return corners


def draw_obstacles(axis: Any, scene: Scene, origin_ned_m: Floats, label: str, alpha: float) -> None:
    """Where they stand at first, about the origin."""
    for number, (_, obstacle) in enumerate(scene.obstacles()):
        corners = (footprint(obstacle) - origin_ned_m[:2])[:, ::-1]
        said = label if number == 0 else None
        axis.add_patch(Polygon(corners, facecolor=OBSTACLE, edgecolor=OBSTACLE, alpha=alpha, label=said))


def draw_patches(axis: Any, patches: Sequence[Patch]) -> None:
    """What is believed of the surroundings, and where it was touched; mission coordinates."""
    for number, patch in enumerate(patches):
        label = "remembered" if number == 0 else None
        corners = np.array(outline(patch))[:, ::-1]
        axis.add_patch(Polygon(corners, fill=False, hatch="////", edgecolor=REMEMBERED, linewidth=1.0, label=label))
        touched = np.array(patch.touches_ned_m)
        axis.plot(touched[:, 1], touched[:, 0], ".", color=REMEMBERED, markersize=5)
