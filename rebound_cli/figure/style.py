"""Colours and the parts every panel shares."""

from collections.abc import Sequence
from typing import Any

import numpy as np
import numpy.typing as npt

from companion.report import FlightReport
from rebound_cli.truth_match import FlightTruth

Floats = npt.NDArray[np.float64]

MEASURED = {"color": "tab:blue", "linewidth": 1.8}
ASKED = {"color": "tab:orange", "linewidth": 1.4, "linestyle": "--"}
TRUE = {"color": "0.55", "linewidth": 1.0}
OBSTACLE = "tab:brown"
REMEMBERED = "tab:purple"
DETECTED = "tab:red"
RECOVERED = "tab:green"
_FAULT = "tab:pink"


def seconds_since_start(times_us: Floats, report: FlightReport) -> Floats:
    """Times of the log's clock as seconds since the flight began."""
    seconds: Floats = (times_us - report.started_at_us) / 1e6
    return seconds


def finish(axis: Any, title: str, across: str, up: str, legend_place: str = "best") -> None:
    """Title, axes with their units, grid and legend."""
    axis.set_title(title)
    axis.set_xlabel(across)
    axis.set_ylabel(up)
    axis.grid(alpha=0.3)
    axis.legend(loc=legend_place, fontsize=8, framealpha=0.9)


def mark_faults(axes: Sequence[Any], report: FlightReport, truth: FlightTruth | None) -> None:
    """Shade the times at which a simulated fault acted; each axis in seconds since the flight began."""
    if truth is None or not truth.faults:
        return
    for axis in axes:
        left, right = axis.get_xlim()
        for fault in truth.faults:
            began_s, ended_s = (
                right if at_us is None else (truth.at_us(at_us) - report.started_at_us) / 1e6
                for at_us in (fault.began_at_boot_us, fault.ended_at_boot_us)
            )
            axis.axvspan(began_s, max(ended_s, began_s + 0.02), color=_FAULT, alpha=0.12)
            if left <= began_s <= right:
                axis.annotate(
                    fault.kind.replace("_", " "),
                    (began_s, 0.02),
                    xycoords=("data", "axes fraction"),
                    fontsize=7,
                    color=_FAULT,
                    rotation=90,
                )
        axis.set_xlim(left, right)
