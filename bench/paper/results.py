"""`python -m bench paper results`: the paper's comparison, flown in lockstep and written as a table."""

import platform
import tempfile
from argparse import Namespace
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from bench.baselines.config import BaselineMission
from bench.paper.flights import DETECTOR, GAMMA_S, LAW
from bench.places import make_place
from bench.processes import in_processes
from bench.sensitivity import stop_sensitivity_text
from bench.stamps import stamp_text
from rebound_cli.documents import Document, validated
from rebound_cli.inputs import load_mission_document, with_guards, world_from
from rebound_cli.live.interrupts import Interrupts
from rebound_cli.results.flight_log import read_flight_log
from rebound_cli.results.run_folder import TLOG_NAME, FlightRecorder
from rebound_cli.results.summary import FlightFacts, build_summary
from rebound_cli.results.truth_match import match_contacts
from rebound_cli.simulation.lockstep import fly_mission_lockstep

MISSION_FILE = Path("missions/wall.yaml")
SPEED_PATH = "items.1.go_to.speed_m_s"
# The paper's, whatever the defaults become.
PINNED = (
    f"companion.detector={DETECTOR}",
    f"recovery.law={LAW}",
    f"recovery.gamma={GAMMA_S}",
)
AIRFRAMES = ("foldable", "rigid")
SPEEDS_M_S = (1.0, 1.5, 2.0, 2.5)

# A sample whose averaging window ends less than this after the first touch has hardly anything to show.
POSSIBLE_AFTER_US = 1000


@dataclass(frozen=True, slots=True)
class ResultsCase:
    """One flight of the table."""

    airframe: str
    speed_m_s: float
    seed: int


@dataclass(frozen=True, slots=True)
class HitFigures:
    """One detected hit; speeds in m/s, lengths in m."""

    is_first_possible_sample: bool
    latency_ms: float
    speed_error: float
    rebound_speed_m_s: float
    overshoot_m: float
    peak_force_n: float


@dataclass(frozen=True, slots=True)
class CaseFigures:
    """What one flight adds to the table."""

    case: ResultsCase
    is_completed: bool
    contacts: int
    false_detections: int
    recontacts: int
    hits: tuple[HitFigures, ...]


def run_results(options: Namespace) -> int:
    """Fly every case and write the table. 0 when the file is written, whatever it says."""
    make_place(options.out)
    cases = [
        ResultsCase(airframe, speed_m_s, seed)
        for airframe in AIRFRAMES
        for speed_m_s in SPEEDS_M_S
        for seed in range(1, options.seeds + 1)
    ]
    figures = in_processes(fly_case, cases, options.jobs)
    options.out.write_text(results_text(figures, options.seeds), encoding="utf-8")
    print(f"Written to {options.out}.")
    return 0


def case_document(case: ResultsCase) -> Document:
    """The mission of one flight, with the speed and all that is pinned put in."""
    sets = [f"{SPEED_PATH}={case.speed_m_s}", *PINNED]
    return load_mission_document(MISSION_FILE, sets, case.airframe, case.seed)


def fly_case(case: ResultsCase) -> CaseFigures:
    """One lockstep flight with its log on, in a folder of its own that is removed afterwards."""
    document = case_document(case)
    world = world_from(document)
    mission = validated(BaselineMission, document, with_guards(document.data, world.airframe))
    with tempfile.TemporaryDirectory() as name:
        recorder = FlightRecorder(Path(name))
        try:
            flown, _ = fly_mission_lockstep(mission, world, recorder, Interrupts())
        finally:
            recorder.close()
        imu_time_boot_us = read_flight_log(Path(name) / TLOG_NAME).imu_time_boot_us
    settled_duration_s = mission.companion.settled.duration_s
    summary = build_summary(flown, FlightFacts(mission.name, case.airframe, case.seed, settled_duration_s))
    assert flown.truth is not None, "a lockstep flight has its truth"
    matches = match_contacts(flown.report.collisions, flown.truth.hits, settled_duration_s)
    hits = []
    for collision, hit, entry in zip(
        flown.report.collisions, matches.hit_of_collision, summary["collisions"], strict=True
    ):
        if hit is None:
            continue
        possible = imu_time_boot_us[imu_time_boot_us >= hit.contact_at_boot_us + POSSIBLE_AFTER_US]
        true_speed_m_s = float(np.linalg.norm(hit.impact_velocity_ned_m_s))
        hits.append(
            HitFigures(
                is_first_possible_sample=bool(collision.sample_time_boot_us <= possible[0]),
                latency_ms=entry["truth"]["detection_latency_ms"],
                speed_error=collision.impact_speed_m_s / true_speed_m_s - 1.0,
                rebound_speed_m_s=hit.rebound_speed_m_s,
                overshoot_m=entry["truth"]["overshoot_m"],
                peak_force_n=hit.peak_force_n,
            )
        )
    return CaseFigures(
        case=case,
        is_completed=flown.report.outcome == "completed",
        contacts=len(flown.truth.hits),
        false_detections=matches.false_detections,
        recontacts=matches.recontacts,
        hits=tuple(hits),
    )


_INTRODUCTION = """\
# Results: wall hits at four speeds

{stamp} (Python {python}, {machine}).

Each row is {seeds} flights of `{mission}`, seeds 1 to {seeds}: whole flights from take-off to landing in
lockstep, with all MAVLink bytes and the log on. One of them again, with its log, summary and picture:

    rebound fly {mission} --lockstep --airframe foldable --seed 1 --set {path}=2.0 \\
        --set companion.detector={detector} --set recovery.law={law} --set recovery.gamma={gamma}

Both airframes fly the same missions with the paper's law and gain. The contrast:

- The rigid frame gives back most of the speed it came with, in a millisecond and with ten times the force.
- A millisecond lies within one `HIGHRES_IMU` sample, and PX4's link loses one in a hundred. If it is that one, the hit
  is not seen, the vehicle flies on at the wall and hits it again and again: the rigid rows with more hits than flights.
  The folding arms push for tens of milliseconds, so a lost sample costs 4 ms and no hit. (The paper: "sample loss from
  the IMUs due to low impact times".)
- The rigid vehicle runs past its setpoint, the further the faster it hits, and the foldable one does not, as in the
  paper. It is the vehicle's estimator: of a rigid hit clipping hides nearly all, so that the vehicle believes for half
  a second that it still flies into the wall, and leans back hard (bench/notes/px4.md; a real PX4 with the same law
  ran past by 0.39, 0.58, 0.79 and 1.01 m).
"""

_COLUMNS = (
    "m/s",
    "completed",
    "hits",
    "detected",
    "at the first possible sample",
    "latency, mean / max [ms]",
    "false detections",
    "recontacts",
    "v_c error, RMS [%]",
    "speed after the hit, mean [m/s]",
    "overshoot, max [m]",
    "peak force, max [N]",
)

_EXPLANATION = """\
## What the columns mean

- **m/s**: the speed asked for in the mission. **completed**: flights that ended as the mission ends.
- **hits**: contacts with the wall, by the simulator's truth; a contact ends when all has been clear for 20 ms.
- **detected**: contacts that the companion reported. **at the first possible sample**: of these, on the first
  `HIGHRES_IMU` sample on the wire whose averaging window ends 1 ms or more after the first touch, or before.
- **latency**: from the first touch to the arrival of that sample.
- **false detections**: reports without a contact. **recontacts**: new contacts before the last was recovered.
- **v_c error**: the companion's collision speed against the true speed at the first touch.
- **speed after the hit**: along the wall's normal when the contact ended.
- **overshoot**: the furthest that the vehicle went past the recovery setpoint, away from the wall.
- **peak force**: the largest force of the wall on the whole vehicle.
"""

_STOP_INTRODUCTION = """\
## The stop of the arms

Above 1.43 m/s head-on the folding arms meet their stop, and it decides the rest. Its contact time and restitution are
parameters of the airframe (`arms.stop`), the same at every speed. Single hits of a level foldable vehicle with motors
off and without friction, with the two changed: speed back and largest force.

"""


def results_text(figures: Sequence[CaseFigures], seeds: int) -> str:
    """The Markdown file."""
    parts = [
        _INTRODUCTION.format(
            stamp=stamp_text("python -m bench paper results" + ("" if seeds == 20 else f" --seeds {seeds}")),
            python=platform.python_version(),
            machine=platform.machine(),
            seeds=seeds,
            mission=MISSION_FILE,
            path=SPEED_PATH,
            detector=DETECTOR,
            law=LAW,
            gamma=GAMMA_S,
        )
    ]
    for airframe in AIRFRAMES:
        rows = [
            _row(
                speed_m_s,
                [item for item in figures if (item.case.airframe, item.case.speed_m_s) == (airframe, speed_m_s)],
            )
            for speed_m_s in SPEEDS_M_S
        ]
        parts.append(f"## {airframe}\n\n" + _table(rows))
    parts.append(_EXPLANATION)
    parts.append(_STOP_INTRODUCTION + stop_sensitivity_text())
    return "\n".join(parts)


def _row(speed_m_s: float, figures: Sequence[CaseFigures]) -> list[str]:
    hits = [hit for item in figures for hit in item.hits]
    latencies = [hit.latency_ms for hit in hits]
    errors = [hit.speed_error for hit in hits]
    has_hits = bool(hits)
    return [
        f"{speed_m_s:g}",
        f"{sum(item.is_completed for item in figures)} of {len(figures)}",
        f"{sum(item.contacts for item in figures)}",
        f"{len(hits)}",
        f"{sum(hit.is_first_possible_sample for hit in hits)}",
        f"{np.mean(latencies):.1f} / {max(latencies):.1f}" if has_hits else "",
        f"{sum(item.false_detections for item in figures)}",
        f"{sum(item.recontacts for item in figures)}",
        f"{100 * np.sqrt(np.mean(np.square(errors))):.1f}" if has_hits else "",
        f"{np.mean([hit.rebound_speed_m_s for hit in hits]):.2f}" if has_hits else "",
        f"{max(hit.overshoot_m for hit in hits):.3f}" if has_hits else "",
        f"{max(hit.peak_force_n for hit in hits):.0f}" if has_hits else "",
    ]


def _table(rows: Sequence[Sequence[str]]) -> str:
    lines = ["| " + " | ".join(_COLUMNS) + " |", "|" + "---:|" * len(_COLUMNS)]
    lines.extend("| " + " | ".join(row) + " |" for row in rows)
    return "\n".join(lines) + "\n"
