"""A flight at a glance: where it flew, and the charts of its page around the first hit."""

from pathlib import Path
from typing import Any

import numpy as np
from matplotlib.figure import Figure

from rebound_cli.figure.ground import draw_obstacles, draw_patches
from rebound_cli.report.series import OVERVIEWS, Columns, Overview, series
from rebound_cli.report.shown_flight import ShownFlight

MEASURED = {"color": "tab:blue", "linewidth": 1.8}
ASKED = {"color": "tab:orange", "linewidth": 1.4, "linestyle": "--"}
DETECTED, HANDED_OVER = "tab:red", "tab:green"

# What is shown around a hit: the approach, and what follows a recovery, which takes a second or two.
_BEFORE_S, _AFTER_S = 2.0, 4.0


def draw_flight(flight: ShownFlight, path: Path) -> None:
    """Write the picture of a flight that is over."""
    assert flight.summary is not None, "a flight that is over has one"
    figure = Figure(figsize=(18, 9.5), layout="constrained")  # without pyplot: no global state
    place, *axes = figure.subplots(2, 3).flat
    _draw_map(place, flight)
    columns = series(flight.log, flight.started_at_us)
    # What the detector made of it is the page's, which shows each hit in detail.
    charts = [one for one in OVERVIEWS if all(line.column in columns.get(line.table, ()) for line in one.lines)]
    for axis, overview in zip(axes, charts, strict=True):
        _draw_overview(axis, flight, overview, columns)
    count = len(flight.hits)
    hits = {0: "no hit", 1: "one hit"}.get(count, f"{count} hits, charts of the first")
    outcome, reason = flight.summary["outcome"], flight.summary["reason"]
    detail = f" ({reason})" if outcome != "completed" else ""
    figure.suptitle(f"Mission '{flight.name}': {outcome}{detail}, {hits}", fontsize=13)
    figure.savefig(path, dpi=100)


def _draw_overview(axis: Any, flight: ShownFlight, overview: Overview, columns: dict[str, Columns]) -> None:
    """As the page has it, from some time before the first hit to some time after it."""
    for line in overview.lines:
        table = columns[line.table]
        style: Any = {"color": f"tab:{line.colour}", "linestyle": "--" if line.dashed else "-", "linewidth": 1.5}
        # A setpoint holds until the next one.
        steps = "steps-post" if line.held_s else "default"
        axis.plot(table["t"][0], table[line.column][0], label=line.label, drawstyle=steps, **style)
    if flight.hits:
        hit_s = flight.seconds(flight.hits[0].at_us)
        axis.set_xlim(hit_s - _BEFORE_S, hit_s + _AFTER_S)
    left, right = axis.get_xlim()
    marks = [(float(hit.at_us), DETECTED) for hit in flight.hits]
    marks += [(float(event["time_us"]), HANDED_OVER) for event in flight.events if event["kind"] == "hand_over"]
    for at_us, colour in marks:
        axis.axvline(flight.seconds(at_us), color=colour, linewidth=1.2)
    axis.set_xlim(left, right)
    _finish(axis, overview.title, "time since the start [s]", f"[{overview.unit}]")


def _draw_map(axis: Any, flight: ShownFlight) -> None:
    """From above, about the take-off point; an obstacle that moves stands where it stood at first."""
    origin = np.array(flight.origin_ned_m)
    asked, flown = flight.log.setpoint_ned_m - origin, flight.log.position_ned_m - origin
    axis.plot(asked[:, 1], asked[:, 0], label="setpoints sent", **ASKED)
    axis.plot(flown[:, 1], flown[:, 0], label="path measured", **MEASURED)
    shown = np.concatenate([asked[:, :2], flown[:, :2]])
    # A setpoint that asks for an acceleration or an attitude alone has no place.
    shown = shown[np.isfinite(shown).all(axis=1)]
    if flight.scene is not None:
        draw_obstacles(axis, flight.scene, origin, "obstacles", 0.6)
    draw_patches(axis, flight.patches)
    for number, hit in enumerate(flight.hits):
        north, east, _ = np.array(hit.first.position_ned_m) - origin
        axis.plot([east], [north], "o", color=DETECTED, label="hit detected" if number == 0 else None)
    if len(shown):
        # A wall may be far longer than the flight: the flight is what is looked at.
        least, most = shown.min(axis=0), shown.max(axis=0)
        (north, east), half_m = 0.5 * (least + most), 0.5 * float((most - least).max()) + 1.0
        axis.set(xlim=(east - half_m, east + half_m), ylim=(north - half_m, north + half_m), aspect="equal")
    _finish(axis, "From above", "east of the take-off point [m]", "north of the take-off point [m]")


def _finish(axis: Any, title: str, across: str, up: str) -> None:
    """Title, axes with their units, grid, and a legend below the name of the axis, where it hides nothing."""
    axis.set(title=title, xlabel=across, ylabel=up)
    axis.grid(alpha=0.3)
    axis.legend(loc="upper center", bbox_to_anchor=(0.5, -0.14), ncols=3, fontsize=8, frameon=False)
