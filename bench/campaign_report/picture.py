"""The first random missions from above, as both airframes flew them."""

from typing import Any

import numpy as np
from matplotlib.figure import Figure
from matplotlib.patches import Polygon

from bench.campaign_report.flown import FlownCase, Missions
from bench.paper.figures import finish, new_figure
from bench.random_missions.generator import AIRFRAMES, random_mission
from rebound_cli.figure.ground import footprint
from sim_vehicle.scene import Scene

ROWS, COLUMNS = 2, 3
COLOURS = dict(zip(AIRFRAMES, ("tab:blue", "tab:orange"), strict=True))
OBSTACLE, MARGIN_M = "tab:brown", 1.0


def missions_figure(missions: Missions) -> Figure:
    """A map a seed; ceilings, which would cover it, are left out."""
    figure, axes = new_figure(ROWS, COLUMNS, "The first random missions, from above", 4.4, 4.4)
    drawn = {airframe: [one for one in missions.of(airframe) if "path_ned_m" in one.result] for airframe in AIRFRAMES}
    for number, axis in enumerate(axes.flat):
        shown = [flown[number] for flown in drawn.values() if number < len(flown)]
        if shown:
            _draw_map(axis, shown)
        else:
            axis.set_axis_off()
    return figure


def _draw_map(axis: Any, shown: list[FlownCase]) -> None:
    case = shown[0].case
    mission = random_mission(case)
    for name, obstacle in Scene.model_validate(mission.data["sim"]).obstacles():
        if obstacle.name != "ceiling":
            axis.add_patch(Polygon(footprint(obstacle)[:, ::-1], color=OBSTACLE, alpha=0.5, gid=name))
    paths = []
    for flown in shown:
        path = np.array(flown.result["path_ned_m"])
        axis.plot(path[:, 1], path[:, 0], color=COLOURS[flown.case.airframe], linewidth=1.4, label=flown.case.airframe)
        paths.append(path[:, :2])
    axis.plot([0.0], [0.0], "k^", markersize=6, label="start")
    least, most = np.concatenate(paths).min(axis=0), np.concatenate(paths).max(axis=0)
    (north, east), half_m = 0.5 * (least + most), 0.5 * float((most - least).max()) + MARGIN_M
    axis.set(xlim=(east - half_m, east + half_m), ylim=(north - half_m, north + half_m), aspect="equal")
    finish(axis, f"seed {case.seed}: {mission.room}, {mission.stream_hz} Hz", "north [m]", "east [m]")
    axis.legend(fontsize=7)
