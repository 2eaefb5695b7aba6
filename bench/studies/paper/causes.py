"""Why our rigid vehicle does not do what the paper's did: one cause at a time, at 2 m/s. Nothing here is a setting
that anything else uses."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any

from bench.cases.walls import CRUISE_S, approach
from bench.studies.paper.claims import claim
from bench.studies.paper.flights import StudyFlight, StudyResult
from bench.studies.paper.study import (
    StudyFindings,
    flown_table,
    is_lost,
    worst_overshoot_by_estimate_m,
    worst_overshoot_m,
)

SPEED_M_S = 2.0
SEEDS = 6

# Damping sqrt(k_v / k_p) / 2 = 0.43 instead of 1.03.
SOFT_GAINS = {"control": {"position_p_per_s": 2.0, "velocity_p_per_s": 1.5, "velocity_i_per_s2": 0.3}}
# Gains so soft lift off two seconds late.
PATIENT = {"flight": {"arrival_timeout_s": 10.0}}
# PX4's BADACC_BIAS_PNOISE, made for vibration: 0.5 g is all that a clipped sample may have lost.
PX4_FILTER = {"estimator": {"clipped_excess_m_s2": 4.9}}
# PX4's default rate of HIGHRES_IMU: four samples of 4 ms in five are never sent.
FEW_SAMPLES = {"streams": {"highres_imu_hz": 50.0}}


@dataclass(frozen=True, slots=True)
class Cause:
    """What is changed, and for which airframe."""

    name: str
    airframe: str
    heading_deg: float = 0.0
    cruise_s: float = CRUISE_S
    changes: Mapping[str, Any] = field(default_factory=dict)
    companion: Mapping[str, Any] = field(default_factory=dict)


AS_IT_IS = "as it is"
LOST = "lost samples: `HIGHRES_IMU` at 50 Hz"
ONE_GUARD = "moments: met by one guard, nose turned by 45°"
BESIDE = "moments: one guard before the other, nose turned by 10°"
LEANING = "moments: hit while it accelerates at 2 m/s², leaning 12°"
SOFT = "gains: damping 0.43"
CLIPPED = "estimate: clipping allowed for as PX4's filter does"

CAUSES = (
    Cause(AS_IT_IS, "rigid"),
    Cause(LOST, "rigid", companion=FEW_SAMPLES),
    Cause(ONE_GUARD, "rigid", heading_deg=45.0),
    Cause(BESIDE, "rigid", heading_deg=10.0),
    Cause(LEANING, "rigid", cruise_s=0.0),
    Cause(SOFT, "rigid", changes=SOFT_GAINS, companion=PATIENT),
    Cause(CLIPPED, "rigid", changes=PX4_FILTER),
    Cause(AS_IT_IS, "foldable"),
    Cause(LOST, "foldable", companion=FEW_SAMPLES),
    Cause(LEANING, "foldable", cruise_s=0.0),
    Cause(SOFT, "foldable", changes=SOFT_GAINS, companion=PATIENT),
    Cause(CLIPPED, "foldable", changes=PX4_FILTER),
)


def flights(seeds: int) -> list[StudyFlight]:
    return [
        StudyFlight(
            (cause.airframe, cause.name),
            approach(SPEED_M_S, cause.heading_deg, cruise_s=cause.cruise_s, companion=cause.companion),
            cause.airframe,
            seed,
            cause.changes,
        )
        for cause in CAUSES
        for seed in range(1, SEEDS + 1)
    ]


def conclude(results: Sequence[StudyResult]) -> StudyFindings:
    lost, clipped = _of(results, "rigid", LOST), _of(results, "rigid", CLIPPED)
    leaning = _of(results, "foldable", LEANING)
    lost_again, leaning_again = (sum(result.second_hits > 0 for result in some) for some in (lost, leaning))
    rows = (
        claim("lost samples", lost_again, flown=len(lost), lost=sum(map(is_lost, lost))),
        claim("clipped", worst_overshoot_m(clipped), own=worst_overshoot_by_estimate_m(clipped)),
        claim("accelerating", leaning_again, flown=len(leaning), past=worst_overshoot_m(leaning)),
    )
    flown = flown_table(results, lambda result: dict(zip(("airframe", "changed"), result.flight.key, strict=True)))
    return StudyFindings("Why rigid differs", rows, tables={"One cause at a time, at 2 m/s": flown})


def _of(results: Sequence[StudyResult], airframe: str, name: str) -> list[StudyResult]:
    return [result for result in results if result.flight.key == (airframe, name) and result.contacts]
