"""Drawing a flight into a wall for a reader who has never seen the paper."""

from typing import Any

import numpy as np
from matplotlib.figure import Figure

from bench.fly.campaign import Json

CENTRE = {"color": "tab:blue", "linewidth": 1.8}
ASKED = {"color": "tab:orange", "linewidth": 1.4, "linestyle": "--", "drawstyle": "steps-post"}
PAPER = {"color": "tab:purple", "linewidth": 1.3, "linestyle": "-."}
WALL, CONTACT, DETECTED, TARGET = "tab:brown", "0.35", "tab:red", "tab:green"
INTO_WALL = "distance from take-off point\ninto the wall [m]"


def new_figure(rows: int, columns: int, title: str, width: float = 5.2, height: float = 3.6) -> tuple[Figure, Any]:
    """Without pyplot: no window, no global state. The axes are always a two-dimensional array."""
    figure = Figure(figsize=(width * columns, height * rows + 0.5), layout="constrained", dpi=100)
    figure.suptitle(title, fontsize=12)
    return figure, figure.subplots(rows, columns, squeeze=False)


def draw_flight(axes: Any, track: Json, titles: tuple[str, str], start_s: float = -1.0, end_s: float = 5.0) -> None:
    """Where the centre was, where it was asked to be, and the wall; and its speed into the wall, negative away."""
    place, speed = axes
    places_m, shown_s = np.array(track["place_m"]), np.array(track["time_s"])
    place.plot(
        [*track["setpoint_at_s"], end_s],
        [*track["setpoint_m"], track["setpoint_m"][-1]],
        label="setpoint sent",
        **ASKED,
    )
    place.plot(shown_s, places_m, label="vehicle's centre", **CENTRE)
    place.axhline(track["touch_m"], color=WALL, linewidth=1.0, linestyle=":", label="centre when the guards touch")
    place.axhspan(track["wall_m"], track["wall_m"] + 50.0, facecolor=WALL, alpha=0.35, hatch="//", label="wall")
    targets_m = track["targets_m"][:1]
    for target_m in targets_m:
        place.axhline(target_m, color=TARGET, linewidth=1.0, label="recovery setpoint (eq. 3)")
    marks_m = [track["touch_m"], *places_m[(shown_s >= start_s) & (shown_s <= end_s)]]
    place.set_ylim(min(*marks_m, *targets_m) - 0.15, max(*marks_m, track["wall_m"]) + 0.25)
    speed.plot(shown_s, track["speed_m_s"], label="vehicle's centre", **CENTRE)
    speed.axhline(0.0, color="0.7", linewidth=0.8)
    for axis, title, label in ((place, titles[0], INTO_WALL), (speed, titles[1], "velocity into the wall [m/s]")):
        finish(axis, title, label, (start_s, end_s))
        mark_moments(axis, track)


def draw_fold(axis: Any, track: Json, title: str) -> None:
    """How far each arm is folded, while the vehicle touches."""
    names, styles = ("front right", "rear left", "front left", "rear right"), ("-", "-.", "--", ":")
    for fold_m, name, style in zip(np.array(track["fold_m"]).T, names, styles, strict=True):
        axis.plot(track["time_s"], 1e3 * fold_m, style, label=f"{name} arm", linewidth=1.6)
    finish(axis, title, "fold of the arm [mm]", (-0.05, 0.3))
    mark_moments(axis, track)


def mark_paper(axis: Any, value: float, text: str, above: bool = False) -> None:
    """A number of the paper's own text, across the picture and in words."""
    axis.axhline(value, label="the paper's own number", **PAPER)
    place = {"xytext": (0, 3 if above else -3), "textcoords": "offset points", "va": "bottom" if above else "top"}
    looks = {"ha": "right", "color": PAPER["color"], "fontsize": 8}
    axis.annotate(text, (0.98, value), xycoords=axis.get_yaxis_transform(), **place, **looks)


def mark_moments(axis: Any, track: Json) -> None:
    """First touch and detection as lines; further contacts as ticks along the bottom."""
    axis.axvline(0.0, color=CONTACT, linewidth=1.1, label="first contact")
    for late_s in track["detections_s"][:1]:
        axis.axvline(late_s, color=DETECTED, linewidth=1.1, linestyle="--", label="hit detected")
    low, high = axis.get_xlim()
    further = [time_s for time_s in track["contacts_s"][1:] if low <= time_s <= high]
    if further:
        ticks = {"color": CONTACT, "markersize": 6, "transform": axis.get_xaxis_transform(), "label": "hit again"}
        axis.plot(further, np.full(len(further), 0.03), "^", **ticks)


def finish(axis: Any, title: str, label: str, shown_s: tuple[float, float]) -> None:
    axis.set_title(title, fontsize=10)
    axis.set(xlabel="time since the first contact [s]", ylabel=label, xlim=shown_s)
    axis.grid(alpha=0.3)


def add_legend(figure: Figure) -> None:
    """One legend below the whole figure, each name once."""
    found = {
        label: handle
        for axis in reversed(figure.axes)
        for handle, label in zip(*axis.get_legend_handles_labels(), strict=True)
    }
    figure.legend(found.values(), found.keys(), loc="outside lower center", ncols=4, fontsize=8)
