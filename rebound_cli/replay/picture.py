"""The picture around one impact: what the accelerometer felt, how the vehicle turned, where it was going."""

from collections.abc import Mapping
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
_AXES = {"x, forward": "tab:blue", "y, right": "tab:orange", "z, down": "tab:green"}
_WORLD = {"north": "tab:blue", "east": "tab:orange", "down": "tab:green"}
_DETECTED = "tab:red"


def draw_impact(replay: Replay, finding: Finding, path: Path) -> None:
    """Write the picture to `path`."""
    figure = Figure(figsize=(12, 9), layout="constrained")  # without pyplot: no window, no global state
    axes = figure.subplots(3, 1, sharex=True)
    near = [h for h in replay.log.heard if -_BEFORE_S <= (h.at_us - finding.at_us) * 1e-6 <= _AFTER_S]
    imu = [(h.at_us, h.sample) for h in near if isinstance(h.sample, ImuSample)]
    milliseconds = np.array([(at_us - finding.at_us) / 1e3 for at_us, _ in imu])
    force = np.array([sample.specific_force_frd_m_s2 for _, sample in imu])
    _plot(axes[0], milliseconds, force, _AXES)
    # What a threshold is compared with is a departure from the quiet before: shown around that.
    quiet = np.median(force[milliseconds < 0], axis=0) if (milliseconds < 0).any() else np.zeros(3)
    departure = np.linalg.norm(force - quiet, axis=1)
    axes[0].plot(milliseconds, departure, color="0.2", linewidth=1.4, label="departure from the quiet before")
    threshold = finding.threshold_m_s2
    axes[0].axhline(threshold, color=_DETECTED, linestyle=":", label=f"threshold then, {threshold:.1f} m/s²")
    axes[0].set_ylabel("specific force, body [m/s²]")
    impact = finding.first.impact
    free_ms = (impact.contact_free_until_boot_us - impact.sample_time_boot_us) / 1e3
    axes[0].axvspan(free_ms, 0.0, color=_DETECTED, alpha=0.15, label="the contact began in this")
    _plot(axes[1], milliseconds, np.array([sample.angular_velocity_frd_rad_s for _, sample in imu]), _AXES)
    axes[1].set_ylabel("angular rate, body [rad/s]")
    moved = [(h.at_us, h.sample.velocity_ned_m_s) for h in near if isinstance(h.sample, LocalPosition)]
    moved_ms = np.array([(at_us - finding.at_us) / 1e3 for at_us, _ in moved])
    _plot(axes[2], moved_ms, np.array([velocity for _, velocity in moved]).reshape(-1, 3), _WORLD, 4)
    contact_ms = (finding.first.time_boot_us - impact.sample_time_boot_us) / 1e3
    for speed, colour in zip(finding.first.velocity_ned_m_s, _WORLD.values(), strict=True):
        axes[2].plot([contact_ms], [speed], "o", mfc="none", markersize=7, color=colour)
    axes[2].set(xlim=(-1e3 * _BEFORE_S, 1e3 * _AFTER_S), xlabel="time from the detection [ms]")
    axes[2].set_ylabel("velocity, NED [m/s]\n(rings: v_c)")
    for axis in axes:
        axis.axvline(0.0, color=_DETECTED, linewidth=1.2, label="detected")
        axis.grid(alpha=0.3)
        axis.legend(loc="center left", bbox_to_anchor=(1.0, 0.5), fontsize=8, frameon=False)
    what = "hit" if finding.is_collision else "contact, no collision"
    title = f"{replay.log.path.name}: {what} at {replay.log.seconds(finding.at_us):.3f} s by '{replay.detector}'"
    figure.suptitle(
        f"{title}, {finding.final.impact.kind.value}, confidence {finding.final.impact.confidence:.2f}", fontsize=12
    )
    figure.savefig(path, dpi=100)


def _plot(axis: Any, milliseconds: Floats, rows: Floats, columns: Mapping[str, str], size: int = 3) -> None:
    for values, (name, colour) in zip(rows.T, columns.items(), strict=True):
        axis.plot(milliseconds, values, ".-", markersize=size, linewidth=1, color=colour, label=name)
