"""A flight at a glance: where it flew, and the charts of its page around the first hit."""

from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np
from matplotlib.figure import Figure

from rebound_cli.figure.ground import OBSTACLE, draw_obstacles, draw_patches
from rebound_cli.report.series import OVERVIEWS, Columns, Overview, series
from rebound_cli.report.shown_flight import ShownFlight

MEASURED = {"color": "tab:blue", "linewidth": 1.8}
ASKED = {"color": "tab:orange", "linewidth": 1.4, "linestyle": "--"}
DETECTED, HANDED_OVER, FAULT = "tab:red", "tab:green", "tab:pink"
_SHOWN = ("speed", "n", "tilt", "thrust")

# What is shown around a hit: the approach, and what follows a recovery, which takes a second or two.
_BEFORE_S, _AFTER_S = 2.0, 4.0
# The hit itself lasts some 0.05 s; a third of a second around it shows it and the quiet on both sides.
_ZOOM_S = 0.3
_START, _DETECTION = "time since the start [s]", "time from the detection [ms]"


def draw_flight(flight: ShownFlight, path: Path) -> None:
    """Write the picture of a flight that is over, with the truth where there is one."""
    assert flight.summary is not None, "a flight that is over has one"
    figure = Figure(figsize=(18, 9.5), layout="constrained")  # without pyplot: no global state
    axes = figure.subplots(2, 3)
    _draw_map(axes[0, 0], flight)
    _draw_felt(axes[1, 2], flight)
    columns = series(flight.log, flight.started_at_us)
    charts = [overview for overview in OVERVIEWS if overview.lines[0].column in _SHOWN]
    for axis, overview in zip((axes[0, 1], axes[0, 2], axes[1, 0], axes[1, 1]), charts, strict=True):
        _draw_overview(axis, flight, overview, columns)
    count = len(flight.hits)
    hits = {0: "no hit", 1: "one hit"}.get(count, f"{count} hits, the first of them in detail")
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
    _mark_faults(axis, flight, left, right)
    axis.set_xlim(left, right)
    _finish(axis, overview.title, _START, f"[{overview.unit}]")


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


def _draw_felt(axis: Any, flight: ShownFlight) -> None:
    """Around the first hit, or all of a flight without one."""
    log, style = flight.log, {"label": "each IMU sample", "color": "tab:blue"}
    force_m_s2 = np.hypot(*log.specific_force_frd_m_s2[:, :2].T)
    if not flight.hits:
        axis.plot(flight.seconds(log.imu_at_us), force_m_s2, linewidth=0.8, **style)
    else:
        hit = flight.hits[0]
        since_s = 1e-6 * (log.imu_at_us - hit.at_us)
        near = np.abs(since_s) <= _ZOOM_S
        axis.plot(1e3 * since_s[near], force_m_s2[near], ".-", markersize=5, **style)
        contact = flight.contact_at(hit.first.impact.sample_time_boot_us)
        if flight.truth is not None and contact is not None:
            contact_ms = 1e-3 * (flight.truth.at_us(contact.contact_at_boot_us) - hit.at_us)
            axis.axvline(contact_ms, color=OBSTACLE, linewidth=1.2, label=f"first touch, {-contact_ms:.1f} ms earlier")
        axis.axvline(0.0, color=DETECTED, linewidth=1.2, label="hit detected")
    threshold_m_s2 = flight.config.fused.side_threshold_m_s2
    label = f"least threshold, {threshold_m_s2:g} m/s²"
    axis.axhline(threshold_m_s2, color=DETECTED, linewidth=1.0, linestyle=":", label=label)
    title = "What the accelerometer felt sideways (perpendicular to thrust)"
    _finish(axis, title, _DETECTION if flight.hits else _START, "specific force [m/s²]")


def _mark_faults(axis: Any, flight: ShownFlight, left: float, right: float) -> None:
    """Shade the times at which a simulated fault acted."""
    truth: Any = flight.truth
    faults: Sequence[Any] = () if truth is None else truth.faults
    for fault in faults:
        began_s, ended_s = (
            right if at_us is None else flight.seconds(truth.at_us(at_us))
            for at_us in (fault.began_at_boot_us, fault.ended_at_boot_us)
        )
        axis.axvspan(began_s, max(ended_s, began_s + 0.02), color=FAULT, alpha=0.12)
        if left <= began_s <= right:
            text, place = fault.kind.replace("_", " "), ("data", "axes fraction")
            axis.annotate(text, (began_s, 0.02), xycoords=place, fontsize=7, color=FAULT, rotation=90)


def _finish(axis: Any, title: str, across: str, up: str) -> None:
    """Title, axes with their units, grid, and a legend below the name of the axis, where it hides nothing."""
    axis.set(title=title, xlabel=across, ylabel=up)
    axis.grid(alpha=0.3)
    axis.legend(loc="upper center", bbox_to_anchor=(0.5, -0.14), ncols=3, fontsize=8, frameon=False)
