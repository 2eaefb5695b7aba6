"""What every study is: flights to fly, and what follows from their results."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import Protocol

from matplotlib.figure import Figure

from bench.paper.flights import StudyFlight, StudyResult
from bench.paper.table import ClaimRow


@dataclass(frozen=True, slots=True)
class StudyFindings:
    """`text` is Markdown; pictures by the name of their file; `sampling` stands beside the table of the rows."""

    title: str
    rows: tuple[ClaimRow, ...]
    text: str
    pictures: Mapping[str, Figure] = field(default_factory=dict)
    sampling: str = ""


class Study(Protocol):
    """`flights` is told how many seeds are asked for; the results come in the order of the flights.

    Only the study of walls from any side grows with the seeds. The others fly what their pictures and rows need.
    """

    def flights(self, seeds: int) -> list[StudyFlight]: ...

    def conclude(self, results: Sequence[StudyResult]) -> StudyFindings: ...


def concluded(study: Study, results: Sequence[StudyResult]) -> StudyFindings:
    """The study's findings, with how the inertial sensor was received in its flights."""
    sampling = sampling_text(results) if results else "Single hits of the simulated body: no telemetry in it."
    return replace(study.conclude(results), sampling=sampling)


def sampling_text(results: Sequence[StudyResult]) -> str:
    """How the inertial sensor was received: the range over these flights."""
    rates = sorted(result.imu_received_hz for result in results)
    intervals = sorted({result.integration_interval_us for result in results})
    rate = f"{rates[0]:.0f}" if f"{rates[0]:.0f}" == f"{rates[-1]:.0f}" else f"{rates[0]:.0f} to {rates[-1]:.0f}"
    lengths = " or ".join(f"{1e-3 * interval:g}" for interval in intervals)
    return f"`HIGHRES_IMU` as received: {rate} Hz, each sample the mean of {lengths} ms."
