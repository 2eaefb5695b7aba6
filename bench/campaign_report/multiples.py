"""Every hit of a campaign in small multiples: airframe by speed, over the bearing; as SVG, two versions in one."""

import io
from collections.abc import Mapping, Sequence
from typing import Any

import matplotlib
from matplotlib.figure import Figure

from bench.campaign.plan import Json
from bench.campaign_report.flown import Missions, square
from bench.random_missions.generator import AIRFRAMES

# Of the fastest missions, 4 m/s, some of the hits are faster.
SPEEDS_M_S = ((0.5, 1.5), (1.5, 2.5), (2.5, 3.5), (3.5, 5.5))
# What is drawn of a hit, in which unit, and how many of it are one of the record's.
FIGURES = {
    "past_m": ("Past the recovery setpoint", "cm", 100.0),
    "latency_ms": ("Noticed after the first touch", "ms", 1.0),
    "settled_s": ("At rest after the first touch", "s", 1.0),
    "clear_m": ("Clear of the surface at rest", "cm", 100.0),
}
# Of each version the hits, and those that were not noticed. Okabe and Ito's colours, told apart by the colour-blind;
# and other shapes, for print.
_STYLES = (
    ({"marker": "o", "color": "#0072b2"}, {"marker": "x", "color": "#d55e00"}),
    ({"marker": "s", "color": "#999999", "mfc": "none"}, {"marker": "+", "color": "#999999"}),
)


def multiples_svg(key: str, versions: Mapping[str, Missions]) -> str:
    """One quantity; the first version is the one that is looked at, and drawn on top."""
    title, unit, scale = FIGURES[key]
    figure = Figure(figsize=(12.5, 4.8), layout="constrained")
    axes = figure.subplots(len(AIRFRAMES), len(SPEEDS_M_S), sharex=True, sharey=True, squeeze=False)
    for row, airframe in enumerate(AIRFRAMES):
        for column, (low_m_s, high_m_s) in enumerate(SPEEDS_M_S):
            axis = axes[row, column]
            axis.set_title(f"{airframe}, {low_m_s:g} to {high_m_s:g} m/s", fontsize=9)
            axis.grid(alpha=0.3)
            for (name, missions), styles in reversed(list(zip(versions.items(), _STYLES, strict=False))):
                hits = square(missions.hits(airframe, low_m_s, high_m_s))
                _draw(axis, hits, key, scale, name, styles)
    for axis in axes[:, 0]:
        axis.set_ylabel(f"[{unit}]")
    axes[0, 0].set(xlim=(-180, 180), xticks=range(-180, 181, 90))
    figure.suptitle(f"{title} [{unit}]", fontsize=11)
    labelled = [axis.get_legend_handles_labels() for axis in axes.flat]
    shown = {label: handle for handles, labels in labelled for handle, label in zip(handles, labels, strict=True)}
    across = "across: bearing of the surface from the vehicle [°], 0 ahead, 90 to its right"
    below: Any = {"loc": "outside lower center", "ncols": 4, "fontsize": 8, "title": across, "title_fontsize": 9}
    figure.legend(shown.values(), shown, **below)
    text = io.StringIO()
    # Letters as letters, and the same bytes for the same campaign.
    with matplotlib.rc_context({"svg.fonttype": "none", "svg.hashsalt": key}):
        figure.savefig(text, format="svg", metadata={"Date": None})
    return text.getvalue()


def _draw(axis: Any, hits: Sequence[Json], key: str, scale: float, name: str, styles: Sequence[Any]) -> None:
    """Hits that were not noticed stand at the upper edge. Records of older versions hold no bearing."""
    placed = [hit for hit in hits if "bearing_deg" in hit]
    shown = [hit for hit in placed if hit.get(key) is not None]
    across, up = [hit["bearing_deg"] for hit in shown], [scale * hit[key] for hit in shown]
    axis.plot(across, up, label=name, linestyle="none", ms=3, **styles[0])
    missed = [hit["bearing_deg"] for hit in placed if not hit["seen"]]
    if missed:
        edge = {"transform": axis.get_xaxis_transform(), "linestyle": "none", "ms": 6, "label": f"{name}: not noticed"}
        axis.plot(missed, [0.97] * len(missed), **edge, **styles[1])
