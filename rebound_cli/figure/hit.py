"""The first hit of a flight: position and velocity on the line into the obstacle, what was felt, how arms folded."""

from dataclasses import dataclass
from typing import Any

import numpy as np
import numpy.typing as npt

from companion.mission.model import Mission
from companion.report import CollisionReport, FlightReport
from rebound_cli.figure.overview import draw_threshold
from rebound_cli.figure.style import ASKED, DETECTED, MEASURED, OBSTACLE, RECOVERED, TRUE, finish, seconds_since_start
from rebound_cli.flight_log import FlightLog
from rebound_cli.truth_match import FlightTruth, match_contacts

Floats = npt.NDArray[np.float64]

# Arms that fold alike lie on each other: the left ones are dashed so that both show.
_ARM_STYLES = ("b-", "m--", "c--", "y-")

# The hit itself lasts some 0.05 s; a third of a second around it shows it and the quiet on both sides.
_ZOOM_S = 0.3
# A hit without a recovery is followed for this long.
_UNSETTLED_S = 5.0
# A rigid vehicle's arms bend by less; a picture of that shows nothing.
_LEAST_FOLD_M = 0.002
# A normal that is more upright than this (45 degrees) is a ceiling's or a floor's: its push is along the thrust.
_UPRIGHT = 0.7


@dataclass(frozen=True, slots=True)
class HitShown:
    """The first hit, in seconds since the flight began and along the line into the obstacle."""

    collision: CollisionReport
    into_obstacle: Floats
    origin_ned_m: Floats
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

    def place(self, positions_ned_m: Floats) -> Floats:
        """Distance from the take-off point, into the obstacle positive."""
        return self.along(positions_ned_m - self.origin_ned_m)


def first_hit(mission: Mission, report: FlightReport, truth: FlightTruth | None) -> HitShown:
    """By the companion; obstacle, surface and touch by the truth, where there is one."""
    collision = report.collisions[0]
    detected_s = (collision.detected_at_us - report.started_at_us) / 1e6
    settled_duration_s = mission.companion.settled.duration_s
    normal, contact_s, surface_m, touch_m, obstacle = np.array(collision.normal_ned), None, None, None, "obstacle"
    origin = np.array(report.origin_ned_m or (0.0, 0.0, 0.0))
    if truth is not None:
        contact = match_contacts(report.collisions, truth.hits, settled_duration_s).hit_of_collision[0]
        if contact is not None:
            normal, obstacle = np.array(contact.normal_ned), contact.obstacle
            contact_s = (truth.at_us(contact.contact_at_boot_us) - report.started_at_us) / 1e6
            touch_m = float((np.array(contact.contact_position_ned_m) - origin) @ -normal)
            if contact.contact_point_ned_m is not None:
                surface_m = float((np.array(contact.contact_point_ned_m) - origin) @ -normal)
    recovered_s = None
    if collision.settled_after_s is not None:
        recovered_s = detected_s + collision.settled_after_s + settled_duration_s
    return HitShown(collision, -normal, origin, detected_s, recovered_s, contact_s, obstacle, surface_m, touch_m)


def folds(truth: FlightTruth) -> bool:
    """Whether the arms bend by so much that a picture shows it."""
    return float(truth.series["arm_fold_m"].max(initial=0.0)) > _LEAST_FOLD_M


def draw_position(axis: Any, hit: HitShown, log: FlightLog, report: FlightReport) -> None:
    position_s, place_m = seconds_since_start(log.position_at_us, report), hit.place(log.position_ned_m)
    axis.plot(position_s, place_m, label="vehicle's centre", **MEASURED)
    setpoint_s = seconds_since_start(log.setpoint_at_us, report)
    axis.plot(setpoint_s, hit.place(log.setpoint_ned_m), label="setpoint sent", drawstyle="steps-post", **ASKED)
    position_m = float(hit.place(np.array(hit.collision.position_ned_m)))
    target_m = float(hit.place(np.array(hit.collision.recovery_setpoint_ned_m)))
    top_m = max(position_m, hit.surface_m or position_m) + 0.5
    if hit.surface_m is not None:
        axis.axhline(hit.touch_m, color=OBSTACLE, linewidth=1.0, linestyle=":", label="centre when the guards touch")
        axis.axhspan(
            hit.surface_m, hit.surface_m + 10.0, facecolor=OBSTACLE, alpha=0.35, hatch="//", label=hit.obstacle
        )
    shown_m = place_m[(position_s >= hit.detected_s) & (position_s <= hit.end_s)]
    axis.set_ylim(min(target_m, position_m, float(shown_m.min(initial=target_m))) - 0.3, top_m)
    _mark_moments(axis, hit)
    title = f"Position on the line into the {hit.obstacle}"
    finish(axis, title, "time since the start [s]", "distance from take-off point [m]")


def draw_velocity(axis: Any, hit: HitShown, log: FlightLog, report: FlightReport, truth: FlightTruth | None) -> None:
    if truth is not None:
        true_s = seconds_since_start(truth.at_us(truth.series["time_boot_us"]), report)
        axis.plot(true_s, hit.along(truth.series["velocity_ned_m_s"]), label="simulator's truth", **TRUE)
    measured_s = seconds_since_start(log.position_at_us, report)
    axis.plot(measured_s, hit.along(log.velocity_ned_m_s), label="measured", **MEASURED)
    before_m_s = float(hit.along(np.array(hit.collision.impact_velocity_ned_m_s)))
    label = f"before the hit, by the companion: {before_m_s:.2f} m/s"
    axis.plot([hit.detected_s], [before_m_s], "o", color=DETECTED, label=label)
    axis.axhline(0.0, color="0.7", linewidth=0.8)
    _mark_moments(axis, hit)
    title = f"Velocity into the {hit.obstacle} (negative: away from it)"
    finish(axis, title, "time since the start [s]", "velocity [m/s]")


def draw_specific_force(
    axis: Any, hit: HitShown, log: FlightLog, report: FlightReport, threshold_m_s2: float | None
) -> None:
    """Perpendicular to the thrust; along it for a ceiling or a floor, where the pushes are."""
    seconds = seconds_since_start(log.imu_at_us, report)
    near = np.abs(seconds - hit.detected_s) <= _ZOOM_S
    milliseconds = 1e3 * (seconds[near] - hit.detected_s)
    force = log.specific_force_frd_m_s2[near]
    if abs(hit.into_obstacle[2]) > _UPRIGHT:
        title = "What the accelerometer felt along the thrust (down positive)"
        axis.plot(milliseconds, force[:, 2], ".-", markersize=5, label="each IMU sample", **MEASURED)
    else:
        title = "What the accelerometer felt sideways (perpendicular to thrust)"
        lateral = np.hypot(force[:, 0], force[:, 1])
        axis.plot(milliseconds, lateral, ".-", markersize=5, label="each IMU sample", **MEASURED)
        draw_threshold(axis, threshold_m_s2)
        axis.set_ylim(bottom=0.0)
    _mark_zoom(axis, hit)
    finish(axis, title, "time from the detection [ms]", "specific force [m/s²]", "upper right")


def draw_fold(axis: Any, hit: HitShown, report: FlightReport, truth: FlightTruth) -> None:
    seconds = seconds_since_start(truth.at_us(truth.series["time_boot_us"]), report)
    near = np.abs(seconds - hit.detected_s) <= _ZOOM_S
    fold_mm = 1e3 * truth.series["arm_fold_m"]
    # PX4's motor order of the quad-x frame.
    for arm, name in enumerate(("front right", "rear left", "front left", "rear right")):
        milliseconds = 1e3 * (seconds[near] - hit.detected_s)
        axis.plot(milliseconds, fold_mm[near, arm], _ARM_STYLES[arm], label=f"{name} arm", linewidth=1.8)
    _mark_zoom(axis, hit)
    axis.set_ylim(0.0, max(5.0, 1.1 * float(fold_mm[near].max(initial=0.0))))
    title = "How far each arm folded (simulator's truth)"
    finish(axis, title, "time from the detection [ms]", "fold [mm]", "upper right")


def _mark_moments(axis: Any, hit: HitShown) -> None:
    axis.axvline(hit.detected_s, color=DETECTED, linewidth=1.2, label="hit detected")
    if hit.recovered_s is not None:
        axis.axvline(hit.recovered_s, color=RECOVERED, linewidth=1.2, label="recovered")


def _mark_zoom(axis: Any, hit: HitShown) -> None:
    if hit.contact_s is not None:
        contact_ms = 1e3 * (hit.contact_s - hit.detected_s)
        axis.axvline(contact_ms, color=OBSTACLE, linewidth=1.2, label=f"first touch, {-contact_ms:.1f} ms earlier")
    axis.axvline(0.0, color=DETECTED, linewidth=1.2, label="hit detected")
    axis.set_xlim(-1e3 * _ZOOM_S, 1e3 * _ZOOM_S)
