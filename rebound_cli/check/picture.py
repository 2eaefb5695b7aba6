"""A mission from above and from the side: the ways, the fence, and the simulated world's obstacles."""

import math
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt
from matplotlib.figure import Figure
from matplotlib.patches import Circle, Polygon

from companion.fence import Fence
from companion.mission.model import Mission
from rebound_cli.check.ground import OBSTACLE, draw_obstacles, draw_patches, footprint
from rebound_cli.check.legs import FlownLeg
from sim_vehicle.scene import Scene

Floats = npt.NDArray[np.float64]

_TRAJECTORY = "tab:orange"
_FENCE = "tab:green"
_MEETING = "tab:red"
# Numbers of items: not on the way itself.
_BESIDE: Any = {"fontsize": 8, "xytext": (4, 4), "textcoords": "offset points"}
# Names of obstacles: above their middles, and read over what is drawn there.
_BOX = {"facecolor": "white", "edgecolor": "none", "alpha": 0.75, "pad": 0.6}
_ON_IT: Any = {
    "fontsize": 7,
    "color": OBSTACLE,
    "ha": "center",
    "xytext": (0, 5),
    "textcoords": "offset points",
    "bbox": _BOX,
}
# A wait whose end nobody knows is drawn this long.
_UNKNOWN_S = 5.0


def draw_mission(path: Path, mission: Mission, scene: Scene, legs: Sequence[FlownLeg]) -> None:
    figure = Figure(figsize=(13, 7.2), layout="constrained")
    above, side = figure.subplots(1, 2)
    _draw_from_above(above, mission, scene, legs)
    _draw_heights(side, mission.fence, legs)
    moves = any(obstacle.motion for _, obstacle in scene.obstacles())
    clock = "Obstacles' times: s since the vehicle's boot, which is some seconds before arming." if moves else None
    shown = above.get_legend_handles_labels()
    figure.legend(*shown, loc="outside lower center", ncols=8, fontsize=8, title=clock, title_fontsize=9)
    known = legs[-1].ends_s
    lasts = "" if known is None else f", {known:.0f} s"
    figure.suptitle(f"Mission '{mission.name}': {sum(flown.length_m for flown in legs):.0f} m{lasts} if nothing is hit")
    figure.savefig(path, dpi=110)


def _draw_from_above(axis: Any, mission: Mission, scene: Scene, legs: Sequence[FlownLeg]) -> None:
    start = np.array(scene.start.position_ned_m)
    draw_obstacles(axis, scene, start, "obstacles (simulated)", 0.7)
    for _, obstacle in scene.obstacles():
        moved = (0.0, 0.0, 0.0) if obstacle.motion is None else obstacle.motion.offsets_ned_m[0]
        north, east = footprint(obstacle).mean(axis=0) - start[:2] + moved[:2]
        axis.annotate(obstacle.name, (east, north), **_ON_IT)
    draw_patches(axis, mission.obstacles.patches())
    _draw_fence(axis, mission.fence)
    for number, flown in enumerate(legs):
        points = flown.points_ned_m
        axis.plot(points[:, 1], points[:, 0], color=_TRAJECTORY, linewidth=1.6, label="way" if number == 0 else None)
        if flown.meets:
            label = None if any(before.meets for before in legs[:number]) else "would be hit"
            axis.plot(*points[flown.meets.index, 1::-1], "x", color=_MEETING, label=label, linestyle="none")
    for (north, east), numbers in ends(legs).items():
        axis.annotate(", ".join(numbers), (east, north), **_BESIDE)
    axis.plot([0.0], [0.0], "^", color="black", label="arming position")
    axis.set(title="From above; numbers are items", xlabel="east [m]", ylabel="north [m]")
    axis.set_aspect("equal", adjustable="datalim")
    axis.grid(alpha=0.3)


def ends(legs: Sequence[FlownLeg]) -> dict[tuple[float, float], list[str]]:
    """Where ways end, to 0.1 m, with the items that end there; each lap of a repeat ends where the one before did."""
    found: dict[tuple[float, float], list[str]] = {}
    for flown in legs:
        north, east = (round(float(axis), 1) for axis in flown.points_ned_m[-1, :2])
        number, there = flown.leg.step.label.partition(" ")[0], found.setdefault((north, east), [])
        if flown.length_m and number not in there:
            there.append(number)
    return found


def _draw_fence(axis: Any, fence: Fence) -> None:
    style = {"fill": False, "edgecolor": _FENCE, "linestyle": "--", "linewidth": 1.2}
    if fence.radius_m is not None:
        axis.add_patch(Circle((0.0, 0.0), fence.radius_m, label="fence", **style))
        axis.update_datalim([(-fence.radius_m, -fence.radius_m), (fence.radius_m, fence.radius_m)])
    if fence.polygon_ne_m is not None:
        corners = np.array(fence.polygon_ne_m)[:, ::-1]
        axis.add_patch(Polygon(corners, closed=True, label="fence", **style))
        axis.update_datalim(corners)


def _draw_heights(axis: Any, fence: Fence, legs: Sequence[FlownLeg]) -> None:
    begins_s = 0.0
    for flown in legs:
        lasts_s = _UNKNOWN_S if flown.leg.lasts_s is None else flown.leg.lasts_s
        moving_s = 0.0 if flown.leg.trajectory is None else flown.leg.trajectory.duration_s
        times = begins_s + flown.fractions * moving_s
        heights = -flown.points_ned_m[:, 2]
        axis.plot(times, heights, color=_TRAJECTORY, linewidth=1.6)
        resting_to = 0.0 if flown.leg.step.name in ("land", "return") else heights[-1]
        axis.plot([times[-1], begins_s + lasts_s], [heights[-1], resting_to], color=_TRAJECTORY, linewidth=1.6)
        if lasts_s:
            axis.annotate(flown.leg.step.label.partition(" ")[0], (begins_s + 0.5 * lasts_s, heights[-1]), **_BESIDE)
        if flown.meets:
            met_s, height_m = times[flown.meets.index], heights[flown.meets.index]
            axis.plot([met_s], [height_m], "x", color=_MEETING)
            beside = {"xytext": (2, -4), "textcoords": "offset points", "va": "top", "rotation": -60}
            axis.annotate(flown.meets.name, (met_s, height_m), fontsize=7, color=_MEETING, **beside)
        begins_s += lasts_s
    for height_m in (fence.max_height_m, fence.min_height_m):
        axis.axhline(height_m, color=_FENCE, linestyle="--", linewidth=1.2)
    axis.set(title="Height", xlabel="time after arming, when nothing is hit [s]")
    axis.set_ylabel("height above the arming position [m]")
    axis.set_ylim(bottom=min(0.0, math.floor(-max(float(flown.points_ned_m[:, 2].max()) for flown in legs))))
    axis.grid(alpha=0.3)
