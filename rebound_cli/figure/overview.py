"""The whole flight: from above, its height, its speed, what its accelerometer felt."""

from collections.abc import Sequence
from typing import Any

import numpy as np
from matplotlib.patches import Polygon

from companion.memory.patch import Patch
from companion.memory.surroundings import outline
from companion.report import FlightReport
from rebound_cli.figure.outline import footprint
from rebound_cli.figure.style import ASKED, DETECTED, MEASURED, OBSTACLE, REMEMBERED, finish, seconds_since_start
from rebound_cli.flight_log import FlightLog
from sim_vehicle.scene import Scene


def draw_map(axis: Any, log: FlightLog, report: FlightReport, scene: Scene | None) -> None:
    """From above, about the take-off point; an obstacle that moves stands where it stood at first."""
    origin = np.array(report.origin_ned_m or (0.0, 0.0, 0.0))
    asked, flown = log.setpoint_ned_m - origin, log.position_ned_m - origin
    axis.plot(asked[:, 1], asked[:, 0], label="setpoints sent", **ASKED)
    axis.plot(flown[:, 1], flown[:, 0], label="path measured", **MEASURED)
    shown = np.concatenate([asked[:, :2], flown[:, :2]])
    # A setpoint that asks for an acceleration or an attitude alone has no place.
    shown = shown[np.isfinite(shown).all(axis=1)]
    for number, (_, obstacle) in enumerate(scene.obstacles() if scene else ()):
        corners = footprint(obstacle) - origin[:2]
        label = "obstacles" if number == 0 else None
        axis.add_patch(Polygon(corners[:, ::-1], facecolor=OBSTACLE, edgecolor=OBSTACLE, alpha=0.6, label=label))
    draw_patches(axis, report.obstacles)
    for number, collision in enumerate(report.collisions):
        north, east = collision.position_ned_m[0] - origin[0], collision.position_ned_m[1] - origin[1]
        axis.plot([east], [north], "o", color=DETECTED, label="hit detected" if number == 0 else None)
    if len(shown):
        # A wall may be far longer than the flight: the flight is what is looked at.
        least, most = shown.min(axis=0), shown.max(axis=0)
        (north, east), half_m = 0.5 * (least + most), 0.5 * float((most - least).max()) + 1.0
        axis.set(xlim=(east - half_m, east + half_m), ylim=(north - half_m, north + half_m), aspect="equal")
    finish(axis, "From above", "east of the take-off point [m]", "north of the take-off point [m]")


def draw_patches(axis: Any, patches: Sequence[Patch]) -> None:
    """What is believed of the surroundings, and where it was touched; mission coordinates."""
    for number, patch in enumerate(patches):
        label = "remembered" if number == 0 else None
        corners = np.array(outline(patch))[:, ::-1]
        axis.add_patch(Polygon(corners, fill=False, hatch="////", edgecolor=REMEMBERED, linewidth=1.0, label=label))
        touched = np.array(patch.touches_ned_m)
        axis.plot(touched[:, 1], touched[:, 0], ".", color=REMEMBERED, markersize=5)


def draw_height(axis: Any, log: FlightLog, report: FlightReport) -> None:
    down_0 = report.origin_ned_m[2] if report.origin_ned_m else 0.0
    setpoint_s = seconds_since_start(log.setpoint_at_us, report)
    axis.plot(setpoint_s, down_0 - log.setpoint_ned_m[:, 2], label="setpoint sent", drawstyle="steps-post", **ASKED)
    position_s = seconds_since_start(log.position_at_us, report)
    axis.plot(position_s, down_0 - log.position_ned_m[:, 2], label="measured", **MEASURED)
    for collision in report.collisions:
        detected_s = (collision.detected_at_us - report.started_at_us) / 1e6
        axis.axvline(detected_s, color=DETECTED, linewidth=1.0)
    finish(axis, "Height above the take-off point", "time since the start [s]", "height [m]")


def draw_speed(axis: Any, log: FlightLog, report: FlightReport) -> None:
    speed_m_s = np.hypot(log.velocity_ned_m_s[:, 0], log.velocity_ned_m_s[:, 1])
    axis.plot(seconds_since_start(log.position_at_us, report), speed_m_s, label="measured", **MEASURED)
    finish(axis, "Horizontal speed", "time since the start [s]", "speed [m/s]")


def draw_felt(axis: Any, log: FlightLog, report: FlightReport, threshold_m_s2: float | None) -> None:
    lateral = np.hypot(log.specific_force_frd_m_s2[:, 0], log.specific_force_frd_m_s2[:, 1])
    seconds = seconds_since_start(log.imu_at_us, report)
    axis.plot(seconds, lateral, label="each IMU sample", color="tab:blue", linewidth=0.8)
    draw_threshold(axis, threshold_m_s2)
    title = "What the accelerometer felt sideways (perpendicular to thrust)"
    finish(axis, title, "time since the start [s]", "specific force [m/s²]")


def draw_threshold(axis: Any, threshold_m_s2: float | None) -> None:
    """Nothing for a detector that does not look at forces."""
    if threshold_m_s2 is None:
        return
    label = f"least threshold, {threshold_m_s2:g} m/s²"
    axis.axhline(threshold_m_s2, color=DETECTED, linewidth=1.0, linestyle=":", label=label)
