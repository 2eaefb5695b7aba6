"""What every study of the paper is: flights to fly, rows of the paper's numbers beside ours, tables and pictures."""

from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from typing import Protocol

import numpy as np
from matplotlib.figure import Figure

from bench.rows.tables import table
from bench.studies.paper.claims import ClaimRow, number
from bench.studies.paper.flights import StudyFlight, StudyResult
from rebound_cli.results.summary import BREAKING_FORCE_N

# A hit counts as lost on the way when less than this share of it lies in samples that arrived: a tenth of a
# millisecond, clipped at 157 m/s^2, adds 3.9 m/s^2 to a mean over 4 ms, just below the detector's threshold.
LOST_SHARE = 0.1


@dataclass(frozen=True, slots=True)
class StudyFindings:
    """`tables` by their headings; pictures by the name of their file."""

    title: str
    rows: Sequence[ClaimRow]
    pictures: Mapping[str, Figure] = field(default_factory=dict)
    tables: Mapping[str, str] = field(default_factory=dict)


class Study(Protocol):
    """`flights` is told how many seeds are asked for; the results come in the order of the flights.

    Only the study of walls from any side grows with the seeds. The others fly what their pictures and rows need.
    """

    def flights(self, seeds: int) -> list[StudyFlight]: ...

    def conclude(self, results: Sequence[StudyResult]) -> StudyFindings: ...


def is_lost(result: StudyResult) -> bool:
    """Whether the first hit was lost between the sensor and the companion."""
    return result.first.share_received < LOST_SHARE


def worst_overshoot_m(results: Iterable[StudyResult]) -> float:
    return max((result.overshoot_m for result in results), default=0.0)


def worst_overshoot_by_estimate_m(results: Iterable[StudyResult]) -> float:
    return max((result.overshoot_by_estimate_m for result in results), default=0.0)


def safety_text(peak_force_n: float) -> str:
    """The paper's factor of safety at this force, flagged where the arm would not hold."""
    factor = BREAKING_FORCE_N / peak_force_n
    return f"{factor:.2f}" if factor >= 1.0 else f"**{factor:.2f}**"


def flown_table(results: Iterable[StudyResult], names_of: Callable[[StudyResult], Mapping[str, str]]) -> str:
    """Of flights that hit the wall: a row for those whose first columns are the same, in the order flown."""
    groups: dict[tuple[tuple[str, str], ...], list[StudyResult]] = {}
    for result in results:
        if result.contacts:
            groups.setdefault(tuple(names_of(result).items()), []).append(result)
    return table([dict(names) | _cells(some) for names, some in groups.items()])


def _cells(results: Sequence[StudyResult]) -> dict[str, object]:
    """Overshoot by the truth, and as the vehicle itself saw it."""
    first = [result.first for result in results]
    ratios = [contact.hit.rebound_speed_m_s / contact.impact_speed_m_s for contact in first]
    peak_n = max(contact.hit.peak_force_n for result in results for contact in result.contacts)
    late_ms = [1e3 * contact.latency_s for contact in first if contact.latency_s is not None]
    back_m = [
        float(np.hypot(*np.subtract(c.hit.contact_position_ned_m, c.setpoint_in_world_ned_m)[:2]))
        for c in first
        if c.setpoint_in_world_ned_m is not None
    ]
    return {
        "flights": len(results),
        "`HIGHRES_IMU` received [Hz]": f"{np.mean([result.imu_received_hz for result in results]):.0f}",
        "first hit lost": sum(is_lost(result) for result in results),
        "first hit seen": len(late_ms),
        "latency, mean [ms]": f"{np.mean(late_ms):.1f}" if late_ms else "",
        "touched again": sum(result.recontacts > 0 for result in results),
        "with a second hit": sum(result.second_hits > 0 for result in results),
        "contact, mean [ms]": f"{1e3 * np.mean([c.hit.contact_duration_s for c in first]):.1f}",
        "speed after / before": f"{np.mean(ratios):.2f} ({min(ratios):.2f} to {max(ratios):.2f})",
        "setpoint from true x(t_c) [m]": f"{np.mean(back_m):.2f}" if back_m else "",
        "overshoot, max [m]": number(round(worst_overshoot_m(results), 3)),
        "by its own estimate [m]": number(round(worst_overshoot_by_estimate_m(results), 3)),
        "lean into the wall, max [°]": f"{np.degrees(max(r.greatest_lean_rad for r in results)):.0f}",
        "peak force, max [N]": f"{peak_n:.0f}",
        "factor of safety": safety_text(peak_n),
    }


def sampling_text(results: Sequence[StudyResult]) -> str:
    """How the inertial sensor was received: the range over these flights."""
    rates = [f"{rate:.0f}" for rate in sorted(result.imu_received_hz for result in results)]
    lengths = " or ".join(f"{1e-3 * us:g}" for us in sorted({result.integration_interval_us for result in results}))
    rate = rates[0] if rates[0] == rates[-1] else f"{rates[0]} to {rates[-1]}"
    return f"`HIGHRES_IMU` as received: {rate} Hz, each sample the mean of {lengths} ms."
