"""`flight.png`: a flight at a glance, for a reader who knows neither the paper nor the program."""

from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt
from matplotlib.figure import Figure

from companion.mission.model import Mission
from companion.report import CollisionReport, FlightReport
from rebound_cli.flight_log import FlightLog, read_flight_log
from rebound_cli.run_folder import FIGURE_NAME, TLOG_NAME
from rebound_cli.truth_match import FlightTruth, match_contacts
from sim_vehicle.scene import Scene
from sim_vehicle.world import Wall

Floats = npt.NDArray[np.float64]
Vector3 = tuple[float, float, float]

_MEASURED = {"color": "tab:blue", "linewidth": 1.8}
_ASKED = {"color": "tab:orange", "linewidth": 1.4, "linestyle": "--"}
_TRUE = {"color": "0.55", "linewidth": 1.0}
_WALL = "tab:brown"
_DETECTED = "tab:red"
_RECOVERED = "tab:green"

# Arms that fold alike lie on each other: the left ones are dashed so that both show.
_ARM_STYLES = ("b-", "m--", "c--", "y-")

# The hit itself lasts some 0.05 s; a third of a second around it shows it and the quiet on both sides.
_ZOOM_S = 0.3
# How much of the approach and of the time after the recovery is shown around a hit.
_BEFORE_S, _AFTER_S = 2.0, 1.5
# A hit without a recovery is followed for this long.
_UNSETTLED_S = 5.0
# A rigid vehicle's arms bend by less; a picture of that shows nothing.
_LEAST_FOLD_M = 0.002


@dataclass(frozen=True, slots=True)
class _Hit:
    """The first hit, in seconds since the flight began and along the line into the wall."""

    collision: CollisionReport
    into_wall: Floats
    origin_ned_m: Floats
    detected_s: float
    recovered_s: float | None
    contact_s: float | None
    wall_m: float | None
    touch_m: float | None  # where the vehicle's centre was at the first touch

    @property
    def end_s(self) -> float:
        """The end of what is shown."""
        return (self.recovered_s or self.detected_s + _UNSETTLED_S) + _AFTER_S

    def along(self, vectors: Floats) -> Floats:
        """Component into the wall."""
        component: Floats = vectors @ self.into_wall
        return component

    def place(self, positions_ned_m: Floats) -> Floats:
        """Distance from the take-off point, into the wall positive."""
        return self.along(positions_ned_m - self.origin_ned_m)


def draw_flight(
    folder: Path, mission: Mission, scene: Scene | None, report: FlightReport, truth: FlightTruth | None
) -> None:
    """Write the picture of the flight in `folder` from its telemetry log and, if there is one, the truth."""
    log = read_flight_log(folder / TLOG_NAME)
    figure = Figure(figsize=(13, 8.5), layout="constrained")  # without pyplot: no window, no global state
    axes = figure.subplots(2, 2)
    if report.collisions:
        _draw_hit(axes, log, mission, scene, report, truth)
    else:
        _draw_free_flight(axes, log, mission, scene, report)
    figure.suptitle(_title(mission, report), fontsize=13)
    figure.savefig(folder / FIGURE_NAME, dpi=110)


def _title(mission: Mission, report: FlightReport) -> str:
    hits = {0: "no hit", 1: "one hit"}.get(len(report.collisions), f"{len(report.collisions)} hits, the first shown")
    detail = f" ({report.reason})" if report.outcome != "completed" else ""
    return f"Mission '{mission.name}': {report.outcome}{detail}, {hits}"


def _draw_hit(
    axes: Any,
    log: FlightLog,
    mission: Mission,
    scene: Scene | None,
    report: FlightReport,
    truth: FlightTruth | None,
) -> None:
    hit = _first_hit(mission, scene, report, truth)
    _draw_position(axes[0, 0], hit, log, report)
    _draw_velocity(axes[1, 0], hit, log, report, truth)
    _draw_specific_force(axes[0, 1], hit, log, report, mission)
    if truth is not None and truth.series["arm_fold_m"].max(initial=0.0) > _LEAST_FOLD_M:
        _draw_fold(axes[1, 1], hit, report, truth)
    else:
        _draw_map(axes[1, 1], log, report, scene)
    for axis in axes[:, 0]:
        axis.set_xlim(hit.detected_s - _BEFORE_S, hit.end_s)


def _first_hit(mission: Mission, scene: Scene | None, report: FlightReport, truth: FlightTruth | None) -> _Hit:
    collision = report.collisions[0]
    detected_s = (collision.detected_at_us - report.started_at_us) / 1e6
    settled_duration_s = mission.companion.settled.duration_s
    normal, contact_s, wall_m, touch_m = np.array(collision.normal_ned), None, None, None
    origin = np.array(report.origin_ned_m or (0.0, 0.0, 0.0))
    if truth is not None:
        contact = match_contacts(report.collisions, truth.hits, settled_duration_s).hit_of_collision[0]
        if contact is not None:
            normal = np.array(contact.normal_ned)
            contact_s = (truth.epoch_at_boot_us + contact.contact_at_boot_us - report.started_at_us) / 1e6
            touch_m = float((np.array(contact.contact_position_ned_m) - origin) @ -normal)
            wall = _nearest_wall(scene, contact.contact_position_ned_m)
            wall_m = float((np.array(wall.point_ned_m) - origin) @ -normal) if wall else None
    recovered_s = None
    if collision.settled_after_s is not None:
        recovered_s = detected_s + collision.settled_after_s + settled_duration_s
    return _Hit(collision, -normal, origin, detected_s, recovered_s, contact_s, wall_m, touch_m)


def _nearest_wall(scene: Scene | None, position_ned_m: Vector3) -> Wall | None:
    walls = scene.walls_built() if scene else ()
    return min(walls, key=lambda wall: wall.distance_m(position_ned_m), default=None)


def _seconds(times_us: Floats, report: FlightReport) -> Floats:
    seconds: Floats = (times_us - report.started_at_us) / 1e6
    return seconds


def _draw_position(axis: Any, hit: _Hit, log: FlightLog, report: FlightReport) -> None:
    position_s, place_m = _seconds(log.position_at_us, report), hit.place(log.position_ned_m)
    axis.plot(position_s, place_m, label="vehicle's centre", **_MEASURED)
    setpoint_s = _seconds(log.setpoint_at_us, report)
    axis.plot(setpoint_s, hit.place(log.setpoint_ned_m), label="setpoint sent", drawstyle="steps-post", **_ASKED)
    position_m = float(hit.place(np.array(hit.collision.position_ned_m)))
    target_m = float(hit.place(np.array(hit.collision.recovery_setpoint_ned_m)))
    top_m = max(position_m, hit.wall_m or position_m) + 0.5
    if hit.wall_m is not None:
        axis.axhline(hit.touch_m, color=_WALL, linewidth=1.0, linestyle=":", label="centre when the guards touch")
        axis.axhspan(hit.wall_m, hit.wall_m + 10.0, facecolor=_WALL, alpha=0.35, hatch="//", label="wall")
    shown_m = place_m[(position_s >= hit.detected_s) & (position_s <= hit.end_s)]
    axis.set_ylim(min(target_m, position_m, float(shown_m.min(initial=target_m))) - 0.3, top_m)
    _mark_moments(axis, hit)
    axis.set_title("Position on the line into the wall")
    axis.set_xlabel("time since the start [s]")
    axis.set_ylabel("distance from take-off point [m]")
    _finish(axis, "best")


def _draw_velocity(axis: Any, hit: _Hit, log: FlightLog, report: FlightReport, truth: FlightTruth | None) -> None:
    if truth is not None:
        boot_us = truth.series["time_boot_us"] + truth.epoch_at_boot_us
        axis.plot(
            _seconds(boot_us, report),
            hit.along(truth.series["velocity_ned_m_s"]),
            label="simulator's truth",
            **_TRUE,
        )
    axis.plot(_seconds(log.position_at_us, report), hit.along(log.velocity_ned_m_s), label="measured", **_MEASURED)
    before_m_s = float(hit.along(np.array(hit.collision.impact_velocity_ned_m_s)))
    axis.plot(
        [hit.detected_s],
        [before_m_s],
        "o",
        color=_DETECTED,
        label=f"before the hit, by the companion: {before_m_s:.2f} m/s",
    )
    axis.axhline(0.0, color="0.7", linewidth=0.8)
    _mark_moments(axis, hit)
    axis.set_title("Velocity into the wall (negative: away from it)")
    axis.set_xlabel("time since the start [s]")
    axis.set_ylabel("velocity [m/s]")
    _finish(axis, "best")


def _draw_specific_force(axis: Any, hit: _Hit, log: FlightLog, report: FlightReport, mission: Mission) -> None:
    seconds = _seconds(log.imu_at_us, report)
    near = np.abs(seconds - hit.detected_s) <= _ZOOM_S
    lateral = np.hypot(log.specific_force_frd_m_s2[:, 0], log.specific_force_frd_m_s2[:, 1])
    axis.plot(
        1e3 * (seconds[near] - hit.detected_s),
        lateral[near],
        ".-",
        markersize=5,
        label="each IMU sample",
        **_MEASURED,
    )
    _draw_threshold(axis, mission)
    _mark_zoom(axis, hit)
    axis.set_title("What the accelerometer felt sideways (perpendicular to thrust)")
    axis.set_xlabel("time from the detection [ms]")
    axis.set_ylabel("specific force [m/s²]")
    axis.set_ylim(bottom=0.0)
    _finish(axis, "upper right")


def _draw_threshold(axis: Any, mission: Mission) -> None:
    if mission.companion.detector == "lateral":
        threshold = mission.companion.lateral.threshold_m_s2
        axis.axhline(
            threshold, color=_DETECTED, linewidth=1.0, linestyle=":", label=f"least threshold, {threshold:g} m/s²"
        )


def _draw_fold(axis: Any, hit: _Hit, report: FlightReport, truth: FlightTruth) -> None:
    seconds = _seconds(truth.series["time_boot_us"] + truth.epoch_at_boot_us, report)
    near = np.abs(seconds - hit.detected_s) <= _ZOOM_S
    fold_mm = 1e3 * truth.series["arm_fold_m"]
    # PX4's motor order of the quad-x frame.
    for arm, name in enumerate(("front right", "rear left", "front left", "rear right")):
        milliseconds = 1e3 * (seconds[near] - hit.detected_s)
        axis.plot(milliseconds, fold_mm[near, arm], _ARM_STYLES[arm], label=f"{name} arm", linewidth=1.8)
    _mark_zoom(axis, hit)
    axis.set_title("How far each arm folded (simulator's truth)")
    axis.set_xlabel("time from the detection [ms]")
    axis.set_ylabel("fold [mm]")
    axis.set_ylim(0.0, max(5.0, 1.1 * float(fold_mm[near].max(initial=0.0))))
    _finish(axis, "upper right")


def _mark_moments(axis: Any, hit: _Hit) -> None:
    axis.axvline(hit.detected_s, color=_DETECTED, linewidth=1.2, label="hit detected")
    if hit.recovered_s is not None:
        axis.axvline(hit.recovered_s, color=_RECOVERED, linewidth=1.2, label="recovered")


def _mark_zoom(axis: Any, hit: _Hit) -> None:
    if hit.contact_s is not None:
        contact_ms = 1e3 * (hit.contact_s - hit.detected_s)
        axis.axvline(contact_ms, color=_WALL, linewidth=1.2, label=f"first touch, {-contact_ms:.1f} ms earlier")
    axis.axvline(0.0, color=_DETECTED, linewidth=1.2, label="hit detected")
    axis.set_xlim(-1e3 * _ZOOM_S, 1e3 * _ZOOM_S)


def _finish(axis: Any, legend_place: str) -> None:
    axis.grid(alpha=0.3)
    axis.legend(loc=legend_place, fontsize=8, framealpha=0.9)


def _draw_free_flight(axes: Any, log: FlightLog, mission: Mission, scene: Scene | None, report: FlightReport) -> None:
    _draw_map(axes[0, 0], log, report, scene)
    position_s, setpoint_s = _seconds(log.position_at_us, report), _seconds(log.setpoint_at_us, report)
    height = axes[0, 1]
    down_0 = report.origin_ned_m[2] if report.origin_ned_m else 0.0
    height.plot(setpoint_s, down_0 - log.setpoint_ned_m[:, 2], label="setpoint sent", drawstyle="steps-post", **_ASKED)
    height.plot(position_s, down_0 - log.position_ned_m[:, 2], label="measured", **_MEASURED)
    _describe(height, "Height above the take-off point", "height [m]")
    speed = axes[1, 0]
    speed.plot(
        position_s,
        np.hypot(log.velocity_ned_m_s[:, 0], log.velocity_ned_m_s[:, 1]),
        label="measured",
        **_MEASURED,
    )
    _describe(speed, "Horizontal speed", "speed [m/s]")
    force = axes[1, 1]
    lateral = np.hypot(log.specific_force_frd_m_s2[:, 0], log.specific_force_frd_m_s2[:, 1])
    force.plot(_seconds(log.imu_at_us, report), lateral, label="each IMU sample", color="tab:blue", linewidth=0.8)
    _draw_threshold(force, mission)
    _describe(force, "What the accelerometer felt sideways (perpendicular to thrust)", "specific force [m/s²]")


def _describe(axis: Any, title: str, label: str) -> None:
    axis.set_title(title)
    axis.set_xlabel("time since the start [s]")
    axis.set_ylabel(label)
    _finish(axis, "best")


def _draw_map(axis: Any, log: FlightLog, report: FlightReport, scene: Scene | None) -> None:
    origin = np.array(report.origin_ned_m or (0.0, 0.0, 0.0))
    asked, flown = log.setpoint_ned_m - origin, log.position_ned_m - origin
    axis.plot(asked[:, 1], asked[:, 0], label="setpoints sent", **_ASKED)
    axis.plot(flown[:, 1], flown[:, 0], label="path measured", **_MEASURED)
    for wall in scene.walls_built() if scene else ():
        _draw_wall_from_above(axis, wall, origin)
    for number, collision in enumerate(report.collisions):
        north, east = collision.position_ned_m[0] - origin[0], collision.position_ned_m[1] - origin[1]
        axis.plot([east], [north], "o", color=_DETECTED, label="hit detected" if number == 0 else None)
    axis.set_title("From above")
    axis.set_xlabel("east of the take-off point [m]")
    axis.set_ylabel("north of the take-off point [m]")
    axis.set_aspect("equal", adjustable="datalim")
    _finish(axis, "best")


def _draw_wall_from_above(axis: Any, wall: Wall, origin: Floats) -> None:
    north, east, _ = wall.normal_ned
    along = np.array([-east, north]) * wall.width_m / 2
    centre = np.array(wall.point_ned_m[:2]) - origin[:2]
    ends = np.array([centre - along, centre + along])
    axis.plot(ends[:, 1], ends[:, 0], color=_WALL, linewidth=4, label=wall.name)
