"""Detection against the inertial sensor's rate as received and its averaging interval, for both airframes."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from matplotlib.figure import Figure

from bench.cases.vehicles import AIRFRAMES
from bench.cases.walls import approach
from bench.rows.tables import table
from bench.studies.paper.figures import finish, new_figure
from bench.studies.paper.flights import StudyFlight, StudyResult
from bench.studies.paper.study import ClaimRow, StudyFindings, at_least, at_most

SPEED_M_S = 1.5
# The foldable vehicle is always seen; the rigid one's share needs more flights to show.
SEEDS = {"foldable": 6, "rigid": 16}
# The detector is on from half a metre, the vehicle is down again within a second.
HEIGHT_M, CRUISE_S = 1.0, 1.0


@dataclass(frozen=True, slots=True)
class Sampling:
    """The rate asked of the stream, and the interval that one sample is the mean of."""

    asked_hz: float
    interval_us: int

    @property
    def label(self) -> str:
        return f"{self.interval_us / 1e3:g} ms"


# With 4 ms (PX4's simulation) and 2.5 ms (IMU_INTEG_RATE 400) samples are left out to reach a rate. Longer means, at
# the only rate they allow, have no gaps: there the hit is diluted instead.
SAMPLINGS = (
    Sampling(25.0, 4000),
    Sampling(50.0, 4000),
    Sampling(100.0, 4000),
    Sampling(125.0, 4000),
    Sampling(250.0, 4000),
    Sampling(200.0, 2500),
    Sampling(400.0, 2500),
    Sampling(100.0, 10_000),
    Sampling(50.0, 20_000),
    Sampling(25.0, 40_000),
)
SLOWEST, FASTEST = SAMPLINGS[0], SAMPLINGS[6]


def flights(seeds: int) -> list[StudyFlight]:
    return [_flight(a, s, n) for a in AIRFRAMES for s in SAMPLINGS for n in range(1, SEEDS[a] + 1)]


def _flight(airframe: str, sampling: Sampling, seed: int) -> StudyFlight:
    companion = {
        "streams": {"highres_imu_hz": sampling.asked_hz, "min_highres_imu_hz": 1.0, "window_s": 1.0},
        "estimate": {"imu_averaging_interval_s": 1e-6 * sampling.interval_us},
    }
    # Seeds alone would shift the hit by whole samples: a part of a sample's way more puts it anywhere in between.
    cruise_s = CRUISE_S + 0.0377 * seed
    mission = approach(SPEED_M_S, height_m=HEIGHT_M, cruise_s=cruise_s, companion=companion)
    changes = {"imu": {"integration_interval_us": sampling.interval_us}}
    return StudyFlight((airframe, sampling), mission, airframe, seed, changes)


def conclude(results: Sequence[StudyResult]) -> StudyFindings:
    flown = [result for result in results if result.contacts]
    return StudyFindings(
        "Detection against the sensor's rate", _rows(flown), {"imu_rate.png": _figure(flown)}, _tables(flown)
    )


def detected_share(results: Sequence[StudyResult], airframe: str, sampling: Sampling) -> float:
    """Share of the flights whose first hit was detected."""
    seen = [result.first.is_detected for result in results if result.flight.key == (airframe, sampling)]
    return float(np.mean(seen)) if seen else float("nan")


def _rows(results: Sequence[StudyResult]) -> tuple[ClaimRow, ...]:
    worst_foldable = min(detected_share(results, "foldable", s) for s in SAMPLINGS if s.asked_hz >= 50.0)
    return (
        at_least(
            "foldable: first hits detected, 50 to 400 Hz",
            "detected consistently",
            0.95,
            worst_foldable,
            "",
            "the least of all rates and intervals from 50 Hz",
        ),
        at_least(
            "rigid: first hits detected at 400 Hz, means of 2.5 ms",
            "no failure while the sample time is near the contact time",
            0.9,
            detected_share(results, "rigid", FASTEST),
            "",
            "1.2 of 100 samples are lost on the way",
        ),
        at_most(
            "rigid: first hits detected at 25 Hz, means of 4 ms",
            "can fail when the sample time is above the impact time",
            0.5,
            detected_share(results, "rigid", SLOWEST),
            "",
            "expected: (4 + 1) ms of every 40 ms",
        ),
    )


def _tables(results: Sequence[StudyResult]) -> dict[str, str]:
    """Asked for less than the sensor's own rate PX4 leaves samples out; a longer mean dilutes the hit."""
    rows = []
    for sampling in sorted(SAMPLINGS, key=lambda s: (s.interval_us, s.asked_hz)):
        flown = [result for result in results if result.flight.key[1] == sampling]
        received_hz = float(np.mean([result.imu_received_hz for result in flown]))
        shares = {f"{name}: first hit detected": detected_share(results, name, sampling) for name in AIRFRAMES}
        rows.append(
            {
                "mean of": sampling.label,
                "asked [Hz]": f"{sampling.asked_hz:g}",
                "received [Hz]": f"{received_hz:.0f}",
                "time covered by samples": f"{min(100.0, 1e-4 * received_hz * sampling.interval_us):.0f} %",
                **{name: f"{100 * part:.0f} %" for name, part in shares.items()},
            }
        )
    return {"First hits detected, by rate and interval": table(rows)}


def _figure(results: Sequence[StudyResult]) -> Figure:
    figure, axes = new_figure(1, 2, f"First hit detected, head-on at {SPEED_M_S:g} m/s", width=6.0)
    for axis, airframe in zip(axes[0], AIRFRAMES, strict=True):
        for label in dict.fromkeys(s.label for s in SAMPLINGS):
            points = []
            for sampling in (s for s in SAMPLINGS if s.label == label):
                flown = [r for r in results if r.flight.key == (airframe, sampling)]
                received_hz = float(np.mean([r.imu_received_hz for r in flown])) if flown else float("nan")
                points.append((received_hz, 100 * detected_share(results, airframe, sampling)))
            axis.plot(*zip(*sorted(points), strict=True), "o-", label=f"each the mean of {label}")
        axis.set_ylim(-5.0, 105.0)
        axis.set_xlim(0.0, 420.0)
        finish(axis, airframe, "first hits detected [%]", "HIGHRES_IMU as received [Hz]")
        axis.legend(fontsize=8, loc="lower right")
    return figure
