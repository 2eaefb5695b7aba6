"""A flight at a glance, for a reader who knows neither the paper nor the program."""

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt
from matplotlib.figure import Figure

from rebound_cli.figure.ground import OBSTACLE, draw_obstacles, draw_patches
from rebound_cli.report.shown_flight import ShownFlight
from rebound_cli.results.truth_match import FlightTruth

Floats = npt.NDArray[np.float64]

MEASURED = {"color": "tab:blue", "linewidth": 1.8}
ASKED = {"color": "tab:orange", "linewidth": 1.4, "linestyle": "--"}
DETECTED, RECOVERED, FAULT = "tab:red", "tab:green", "tab:pink"
# Arms that fold alike lie on each other: the left ones are dashed so that both show. PX4's motor order of the quad-x.
_ARMS = {"front right": "b-", "rear left": "m--", "front left": "c--", "rear right": "y-"}

# How much of the approach and of the time after the recovery is shown around a hit.
_BEFORE_S, _AFTER_S = 2.0, 1.5
# The hit itself lasts some 0.05 s; a third of a second around it shows it and the quiet on both sides.
_ZOOM_S = 0.3
# A hit without a recovery is followed for this long.
_UNSETTLED_S = 5.0
# A rigid vehicle's arms bend by less; a picture of that shows nothing.
_LEAST_FOLD_M = 0.002
# A normal that is more upright than this (45 degrees) is a ceiling's or a floor's: its push is along the thrust.
_UPRIGHT = 0.7

_START, _DETECTION = "time since the start [s]", "time from the detection [ms]"


def draw_flight(flight: ShownFlight, path: Path) -> None:
    """Write the picture of a flight that is over, with the truth where there is one."""
    assert flight.summary is not None, "a flight that is over has one"
    # What the companion summed up, and what its detector found: a hit has both.
    picture, count = _Picture(flight), min(len(flight.summary["collisions"]), len(flight.hits))
    figure = Figure(figsize=(18 if count else 13, 9.5), layout="constrained")  # without pyplot: no global state
    if count:
        picture.draw_hit(figure.subplots(2, 3))
    else:
        picture.draw_free_flight(figure.subplots(2, 2))
    hits = {0: "no hit", 1: "one hit"}.get(count, f"{count} hits, the first of them in detail")
    outcome, reason = flight.summary["outcome"], flight.summary["reason"]
    detail = f" ({reason})" if outcome != "completed" else ""
    figure.suptitle(f"Mission '{flight.name}': {outcome}{detail}, {hits}", fontsize=13)
    figure.savefig(path, dpi=100)


@dataclass(frozen=True, slots=True)
class _Hit:
    """The first one, in seconds since the flight began and along the line into the obstacle."""

    place_ned_m: Floats
    target_ned_m: Floats
    velocity_ned_m_s: Floats
    into_obstacle: Floats
    detected_s: float
    recovered_s: float | None
    contact_s: float | None
    obstacle: str
    surface_m: float | None
    touch_m: float | None  # where the vehicle's centre was at the first touch

    @property
    def end_s(self) -> float:
        """When it was over."""
        return self.recovered_s or self.detected_s + _UNSETTLED_S

    def along(self, vectors: Floats) -> Floats:
        """Component into the obstacle."""
        component: Floats = vectors @ self.into_obstacle
        return component


class _Picture:
    """Times are seconds since the flight began, places from the take-off point."""

    def __init__(self, flight: ShownFlight) -> None:
        self._flight, self._log, self._truth = flight, flight.log, flight.truth
        self._origin = np.array(flight.origin_ned_m)
        self._imu_s, self._position_s, self._setpoint_s = (
            flight.seconds(at_us) for at_us in (self._log.imu_at_us, self._log.position_at_us, self._log.setpoint_at_us)
        )

    def draw_hit(self, axes: Any) -> None:
        hit = self._first_hit()
        self._draw_position(axes[0, 0], hit)
        self._draw_velocity(axes[1, 0], hit)
        self._draw_specific_force(axes[0, 1], hit)
        if self._truth is not None and float(self._truth.series["arm_fold_m"].max(initial=0.0)) > _LEAST_FOLD_M:
            self._draw_fold(axes[1, 1], hit, self._truth)
        else:
            self._draw_speed(axes[1, 1])
        self._draw_map(axes[0, 2])
        self._draw_height(axes[1, 2])
        for axis in axes[:, 0]:
            axis.set_xlim(hit.detected_s - _BEFORE_S, hit.end_s + _AFTER_S)
        self._mark_faults((*axes[:, 0], axes[1, 2]))

    def draw_free_flight(self, axes: Any) -> None:
        self._draw_map(axes[0, 0])
        self._draw_height(axes[0, 1])
        self._draw_speed(axes[1, 0])
        self._draw_felt(axes[1, 1])
        self._mark_faults((axes[0, 1], axes[1, 0], axes[1, 1]))

    def _first_hit(self) -> _Hit:
        """By the companion; obstacle, surface and touch by the truth, where there is one."""
        flight, first = self._flight, self._flight.hits[0]
        assert flight.summary is not None, "a flight that is over has one"
        told, contact = flight.summary["collisions"][0], flight.contact_at(first.first.impact.sample_time_boot_us)
        detected_s, after_s = flight.seconds(first.at_us), told["settled_after_s"]
        into_obstacle, contact_s, surface_m, touch_m = -np.array(told["normal_ned"]), None, None, None
        if self._truth is not None and contact is not None:
            into_obstacle = -np.array(contact.normal_ned)
            contact_s = flight.seconds(self._truth.at_us(contact.contact_at_boot_us))
            touch_m = float((np.array(contact.contact_position_ned_m) - self._origin) @ into_obstacle)
            if contact.contact_point_ned_m is not None:
                surface_m = float((np.array(contact.contact_point_ned_m) - self._origin) @ into_obstacle)
        return _Hit(
            place_ned_m=np.array(first.first.position_ned_m),
            target_ned_m=np.array(told["recovery_setpoint_ned_m"]),
            velocity_ned_m_s=np.array(told["impact_velocity_ned_m_s"]),
            into_obstacle=into_obstacle,
            detected_s=detected_s,
            recovered_s=None if after_s is None else detected_s + after_s + flight.config.settled.duration_s,
            contact_s=contact_s,
            obstacle="obstacle" if contact is None else contact.obstacle,
            surface_m=surface_m,
            touch_m=touch_m,
        )

    def _draw_position(self, axis: Any, hit: _Hit) -> None:
        def place(positions_ned_m: Any) -> Any:
            return hit.along(np.array(positions_ned_m) - self._origin)

        place_m = place(self._log.position_ned_m)
        axis.plot(self._position_s, place_m, label="vehicle's centre", **MEASURED)
        setpoints_m = place(self._log.setpoint_ned_m)
        axis.plot(self._setpoint_s, setpoints_m, label="setpoint sent", drawstyle="steps-post", **ASKED)
        position_m, target_m = place(hit.place_ned_m), place(hit.target_ned_m)
        top_m = max(position_m, hit.surface_m or position_m) + 0.5
        if hit.surface_m is not None:
            axis.axhline(
                hit.touch_m, color=OBSTACLE, linewidth=1.0, linestyle=":", label="centre when the guards touch"
            )
            far_m = hit.surface_m + 10.0
            axis.axhspan(hit.surface_m, far_m, facecolor=OBSTACLE, alpha=0.35, hatch="//", label=hit.obstacle)
        shown_m = place_m[(self._position_s >= hit.detected_s) & (self._position_s <= hit.end_s)]
        axis.set_ylim(min(target_m, position_m, float(shown_m.min(initial=target_m))) - 0.3, top_m)
        _mark_moments(axis, hit)
        _finish(axis, f"Position on the line into the {hit.obstacle}", _START, "distance from take-off point [m]")

    def _draw_velocity(self, axis: Any, hit: _Hit) -> None:
        if self._truth is not None:
            true_s = self._flight.seconds(self._truth.at_us(self._truth.series["time_boot_us"]))
            true_m_s = hit.along(self._truth.series["velocity_ned_m_s"])
            axis.plot(true_s, true_m_s, label="simulator's truth", color="0.55", linewidth=1.0)
        axis.plot(self._position_s, hit.along(self._log.velocity_ned_m_s), label="measured", **MEASURED)
        before_m_s = float(hit.along(hit.velocity_ned_m_s))
        label = f"before the hit, by the companion: {before_m_s:.2f} m/s"
        axis.plot([hit.detected_s], [before_m_s], "o", color=DETECTED, label=label)
        axis.axhline(0.0, color="0.7", linewidth=0.8)
        _mark_moments(axis, hit)
        _finish(axis, f"Velocity into the {hit.obstacle} (negative: away from it)", _START, "velocity [m/s]")

    def _draw_specific_force(self, axis: Any, hit: _Hit) -> None:
        """Perpendicular to the thrust; along it for a ceiling or a floor, where the pushes are."""
        near = np.abs(self._imu_s - hit.detected_s) <= _ZOOM_S
        milliseconds, force = 1e3 * (self._imu_s[near] - hit.detected_s), self._log.specific_force_frd_m_s2[near]
        style = {"markersize": 5, "label": "each IMU sample", **MEASURED}
        if abs(hit.into_obstacle[2]) > _UPRIGHT:
            title = "What the accelerometer felt along the thrust (down positive)"
            axis.plot(milliseconds, force[:, 2], ".-", **style)
        else:
            title = "What the accelerometer felt sideways (perpendicular to thrust)"
            axis.plot(milliseconds, np.hypot(force[:, 0], force[:, 1]), ".-", **style)
            self._draw_threshold(axis)
            axis.set_ylim(bottom=0.0)
        _mark_zoom(axis, hit)
        _finish(axis, title, _DETECTION, "specific force [m/s²]")

    def _draw_fold(self, axis: Any, hit: _Hit, truth: FlightTruth) -> None:
        since_s = self._flight.seconds(truth.at_us(truth.series["time_boot_us"])) - hit.detected_s
        near = np.abs(since_s) <= _ZOOM_S
        fold_mm = 1e3 * truth.series["arm_fold_m"][near]
        for arm, (name, style) in enumerate(_ARMS.items()):
            axis.plot(1e3 * since_s[near], fold_mm[:, arm], style, label=f"{name} arm", linewidth=1.8)
        _mark_zoom(axis, hit)
        axis.set_ylim(0.0, max(5.0, 1.1 * float(fold_mm.max(initial=0.0))))
        _finish(axis, "How far each arm folded (simulator's truth)", _DETECTION, "fold [mm]")

    def _draw_map(self, axis: Any) -> None:
        """From above, about the take-off point; an obstacle that moves stands where it stood at first."""
        asked, flown = self._log.setpoint_ned_m - self._origin, self._log.position_ned_m - self._origin
        axis.plot(asked[:, 1], asked[:, 0], label="setpoints sent", **ASKED)
        axis.plot(flown[:, 1], flown[:, 0], label="path measured", **MEASURED)
        shown = np.concatenate([asked[:, :2], flown[:, :2]])
        # A setpoint that asks for an acceleration or an attitude alone has no place.
        shown = shown[np.isfinite(shown).all(axis=1)]
        if self._flight.scene is not None:
            draw_obstacles(axis, self._flight.scene, self._origin, "obstacles", 0.6)
        draw_patches(axis, self._flight.patches)
        for number, hit in enumerate(self._flight.hits):
            north, east, _ = np.array(hit.first.position_ned_m) - self._origin
            axis.plot([east], [north], "o", color=DETECTED, label="hit detected" if number == 0 else None)
        if len(shown):
            # A wall may be far longer than the flight: the flight is what is looked at.
            least, most = shown.min(axis=0), shown.max(axis=0)
            (north, east), half_m = 0.5 * (least + most), 0.5 * float((most - least).max()) + 1.0
            axis.set(xlim=(east - half_m, east + half_m), ylim=(north - half_m, north + half_m), aspect="equal")
        _finish(axis, "From above", "east of the take-off point [m]", "north of the take-off point [m]")

    def _draw_height(self, axis: Any) -> None:
        asked_m, measured_m = (
            self._origin[2] - places_ned_m[:, 2]
            for places_ned_m in (self._log.setpoint_ned_m, self._log.position_ned_m)
        )
        axis.plot(self._setpoint_s, asked_m, label="setpoint sent", drawstyle="steps-post", **ASKED)
        axis.plot(self._position_s, measured_m, label="measured", **MEASURED)
        for hit in self._flight.hits:
            axis.axvline(self._flight.seconds(hit.at_us), color=DETECTED, linewidth=1.0)
        _finish(axis, "Height above the take-off point", _START, "height [m]")

    def _draw_speed(self, axis: Any) -> None:
        north_m_s, east_m_s, _ = self._log.velocity_ned_m_s.T
        axis.plot(self._position_s, np.hypot(north_m_s, east_m_s), label="measured", **MEASURED)
        _finish(axis, "Horizontal speed", _START, "speed [m/s]")

    def _draw_felt(self, axis: Any) -> None:
        x, y, _ = self._log.specific_force_frd_m_s2.T
        axis.plot(self._imu_s, np.hypot(x, y), label="each IMU sample", color="tab:blue", linewidth=0.8)
        self._draw_threshold(axis)
        title = "What the accelerometer felt sideways (perpendicular to thrust)"
        _finish(axis, title, _START, "specific force [m/s²]")

    def _draw_threshold(self, axis: Any) -> None:
        threshold_m_s2 = self._flight.config.fused.side_threshold_m_s2
        label = f"least threshold, {threshold_m_s2:g} m/s²"
        axis.axhline(threshold_m_s2, color=DETECTED, linewidth=1.0, linestyle=":", label=label)

    def _mark_faults(self, axes: Sequence[Any]) -> None:
        """Shade the times at which a simulated fault acted."""
        truth = self._truth
        if truth is None or not truth.faults:
            return
        for axis in axes:
            left, right = axis.get_xlim()
            for fault in truth.faults:
                began_s, ended_s = (
                    right if at_us is None else self._flight.seconds(truth.at_us(at_us))
                    for at_us in (fault.began_at_boot_us, fault.ended_at_boot_us)
                )
                axis.axvspan(began_s, max(ended_s, began_s + 0.02), color=FAULT, alpha=0.12)
                if left <= began_s <= right:
                    text, place = fault.kind.replace("_", " "), ("data", "axes fraction")
                    axis.annotate(text, (began_s, 0.02), xycoords=place, fontsize=7, color=FAULT, rotation=90)
            axis.set_xlim(left, right)


def _finish(axis: Any, title: str, across: str, up: str) -> None:
    """Title, axes with their units, grid, and a legend below the name of the axis, where it hides nothing."""
    axis.set(title=title, xlabel=across, ylabel=up)
    axis.grid(alpha=0.3)
    axis.legend(loc="upper center", bbox_to_anchor=(0.5, -0.14), ncols=3, fontsize=8, frameon=False)


def _mark_moments(axis: Any, hit: _Hit) -> None:
    axis.axvline(hit.detected_s, color=DETECTED, linewidth=1.2, label="hit detected")
    if hit.recovered_s is not None:
        axis.axvline(hit.recovered_s, color=RECOVERED, linewidth=1.2, label="recovered")


def _mark_zoom(axis: Any, hit: _Hit) -> None:
    if hit.contact_s is not None:
        contact_ms = 1e3 * (hit.contact_s - hit.detected_s)
        axis.axvline(contact_ms, color=OBSTACLE, linewidth=1.2, label=f"first touch, {-contact_ms:.1f} ms earlier")
    axis.axvline(0.0, color=DETECTED, linewidth=1.2, label="hit detected")
    axis.set_xlim(-1e3 * _ZOOM_S, 1e3 * _ZOOM_S)
