"""`bench paper results`: wall hits at four speeds with both airframes, and what the stop of the arms decides."""

from argparse import Namespace
from dataclasses import asdict, dataclass
from pathlib import Path

import numpy as np
import pandas as pd

from bench.cases.vehicles import AIRFRAMES
from bench.cases.walls import DETECTOR, GAMMA_S, LAW
from bench.detectors.config import BaselineMission
from bench.fly.campaign import Campaign, Json, Results, Workers, run_campaign
from bench.fly.cruise import head_on
from bench.fly.lockstep import flown_with_log
from bench.rows.tables import Page, rms, table
from rebound_cli.documents import Document, validated
from rebound_cli.inputs import load_mission_document, with_guards, world_from
from rebound_cli.results.summary import FlightFacts, build_summary
from rebound_cli.results.truth_match import match_contacts
from sim_vehicle.airframe import Airframe, load_built_in

MISSION_FILE = Path("missions/wall.yaml")
SPEED_PATH = "items.1.go_to.speed_m_s"
# The paper's, whatever the defaults become.
PINNED = (f"companion.detector={DETECTOR}", f"recovery.law={LAW}", f"recovery.gamma={GAMMA_S}")
SPEEDS_M_S = (1.0, 1.5, 2.0, 2.5)
# A sample whose averaging window ends less than this after the first touch has hardly anything to show.
POSSIBLE_AFTER_US = 1000
# Of the stop of the arms.
STOP_SPEEDS_M_S = (1.4, 2.0, 2.5, 4.0)
CONTACT_TIMES_S = (0.0025, 0.005, 0.01)
RESTITUTIONS = (0.3, 0.5, 0.7)


@dataclass(frozen=True, slots=True)
class ResultsCase:
    """One flight of the table."""

    airframe: str
    speed_m_s: float
    seed: int


def case_document(case: ResultsCase) -> Document:
    """The mission of one flight, with the speed and all that is pinned put in."""
    sets = [f"{SPEED_PATH}={case.speed_m_s}", *PINNED]
    return load_mission_document(MISSION_FILE, sets, case.airframe, case.seed)


def fly_case(case: ResultsCase) -> Json:
    """One lockstep flight with its log on; each contact that was detected among its hits. SI units."""
    document = case_document(case)
    world = world_from(document)
    mission = validated(BaselineMission, document, with_guards(document.data, world.airframe))
    flown, truth, log = flown_with_log(mission, world.scene, world.airframe)
    settled_duration_s = mission.companion.settled.duration_s
    summary = build_summary(flown, FlightFacts(mission.name, case.airframe, case.seed, settled_duration_s))
    matches = match_contacts(flown.report.collisions, truth.hits, settled_duration_s)
    found = zip(flown.report.collisions, matches.hit_of_collision, summary["collisions"], strict=True)
    hits = []
    for collision, hit, entry in found:
        if hit is None:
            continue
        possible = log.imu_time_boot_us[log.imu_time_boot_us >= hit.contact_at_boot_us + POSSIBLE_AFTER_US]
        true_speed_m_s = float(np.linalg.norm(hit.impact_velocity_ned_m_s))
        hits.append(
            {
                "is_first_possible_sample": bool(collision.sample_time_boot_us <= possible[0]),
                "latency_ms": entry["truth"]["detection_latency_ms"],
                "speed_error": collision.impact_speed_m_s / true_speed_m_s - 1.0,
                "rebound_speed_m_s": hit.rebound_speed_m_s,
                "overshoot_m": entry["truth"]["overshoot_m"],
                "peak_force_n": hit.peak_force_n,
            }
        )
    return {
        "case": asdict(case),
        "is_completed": flown.report.outcome == "completed",
        "contacts": len(truth.hits),
        "false_detections": matches.false_detections,
        "recontacts": matches.recontacts,
        "hits": hits,
    }


def run_results(options: Namespace) -> int:
    """Fly every case and write the table. 0 when the file is written, whatever it says."""
    page, seeds = Page(options.out, "results"), range(1, options.seeds + 1)
    cases = [ResultsCase(airframe, speed, seed) for airframe in AIRFRAMES for speed in SPEEDS_M_S for seed in seeds]
    campaign = Campaign("paper-results", {"seeds": options.seeds}, cases, fly_case)
    results = run_campaign(campaign, Workers(options.jobs))
    stop = "The stop of the arms: speed back and largest force of single hits, motors off, without friction"
    page.write("Wall hits at four speeds", options.typed, {"": results_table(results), stop: stop_table()})
    return 1 if results.failures else 0


def results_table(results: Results) -> str:
    """Detected at the first possible sample: at the first that holds a millisecond of the contact, or before."""
    every = pd.json_normalize(list(results.results.values()))
    rows = []
    for (airframe, speed), flights in every.groupby(["case.airframe", "case.speed_m_s"]):
        hits = pd.DataFrame([hit for of_flight in flights["hits"] for hit in of_flight])
        row = {
            "airframe": airframe,
            "m/s": f"{speed:g}",
            "completed": f"{flights['is_completed'].sum()} of {len(flights)}",
            "hits": flights["contacts"].sum(),
            "detected": len(hits),
            "false detections": flights["false_detections"].sum(),
            "recontacts": flights["recontacts"].sum(),
        }
        rows.append(row | (_hit_cells(hits) if len(hits) else {}))
    return table(pd.DataFrame(rows).fillna(""))


def _hit_cells(hits: pd.DataFrame) -> dict[str, object]:
    return {
        "at the first possible sample": hits["is_first_possible_sample"].sum(),
        "latency, mean / max [ms]": f"{hits['latency_ms'].mean():.1f} / {hits['latency_ms'].max():.1f}",
        "v_c error, RMS [%]": f"{100 * rms(hits['speed_error']):.1f}",
        "speed after the hit, mean [m/s]": f"{hits['rebound_speed_m_s'].mean():.2f}",
        "overshoot, max [m]": f"{hits['overshoot_m'].max():.3f}",
        "peak force, max [N]": f"{hits['peak_force_n'].max():.0f}",
    }


def stop_table() -> str:
    """Single head-on hits with the contact time and the restitution of the stop changed."""
    airframe, rows = load_built_in("foldable"), []
    for contact_time_s in CONTACT_TIMES_S:
        for restitution in RESTITUTIONS:
            data = airframe.model_dump()
            data["arms"]["stop"] = {"contact_time_s": contact_time_s, "restitution": restitution}
            is_own = data["arms"]["stop"] == airframe.arms.stop.model_dump()
            changed = Airframe.model_validate(data)
            hits = {f"{speed:g} m/s": head_on(changed, speed).hit for speed in STOP_SPEEDS_M_S}
            cells = {name: f"{hit.rebound_speed_m_s:.2f} m/s, {hit.peak_force_n:.0f} N" for name, hit in hits.items()}
            label = f"{1e3 * contact_time_s:g} ms, {restitution:g}" + (" (the airframe's)" if is_own else "")
            rows.append({"contact time, restitution": label, **cells})
    return table(rows)
