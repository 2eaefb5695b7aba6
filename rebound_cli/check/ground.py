"""What stands on the ground, seen from above."""

import itertools
from collections.abc import Sequence
from itertools import pairwise
from typing import Any

import numpy as np
import numpy.typing as npt
from matplotlib.patches import Polygon
from shapely import MultiPoint, get_coordinates

from companion.memory.patch import Patch
from companion.memory.surroundings import outline
from sim_vehicle.scene import Scene
from sim_vehicle.world import Obstacle, Pole

Floats = npt.NDArray[np.float64]

OBSTACLE = "tab:brown"
REMEMBERED = "tab:purple"


def footprint(obstacle: Obstacle) -> Floats:
    """Corners (n, 2) of its outline, north and east, world coordinates, where it stands at first."""
    if isinstance(obstacle, Pole):
        shape = MultiPoint([end[:2] for end in obstacle.ends()]).convex_hull.buffer(obstacle.radius_m)
    else:
        signs = np.array(list(itertools.product((-1.0, 1.0), repeat=3)))
        corners_m = signs * 0.5 * np.array(obstacle.sizes_m)
        places = np.array(obstacle.centre_ned_m) + corners_m @ np.array(obstacle.axes_ned)
        shape = MultiPoint(places[:, :2]).convex_hull
    corners: Floats = get_coordinates(shape)
    return corners


def draw_obstacles(axis: Any, scene: Scene, origin_ned_m: Floats, label: str, alpha: float) -> None:
    """Where they stand at first, about the origin; and of those that move the way, with times of the boot clock."""
    for number, (_, obstacle) in enumerate(scene.obstacles()):
        corners = (footprint(obstacle) - origin_ned_m[:2])[:, ::-1]
        said = label if number == 0 else None
        motion = obstacle.motion
        moved = np.zeros((1, 2)) if motion is None else np.array(motion.offsets_ned_m)[:, 1::-1]
        style: Any = {"facecolor": OBSTACLE, "edgecolor": OBSTACLE}
        axis.add_patch(Polygon(corners + moved[0], alpha=alpha, label=said, **style))
        if motion is None:
            continue
        axis.add_patch(Polygon(corners + moved[-1], alpha=0.4 * alpha, linestyle=":", **style))
        places = corners.mean(axis=0) + moved
        for start, end in pairwise(places):
            axis.annotate("", end, start, arrowprops={"arrowstyle": "->", "color": OBSTACLE, "linewidth": 1.2})
        for time_s, place in zip(motion.times_s, places, strict=True):
            beside = {"xytext": (5, -9), "textcoords": "offset points", "fontsize": 7, "color": OBSTACLE}
            axis.annotate(f"{time_s:g} s", place, **beside)


def draw_patches(axis: Any, patches: Sequence[Patch]) -> None:
    """What is believed of the surroundings, and where it was touched; mission coordinates."""
    for number, patch in enumerate(patches):
        label = "remembered" if number == 0 else None
        corners = np.array(outline(patch))[:, ::-1]
        axis.add_patch(Polygon(corners, fill=False, hatch="////", edgecolor=REMEMBERED, linewidth=1.0, label=label))
        touched = np.array(patch.touches_ned_m)
        axis.plot(touched[:, 1], touched[:, 0], ".", color=REMEMBERED, markersize=5)
