"""Drawing a flight into a wall for a reader who has never seen the paper."""

from typing import Any

import numpy as np
from matplotlib.figure import Figure

from bench.fly.campaign import Json

CENTRE = {"color": "tab:blue", "linewidth": 1.8}
ASKED = {"color": "tab:orange", "linewidth": 1.4, "linestyle": "--"}
PAPER = {"color": "tab:purple", "linewidth": 1.3, "linestyle": "-."}
WALL, CONTACT, DETECTED, TARGET = "tab:brown", "0.35", "tab:red", "tab:green"
DPI = 100


def new_figure(rows: int, columns: int, title: str, width: float = 5.2, height: float = 3.6) -> tuple[Figure, Any]:
    """Without pyplot: no window, no global state. The axes are always a two-dimensional array."""
    figure = Figure(figsize=(width * columns, height * rows + 0.5), layout="constrained", dpi=DPI)
    figure.suptitle(title, fontsize=12)
    return figure, figure.subplots(rows, columns, squeeze=False)


def draw_position(axis: Any, track: Json, title: str, start_s: float = -1.0, end_s: float = 5.0) -> None:
    """Where the centre was, where it was asked to be, and the wall."""
    asked_s, asked_m = [*track["setpoint_at_s"], end_s], [*track["setpoint_m"], track["setpoint_m"][-1]]
    axis.plot(asked_s, asked_m, drawstyle="steps-post", label="setpoint sent", **ASKED)
    axis.plot(track["time_s"], track["place_m"], label="vehicle's centre", **CENTRE)
    axis.axhline(track["touch_m"], color=WALL, linewidth=1.0, linestyle=":", label="centre when the guards touch")
    axis.axhspan(track["wall_m"], track["wall_m"] + 50.0, facecolor=WALL, alpha=0.35, hatch="//", label="wall")
    if track["targets_m"]:
        target_m = track["targets_m"][0]
        axis.axhline(target_m, color=TARGET, linewidth=1.0, label="recovery setpoint (eq. 3)")
    places = zip(track["time_s"], track["place_m"], strict=True)
    shown_m = [track["touch_m"], *(place_m for time_s, place_m in places if start_s <= time_s <= end_s)]
    axis.set_ylim(min(*shown_m, *track["targets_m"][:1]) - 0.15, max(*shown_m, track["wall_m"]) + 0.25)
    axis.set_xlim(start_s, end_s)
    mark_moments(axis, track)
    finish(axis, title, "distance from take-off point\ninto the wall [m]")


def draw_velocity(axis: Any, track: Json, title: str, start_s: float = -1.0, end_s: float = 5.0) -> None:
    """Speed into the wall; negative is away from it."""
    axis.plot(track["time_s"], track["speed_m_s"], label="vehicle's centre", **CENTRE)
    axis.axhline(0.0, color="0.7", linewidth=0.8)
    axis.set_xlim(start_s, end_s)
    mark_moments(axis, track)
    finish(axis, title, "velocity into the wall [m/s]")


def draw_fold(axis: Any, track: Json, title: str) -> None:
    """How far each arm is folded, while the vehicle touches."""
    for arm, (name, style) in enumerate(
        (("front right", "-"), ("rear left", "-."), ("front left", "--"), ("rear right", ":"))
    ):
        axis.plot(track["time_s"], 1e3 * np.array(track["fold_m"])[:, arm], style, label=f"{name} arm", linewidth=1.6)
    axis.set_xlim(-0.05, 0.3)
    mark_moments(axis, track)
    finish(axis, title, "fold of the arm [mm]")


def mark_paper(axis: Any, value: float, text: str, above: bool = False) -> None:
    """A number of the paper's own text, across the picture and in words."""
    axis.axhline(value, label="the paper's own number", **PAPER)
    axis.annotate(
        text,
        (0.98, value),
        xycoords=axis.get_yaxis_transform(),
        xytext=(0, 3 if above else -3),
        textcoords="offset points",
        ha="right",
        va="bottom" if above else "top",
        color=PAPER["color"],
        fontsize=8,
    )


def mark_moments(axis: Any, track: Json) -> None:
    """First touch and detection as lines; further contacts as ticks along the bottom."""
    axis.axvline(0.0, color=CONTACT, linewidth=1.1, label="first contact")
    if track["detections_s"]:
        late_ms = 1e3 * track["detections_s"][0]
        axis.axvline(
            track["detections_s"][0],
            color=DETECTED,
            linewidth=1.1,
            linestyle="--",
            label=f"hit detected, {late_ms:.1f} ms",
        )
    low, high = axis.get_xlim()
    further = [time_s for time_s in track["contacts_s"][1:] if low <= time_s <= high]
    if further:
        axis.plot(
            further,
            np.full(len(further), 0.03),
            "^",
            color=CONTACT,
            markersize=6,
            transform=axis.get_xaxis_transform(),
            label="hit again",
        )


def finish(axis: Any, title: str, label: str) -> None:
    axis.set_title(title, fontsize=10)
    axis.set_xlabel("time since the first contact [s]")
    axis.set_ylabel(label)
    axis.grid(alpha=0.3)


def add_legend(figure: Figure, axes: Any) -> None:
    """One legend below the whole figure, each name once."""
    found: dict[str, Any] = {}
    for axis in np.ravel(axes):
        for handle, label in zip(*axis.get_legend_handles_labels(), strict=True):
            name = "hit detected" if label.startswith("hit detected") else label
            found.setdefault(name, handle)
    figure.legend(found.values(), found.keys(), loc="outside lower center", ncols=4, fontsize=8)
