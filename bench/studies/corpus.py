"""`bench corpus`: flights kept as bytes and truth; what this version of the code makes of them, and two versions."""

import json
import math
import shutil
import statistics
from argparse import Namespace
from collections.abc import Iterator, Sequence
from pathlib import Path

from bench.cases.missions import MissionCase, flyable, random_mission
from bench.cases.vehicles import AIRFRAMES
from bench.fly.campaign import Campaign, CampaignError, Json, Results, Workers, run_campaign, worked_out
from bench.fly.lockstep import flown_in
from bench.fly.watching import FLOWN_WITH
from bench.rows.heard import angle_deg
from bench.rows.tables import Page, percentile, rms, text_of
from bench.studies.detectors import healthy_campaign, injected_campaign
from companion.reflex.impact import ImpactEstimate
from rebound_cli.documents import load_document
from rebound_cli.inputs import SimulatedWorld, mission_from, resolved
from rebound_cli.logs.reader import read_log
from rebound_cli.replay.watching import Findings, watch_log
from rebound_cli.results.run_folder import RESOLVED_NAME, TLOG_NAME, TRUTH_NAME, write_json, write_yaml
from rebound_cli.results.truth_match import index_of_hit
from rebound_cli.simulation.lockstep import EPOCH_US
from sim_vehicle.shell.truth_file import load_truth, save_truth
from sim_vehicle.truth import Hit

# As recorded, and as PX4 would have sent HIGHRES_IMU of it when asked for so much.
ASKED_HZ = {"recorded": None, "50": 50.0}
# Each recorded impact so often, each time in another flight.
ROUNDS = 4
# Hits with less change of velocity are counted apart: five times a good estimate's noise of 0.03 m/s.
VISIBLE_M_S = 0.15
MOST_LISTED = 40


def run_record(options: Namespace) -> int:
    Page(options.folder, "corpus")
    seeds = range(options.first_seed, options.first_seed + options.missions)
    cases = [MissionCase(seed, kind, is_drawn=True) for seed in seeds for kind in AIRFRAMES]
    places = [(options.folder / f"{case.airframe}-{case.seed}", case) for case in cases]
    worked_out(record, places, Workers(options.jobs))
    print(f"{options.folder}: {len(flights(options.folder))} flights.")
    return 0


def record(place: tuple[Path, MissionCase]) -> None:
    """Fly it into the folder, unless that is there; one that is there is whole."""
    folder, case = place
    if folder.exists():
        return
    mission, scene, airframe = flyable(case, random_mission(case))
    unfinished = folder.with_suffix(".unfinished")
    shutil.rmtree(unfinished, ignore_errors=True)
    unfinished.mkdir(parents=True)
    _, truth, _ = flown_in(unfinished, mission, scene, airframe)
    write_yaml(unfinished / RESOLVED_NAME, resolved(mission, SimulatedWorld(scene, airframe)))
    save_truth(unfinished / TRUTH_NAME, truth, EPOCH_US)
    unfinished.rename(folder)


def flights(folder: Path) -> list[Path]:
    """Every folder below with bytes and truth, in the order of their names."""
    return sorted(file.parent for file in folder.rglob(TRUTH_NAME) if (file.parent / TLOG_NAME).exists())


def run_judge(options: Namespace) -> int:
    """0 when every flight has its verdict, whatever it is; 1 when one could not be read."""
    found = flights(options.folder)
    if not found:
        raise CampaignError(f"{options.folder}: no run folder with {TLOG_NAME} and {TRUTH_NAME} in it.")
    Page(options.out.parent, "corpus")
    workers = Workers(options.jobs, options.scheduler)
    names = [str(folder.relative_to(options.folder)) for folder in found]
    campaign = Campaign("corpus", {"flights": names}, [str(folder.resolve()) for folder in found], work_out)
    results = run_campaign(campaign, workers)
    verdicts: Json = {"version": campaign.version, "flights": {names[n]: r for n, r in results.results.items()}}
    failed = results.text(campaign)
    if options.data is not None:
        parts = {"healthy": healthy_campaign(options.data, FLOWN_WITH)}
        parts["impacts"] = injected_campaign(options.data, ROUNDS, FLOWN_WITH)
        heard: dict[str, Results] = {name: run_campaign(part, workers) for name, part in parts.items()}
        verdicts["recorded"] = {name: [one["rates"] for one in part.results.values()] for name, part in heard.items()}
        failed += "".join(heard[name].text(part) for name, part in parts.items())
    write_json(options.out, verdicts)
    print(f"{failed}Written to {options.out}.")
    return 1 if failed else 0


def work_out(folder_name: str) -> Json:
    """By rate: each true hit with what was told of it, and collisions told that were none."""
    folder = Path(folder_name)
    log, settings = read_log(folder / TLOG_NAME), mission_from(load_document(folder / RESOLVED_NAME)).companion
    hits, _, _ = load_truth(folder / TRUTH_NAME)
    rates = {rate: verdict(watch_log(log, settings, hz), hits) for rate, hz in ASKED_HZ.items()}
    return {"seconds": log.duration_s, "rates": rates}


def verdict(findings: Findings, hits: Sequence[Hit]) -> Json:
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


def _hit(hit: Hit, told: ImpactEstimate | None) -> Json:
    change = math.dist(hit.impact_velocity_ned_m_s, hit.rebound_velocity_ned_m_s)
    row: Json = {"contact_boot_us": round(hit.contact_at_boot_us), "change_m_s": round(change, 4)}
    if told is None:
        return row
    return row | {
        "latency_ms": round(1e-3 * (told.impact.sample_time_boot_us - hit.contact_at_boot_us), 3),
        "velocity_error_m_s": round(math.dist(told.velocity_ned_m_s, hit.impact_velocity_ned_m_s), 4),
        "normal_error_deg": round(angle_deg(told.normal.direction_ned, hit.normal_ned), 2),
    }


def run_compare(options: Namespace) -> int:
    print(comparison_text(_read(options.old), _read(options.new)))
    return 0


def _read(file: Path) -> Json:
    try:
        verdicts: Json = json.loads(file.read_text(encoding="utf-8"))
        verdicts["flights"]
    except (OSError, ValueError, KeyError, TypeError) as error:
        text = f"{file}: no verdicts in it; `python -m bench corpus judge` writes such a file."
        raise CampaignError(text) from error
    return verdicts


def comparison_text(old: Json, new: Json) -> str:
    """A table of figures old and new, then the flights that differ. Only what both have counts."""
    both = [name for name in old["flights"] if name in new["flights"]]
    lines = [f"{len(both)} flights", "", f"{'':<44}{'old':>12}{'new':>12}"]
    for rate in ASKED_HZ:
        sides = [_figures([side["flights"][name]["rates"][rate] for name in both]) for side in (old, new)]
        lines += [f"{f'{rate}: {name}':<44}{sides[0][name]:>12}{sides[1][name]:>12}" for name in sides[0]]
    if "recorded" in old and "recorded" in new:
        sides = [_recorded(side["recorded"]) for side in (old, new)]
        lines += [f"{name:<44}{sides[0][name]:>12}{sides[1][name]:>12}" for name in sides[0]]
    changed = list(_changed(both, old, new))
    lines += ["", *changed[:MOST_LISTED]]
    if len(changed) > MOST_LISTED:
        lines.append(f"and {len(changed) - MOST_LISTED} more")
    return "\n".join(lines)


def _figures(verdicts: Sequence[Json]) -> dict[str, str]:
    hits = [hit for verdict in verdicts for hit in verdict["hits"]]
    plain = [hit for hit in hits if hit["change_m_s"] >= VISIBLE_M_S]
    faint = [hit for hit in hits if hit["change_m_s"] < VISIBLE_M_S]
    found = [hit for hit in plain if "latency_ms" in hit]
    late = [hit["latency_ms"] for hit in found]
    normals = [hit["normal_error_deg"] for hit in found]
    return {
        "hits found": f"{len(found)}/{len(plain)}",
        f"of those under {VISIBLE_M_S:g} m/s": f"{sum('latency_ms' in hit for hit in faint)}/{len(faint)}",
        "told, and none": str(sum(len(verdict["false_boot_us"]) for verdict in verdicts)),
        "ms late, median": text_of(percentile(late, 50)),
        "ms late, 99 %": text_of(percentile(late, 99)),
        "velocity error, RMS m/s": f"{rms(hit['velocity_error_m_s'] for hit in found):.3f}",
        "normal error, median deg": f"{statistics.median(normals):.1f}" if normals else "–",
        "normal error, 95 % deg": text_of(percentile(normals, 95)),
    }


def _recorded(recorded: Json) -> dict[str, str]:
    """Of the real logs: collisions told, which in one of them are true; and recorded impacts found in them."""
    figures = {}
    (name,) = FLOWN_WITH
    for rate in recorded["healthy"][0]:
        told = sum(len(rates[rate][name]["collisions"]) for rates in recorded["healthy"])
        figures[f"real logs, {rate} Hz: collisions told"] = str(told)
    for rate in recorded["impacts"][0]:
        entries = [rates[rate][name] for rates in recorded["impacts"]]
        found = sum("latency_ms" in entry for entry in entries)
        figures[f"recorded impacts, {rate} Hz: found"] = f"{found}/{len(entries)}"
        figures[f"recorded impacts, {rate} Hz: told before"] = str(sum(entry["false"] for entry in entries))
    return figures


def _changed(names: Sequence[str], old: Json, new: Json) -> Iterator[str]:
    """A line for each flight and rate in which other hits are found, or others told that are none."""
    for name in names:
        for rate in ASKED_HZ:
            before, after = (side["flights"][name]["rates"][rate] for side in (old, new))
            pairs = list(zip(before["hits"], after["hits"], strict=True))
            lost = sum("latency_ms" in a and "latency_ms" not in b for a, b in pairs)
            won = sum("latency_ms" in b and "latency_ms" not in a for a, b in pairs)
            more = len(after["false_boot_us"]) - len(before["false_boot_us"])
            if lost or won or more:
                yield f"{name}, {rate}: {won} hits won, {lost} lost, {more:+d} told that are none"
