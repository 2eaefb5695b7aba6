"""A flight at a glance, for a reader who knows neither the paper nor the program."""

from pathlib import Path
from typing import Any

from matplotlib.figure import Figure

from companion.mission.model import Mission
from companion.report import FlightReport
from rebound_cli.figure.hit import draw_fold, draw_position, draw_specific_force, draw_velocity, first_hit, folds
from rebound_cli.figure.overview import draw_felt, draw_height, draw_map, draw_speed
from rebound_cli.figure.style import mark_faults
from rebound_cli.flight_log import FlightLog, read_flight_log
from rebound_cli.run_folder import FIGURE_NAME, TLOG_NAME
from rebound_cli.truth_match import FlightTruth
from sim_vehicle.scene import Scene

# How much of the approach and of the time after the recovery is shown around a hit.
_BEFORE_S, _AFTER_S = 2.0, 1.5


def draw_flight(
    folder: Path, mission: Mission, scene: Scene | None, report: FlightReport, truth: FlightTruth | None
) -> None:
    """Write the picture of the flight in `folder` from its telemetry log and, if there is one, the truth."""
    log = read_flight_log(folder / TLOG_NAME)
    if report.collisions:
        figure = Figure(figsize=(18, 8.5), layout="constrained")  # without pyplot: no window, no global state
        _draw_hit(figure.subplots(2, 3), log, mission, scene, report, truth)
    else:
        figure = Figure(figsize=(13, 8.5), layout="constrained")
        _draw_free_flight(figure.subplots(2, 2), log, mission, scene, report, truth)
    figure.suptitle(_title(mission, report), fontsize=13)
    figure.savefig(folder / FIGURE_NAME, dpi=100)


def _title(mission: Mission, report: FlightReport) -> str:
    count = len(report.collisions)
    hits = {0: "no hit", 1: "one hit"}.get(count, f"{count} hits, the first of them in detail")
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
    hit = first_hit(mission, report, truth)
    draw_position(axes[0, 0], hit, log, report)
    draw_velocity(axes[1, 0], hit, log, report, truth)
    draw_specific_force(axes[0, 1], hit, log, report, mission.companion.least_threshold_m_s2)
    if truth is not None and folds(truth):
        draw_fold(axes[1, 1], hit, report, truth)
    else:
        draw_speed(axes[1, 1], log, report)
    draw_map(axes[0, 2], log, report, scene)
    draw_height(axes[1, 2], log, report)
    for axis in axes[:, 0]:
        axis.set_xlim(hit.detected_s - _BEFORE_S, hit.end_s + _AFTER_S)
    mark_faults((*axes[:, 0], axes[1, 2]), report, truth)


def _draw_free_flight(
    axes: Any,
    log: FlightLog,
    mission: Mission,
    scene: Scene | None,
    report: FlightReport,
    truth: FlightTruth | None,
) -> None:
    draw_map(axes[0, 0], log, report, scene)
    draw_height(axes[0, 1], log, report)
    draw_speed(axes[1, 0], log, report)
    draw_felt(axes[1, 1], log, report, mission.companion.least_threshold_m_s2)
    mark_faults((axes[0, 1], axes[1, 0], axes[1, 1]), report, truth)
