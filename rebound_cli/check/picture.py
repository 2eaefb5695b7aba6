"""A mission from above and from the side: the ways, the fence, and the simulated world's obstacles."""

import math
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np
from matplotlib.figure import Figure
from matplotlib.patches import Circle, Polygon

from companion.fence import Fence
from companion.mission.model import Mission
from rebound_cli.check.ways import Way
from rebound_cli.figure.ground import OBSTACLE, draw_obstacles, draw_patches, footprint
from sim_vehicle.scene import Scene

_WAY = "tab:orange"
_FENCE = "tab:green"
_MEETING = "tab:red"
# Numbers of items: not on the way itself.
_BESIDE: Any = {"fontsize": 8, "xytext": (4, 4), "textcoords": "offset points"}
# A wait whose end nobody knows is drawn this long.
_UNKNOWN_S = 5.0


def draw_mission(path: Path, mission: Mission, scene: Scene, ways: Sequence[Way]) -> None:
    figure = Figure(figsize=(13, 6.5), layout="constrained")
    above, side = figure.subplots(1, 2)
    _draw_from_above(above, mission, scene, ways)
    _draw_heights(side, mission.fence, ways)
    known = ways[-1].ends_s
    lasts = "" if known is None else f", {known:.0f} s"
    figure.suptitle(f"Mission '{mission.name}': {sum(way.length_m for way in ways):.0f} m{lasts} if nothing is hit")
    figure.savefig(path, dpi=110)


def _draw_from_above(axis: Any, mission: Mission, scene: Scene, ways: Sequence[Way]) -> None:
    start = np.array(scene.start.position_ned_m)
    draw_obstacles(axis, scene, start, "obstacles (simulated)", 0.7)
    for _, obstacle in scene.obstacles():
        north, east = footprint(obstacle).mean(axis=0) - start[:2]
        axis.annotate(obstacle.name, (east, north), fontsize=7, color=OBSTACLE)
    draw_patches(axis, mission.obstacles.patches())
    _draw_fence(axis, mission.fence)
    for number, way in enumerate(ways):
        points = way.points_ned_m
        axis.plot(points[:, 1], points[:, 0], color=_WAY, linewidth=1.6, label="way" if number == 0 else None)
        if way.meets:
            axis.plot(*points[way.meets.index, 1::-1], "x", color=_MEETING)
    for (north, east), numbers in ends(ways).items():
        axis.annotate(", ".join(numbers), (east, north), **_BESIDE)
    axis.plot([0.0], [0.0], "^", color="black", label="arming position")
    axis.set(title="From above; numbers are items", xlabel="east [m]", ylabel="north [m]")
    axis.set_aspect("equal", adjustable="datalim")
    axis.grid(alpha=0.3)
    axis.legend(loc="best", fontsize=8)


def ends(ways: Sequence[Way]) -> dict[tuple[float, float], list[str]]:
    """Where ways end, to 0.1 m, with the items that end there; each lap of a repeat ends where the one before did."""
    found: dict[tuple[float, float], list[str]] = {}
    for way in ways:
        north, east = (round(float(axis), 1) for axis in way.points_ned_m[-1, :2])
        number, there = way.leg.step.label.partition(" ")[0], found.setdefault((north, east), [])
        if way.length_m and number not in there:
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


def _draw_heights(axis: Any, fence: Fence, ways: Sequence[Way]) -> None:
    begins_s = 0.0
    for way in ways:
        lasts_s = _UNKNOWN_S if way.leg.lasts_s is None else way.leg.lasts_s
        moving_s = 0.0 if way.leg.way is None else way.leg.way.duration_s
        times = begins_s + way.fractions * moving_s
        heights = -way.points_ned_m[:, 2]
        axis.plot(times, heights, color=_WAY, linewidth=1.6)
        resting_to = 0.0 if way.leg.step.name in ("land", "return") else heights[-1]
        axis.plot([times[-1], begins_s + lasts_s], [heights[-1], resting_to], color=_WAY, linewidth=1.6)
        if lasts_s:
            axis.annotate(way.leg.step.label.partition(" ")[0], (begins_s + 0.5 * lasts_s, heights[-1]), **_BESIDE)
        if way.meets:
            met_s, height_m = times[way.meets.index], heights[way.meets.index]
            axis.plot([met_s], [height_m], "x", color=_MEETING)
            axis.annotate(f"  {way.meets.name}", (met_s, height_m), fontsize=7, color=_MEETING, rotation=60)
        begins_s += lasts_s
    for number, height_m in enumerate((fence.max_height_m, fence.min_height_m)):
        label = None if number else "fence"
        axis.axhline(height_m, color=_FENCE, linestyle="--", linewidth=1.2, label=label)
    axis.set(title="Height", xlabel="time after arming, when nothing is hit [s]")
    axis.set_ylabel("height above the arming position [m]")
    axis.set_ylim(bottom=min(0.0, math.floor(-max(float(way.points_ned_m[:, 2].max()) for way in ways))))
    axis.grid(alpha=0.3)
    axis.legend(loc="best", fontsize=8)
