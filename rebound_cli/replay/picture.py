"""The picture around one impact: what the accelerometer felt, how the vehicle turned, where it was going."""

from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt
from matplotlib.figure import Figure

from companion.messages import ImuSample, LocalPosition
from rebound_cli.replay.report import Replay
from rebound_cli.replay.watching import Finding

Floats = npt.NDArray[np.float64]

# The hit itself lasts some 0.05 s; this shows it, the quiet before and how the vehicle bounced.
_BEFORE_S, _AFTER_S = 0.3, 0.5
_AXES = (("x, forward", "tab:blue"), ("y, right", "tab:orange"), ("z, down", "tab:green"))
_WORLD = (("north", "tab:blue"), ("east", "tab:orange"), ("down", "tab:green"))
_DETECTED = "tab:red"


def draw_impact(replay: Replay, finding: Finding, path: Path) -> None:
    """Write the picture to `path`."""
    figure = Figure(figsize=(10, 9), layout="constrained")  # without pyplot: no window, no global state
    force, turning, speed = figure.subplots(3, 1, sharex=True)
    imu = [(at_us, sample) for at_us, sample in replay.log.imu() if _is_near(at_us, finding)]
    milliseconds = np.array([(at_us - finding.at_us) / 1e3 for at_us, _ in imu])
    _draw_force(force, finding, milliseconds, imu)
    rates = np.array([sample.angular_velocity_frd_rad_s for _, sample in imu])
    for index, (name, colour) in enumerate(_AXES):
        turning.plot(milliseconds, rates[:, index], ".-", markersize=3, linewidth=1, color=colour, label=name)
    turning.set_ylabel("angular rate, body [rad/s]")
    _draw_velocity(speed, replay, finding)
    speed.set_xlabel("time from the detection [ms]")
    impact = finding.first.impact
    free_ms = (impact.contact_free_until_boot_us - impact.sample_time_boot_us) / 1e3
    force.axvspan(free_ms, 0.0, color=_DETECTED, alpha=0.15, label="the contact began in this")
    for axis in (force, turning, speed):
        axis.axvline(0.0, color=_DETECTED, linewidth=1.2, label="detected")
        axis.grid(alpha=0.3)
        axis.legend(loc="upper right", fontsize=8, ncols=2)
    figure.suptitle(_title(replay, finding), fontsize=12)
    figure.savefig(path, dpi=100)


def _is_near(at_us: int, finding: Finding) -> bool:
    return -_BEFORE_S <= (at_us - finding.at_us) * 1e-6 <= _AFTER_S


def _draw_force(axis: Any, finding: Finding, milliseconds: Floats, imu: list[tuple[int, ImuSample]]) -> None:
    force = np.array([sample.specific_force_frd_m_s2 for _, sample in imu])
    for index, (name, colour) in enumerate(_AXES):
        axis.plot(milliseconds, force[:, index], ".-", markersize=3, linewidth=1, color=colour, label=name)
    # What a threshold is compared with is a departure from the quiet before: shown around that.
    quiet = np.median(force[milliseconds < 0], axis=0) if (milliseconds < 0).any() else np.zeros(3)
    departure = np.linalg.norm(force - quiet, axis=1)
    axis.plot(milliseconds, departure, color="0.2", linewidth=1.4, label="departure from the quiet before")
    threshold = finding.threshold_m_s2
    axis.axhline(threshold, color=_DETECTED, linestyle=":", label=f"threshold then, {threshold:.1f} m/s²")
    axis.set_ylabel("specific force, body [m/s²]")


def _draw_velocity(axis: Any, replay: Replay, finding: Finding) -> None:
    rows = [
        ((heard.at_us - finding.at_us) / 1e3, *heard.sample.velocity_ned_m_s)
        for heard in replay.log.heard
        if isinstance(heard.sample, LocalPosition) and _is_near(heard.at_us, finding)
    ]
    table = np.array(rows).reshape(len(rows), 4)
    contact_ms = (finding.first.time_boot_us - finding.first.impact.sample_time_boot_us) / 1e3
    for index, (name, colour) in enumerate(_WORLD):
        axis.plot(table[:, 0], table[:, 1 + index], ".-", markersize=4, linewidth=1, color=colour, label=name)
        axis.plot([contact_ms], [finding.first.velocity_ned_m_s[index]], "o", mfc="none", markersize=7, color=colour)
    axis.set_xlim(-1e3 * _BEFORE_S, 1e3 * _AFTER_S)
    axis.set_ylabel("velocity, NED [m/s]\n(rings: v_c)")


def _title(replay: Replay, finding: Finding) -> str:
    what = "hit" if finding.is_collision else "contact, no collision"
    return (
        f"{replay.log.path.name}: {what} at {replay.log.seconds(finding.at_us):.3f} s by '{replay.detector}', "
        f"{finding.final.kind.value}, confidence {finding.final.confidence:.2f}"
    )
