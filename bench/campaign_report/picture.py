"""The first random missions from above, as both airframes flew them."""

from collections.abc import Sequence
from typing import Any

import numpy as np
from matplotlib.figure import Figure
from matplotlib.patches import Polygon

from bench.paper.figures import add_legend, finish, new_figure
from bench.random_missions.flight import fly
from bench.random_missions.generator import AIRFRAMES, MissionCase, random_mission
from rebound_cli.figure.ground import footprint
from sim_vehicle.scene import Scene

ROWS, COLUMNS = 2, 3
COLOURS = dict(zip(AIRFRAMES, ("tab:blue", "tab:orange"), strict=True))
OBSTACLE, MARGIN_M = "tab:brown", 1.0


def missions_figure(first_seed: int) -> Figure:
    """A map a seed, flown for it; ceilings, which would cover it, are left out."""
    figure, axes = new_figure(ROWS, COLUMNS, "The first random missions, from above", 4.4, 4.4)
    for seed, axis in enumerate(axes.flat, start=first_seed):
        _draw_map(axis, [MissionCase(seed, airframe) for airframe in AIRFRAMES])
    add_legend(figure, axes)
    return figure


def _draw_map(axis: Any, cases: Sequence[MissionCase]) -> None:
    mission = random_mission(cases[0])
    for name, obstacle in Scene.model_validate(mission.data["sim"]).obstacles():
        if obstacle.name != "ceiling":
            axis.add_patch(Polygon(footprint(obstacle)[:, ::-1], color=OBSTACLE, alpha=0.5, gid=name))
    paths = []
    for case in cases:
        path = fly(case, random_mission(case)).truth.series["position_ned_m"]
        axis.plot(path[:, 1], path[:, 0], color=COLOURS[case.airframe], linewidth=1.4, label=case.airframe)
        paths.append(path[:, :2])
    axis.plot([0.0], [0.0], "k^", markersize=6, label="start")
    least, most = np.concatenate(paths).min(axis=0), np.concatenate(paths).max(axis=0)
    (north, east), half_m = 0.5 * (least + most), 0.5 * float((most - least).max()) + MARGIN_M
    axis.set(xlim=(east - half_m, east + half_m), ylim=(north - half_m, north + half_m), aspect="equal")
    finish(axis, f"seed {cases[0].seed}: {mission.room}, {mission.stream_hz} Hz", "north [m]", "east [m]")
