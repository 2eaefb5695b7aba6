"""What the code makes of one recorded flight, beside what really happened in it."""

import math
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from bench.detectors.scoring import angle_deg
from companion.reflex.impact import ImpactEstimate
from rebound_cli.documents import load_document
from rebound_cli.inputs import mission_from
from rebound_cli.logs.reader import read_log
from rebound_cli.replay.watching import Findings, watch_log
from rebound_cli.results.run_folder import RESOLVED_NAME, TLOG_NAME, TRUTH_NAME
from rebound_cli.results.truth_match import index_of_hit
from sim_vehicle.shell.truth_file import load_truth
from sim_vehicle.truth import Hit

# As recorded, and as PX4 would have sent HIGHRES_IMU of it when asked for so much.
ASKED_HZ = {"recorded": None, "50": 50.0}


@dataclass(frozen=True, slots=True)
class CorpusCase:
    """A run folder of the corpus."""

    folder: str


def work_out(case: CorpusCase) -> dict[str, Any]:
    """By rate: each true hit with what was told of it, and collisions told that were none."""
    folder = Path(case.folder)
    log, settings = read_log(folder / TLOG_NAME), mission_from(load_document(folder / RESOLVED_NAME)).companion
    hits, _, _ = load_truth(folder / TRUTH_NAME)
    rates = {rate: verdict(watch_log(log, settings, hz), hits) for rate, hz in ASKED_HZ.items()}
    return {"seconds": log.duration_s, "rates": rates}


def verdict(findings: Findings, hits: Sequence[Hit]) -> dict[str, Any]:
    """A contact explains one collision, as in a flight's summary."""
    told: dict[int, ImpactEstimate] = {}
    false = []
    for finding in findings.collisions:
        index = index_of_hit(finding.first.impact.sample_time_boot_us, hits)
        if index is None or index in told:
            false.append(finding.first.impact.sample_time_boot_us)
        else:
            told[index] = finding.final
    return {
        "hits": [_hit(hit, told.get(index)) for index, hit in enumerate(hits)],
        "false_boot_us": false,
        "watched_share": findings.watched_share,
    }


def _hit(hit: Hit, told: ImpactEstimate | None) -> dict[str, Any]:
    change = math.dist(hit.impact_velocity_ned_m_s, hit.rebound_velocity_ned_m_s)
    row: dict[str, Any] = {"contact_boot_us": round(hit.contact_at_boot_us), "change_m_s": round(change, 4)}
    if told is None:
        return row
    return row | {
        "latency_ms": round(1e-3 * (told.impact.sample_time_boot_us - hit.contact_at_boot_us), 3),
        "velocity_error_m_s": round(math.dist(told.velocity_ned_m_s, hit.impact_velocity_ned_m_s), 4),
        "normal_error_deg": round(angle_deg(told.normal.direction_ned, hit.normal_ned), 2),
    }
