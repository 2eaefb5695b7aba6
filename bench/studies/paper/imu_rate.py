"""Detection against the inertial sensor's rate as received and its averaging interval, for both airframes."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from bench.cases.vehicles import AIRFRAMES
from bench.cases.walls import approach
from bench.rows.tables import table
from bench.studies.paper.claims import claim
from bench.studies.paper.flights import StudyFlight, StudyResult
from bench.studies.paper.study import StudyFindings

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
    """Asked for less than the sensor's own rate PX4 leaves samples out; a longer mean dilutes the hit."""
    flown = [result for result in results if result.contacts]
    shares = {(a, s): detected_share(flown, a, s) for a in AIRFRAMES for s in SAMPLINGS}
    rows = (
        claim("foldable detected", min(shares["foldable", s] for s in SAMPLINGS if s.asked_hz >= 50.0)),
        claim("rigid detected", shares["rigid", FASTEST]),
        claim("rigid undetected", shares["rigid", SLOWEST]),
    )
    lines = []
    for sampling in sorted(SAMPLINGS, key=lambda s: (s.interval_us, s.asked_hz)):
        received_hz = float(np.mean([r.imu_received_hz for r in flown if r.flight.key[1] == sampling]))
        covered = f"{min(100.0, 1e-4 * received_hz * sampling.interval_us):.0f} %"
        line = {"mean of": f"{sampling.interval_us / 1e3:g} ms", "asked [Hz]": f"{sampling.asked_hz:g}"}
        line |= {"received [Hz]": f"{received_hz:.0f}", "time covered by samples": covered}
        seen = {f"{name}: first hit detected": f"{100 * shares[name, sampling]:.0f} %" for name in AIRFRAMES}
        lines.append(line | seen)
    tables = {"First hits detected, by rate and interval": table(lines)}
    return StudyFindings("Detection against the sensor's rate", rows, tables=tables)


def detected_share(results: Sequence[StudyResult], airframe: str, sampling: Sampling) -> float:
    """Share of the flights whose first hit was detected."""
    seen = [result.first.is_detected for result in results if result.flight.key == (airframe, sampling)]
    return float(np.mean(seen)) if seen else float("nan")
