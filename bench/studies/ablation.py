"""`bench ablation`: what each special rule of the companion is worth, in drawn flights and to the detector."""

import math
import statistics
import tempfile
from argparse import Namespace
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np

from bench.cases.hits import HandCase, HitCase, draw_case, draw_hand
from bench.cases.mishaps import FAMILIES, FlightCase
from bench.cases.missions import MissionCase, flyable, random_mission
from bench.cases.vehicles import AIRFRAMES
from bench.fly.campaign import Campaign, Json, Workers, run_campaign
from bench.fly.lockstep import JudgedFlight, fly_in
from bench.fly.watching import FLOWN_WITH
from bench.fly.wire import JITTERY
from bench.rows.contacts import JudgedContact, Role, contacts_of
from bench.rows.heard import angle_deg, work_out_flight, work_out_hand, work_out_hit
from bench.rows.judge import failures
from bench.rows.recovered import recoveries
from bench.rows.tables import Page, table
from bench.studies.rules import RULES, Rule, switched
from sim_vehicle.truth import Hit

# At rest: slower than what a hover wavers by, for longer than a vehicle turns round.
RESTS_M_S, RESTS_S = 0.2, 0.4
# How long a vehicle is waited for.
LONGEST_S = 8.0
# Of so many hits in a row: as drawn, on a vehicle that shakes, over a bad link, on one that hovers.
KINDS: tuple[tuple[str, dict[str, Any]], ...] = (
    ("plain", {}),
    ("plain", {}),
    ("vibration", {"vibration_m_s2": 2.0}),
    ("link", {"link": JITTERY}),
    ("struck", {"is_struck": True}),
)
# One hand and one flight to so many hits.
HANDS_EVERY, FLIGHTS_EVERY = 10, 10
# What a recovery must show: past its setpoint, height lost, time to rest.
PAST_M, LOST_M, REST_S = 0.05, 0.10, 3.5
# What is compared of each hit, in which unit, to how many digits.
FIGURES: dict[str, tuple[str, float, int]] = {
    "rest_s": ("rest [s]", 1.0, 2),
    "past_m": ("past [cm]", 100.0, 1),
    "lost_m": ("lost [cm]", 100.0, 1),
    "normal_deg": ("normal [°]", 1.0, 1),
    "v_c_m_s": ("v_c [cm/s]", 100.0, 1),
}


def run_ablation(options: Namespace) -> int:
    """0 when the table is written, whatever it says; 1 when a flight failed to be flown."""
    page, workers = Page(options.out, "ablation"), Workers(options.jobs, options.scheduler)
    names = tuple(options.rule or (rule.name for rule in RULES))
    campaign = ablation_campaign(options.missions, options.first_seed, names)
    results = run_campaign(campaign, workers)
    rules, failed = [rule for rule in RULES if rule.name in names], results.text(campaign)
    parts = {"Flights": flights_table(rules, list(results.results.values()))}
    if options.hits is not None:
        heard = detections_campaign(options.hits, options.first_seed, names)
        detections = run_campaign(heard, workers)
        parts["The detector alone, at each rate"] = detections_table(rules, list(detections.results.values()))
        failed += detections.text(heard)
    page.write("What each special rule is worth: with it, less without", options.typed, parts)
    print(failed)
    return 1 if failed else 0


def ablation_campaign(missions: int, first_seed: int, names: tuple[str, ...]) -> Campaign:
    """`names`: of the rules that are looked at."""
    seeds = range(first_seed, first_seed + missions)
    cases = [(MissionCase(seed, kind, is_drawn=True), names) for seed in seeds for kind in AIRFRAMES]
    parameters = {"missions": missions, "first_seed": first_seed, "rules": list(names)}
    return Campaign("ablation", parameters, cases, work_out)


def work_out(case: tuple[MissionCase, tuple[str, ...]]) -> Json:
    """What became of the flight, and of its copies by rule."""
    mission, names = case
    drawn = random_mission(mission)
    rules = [rule for rule in RULES if rule.name in names]
    with tempfile.TemporaryDirectory() as folder, switched(rules) as copies:
        flight: JudgedFlight | None = None
        try:
            flight = fly_in(Path(folder), *flyable(mission, drawn))
        finally:
            copies.leave(lambda: {"failure": "the companion failed"} if flight is None else verdict(flight))
        return {"with": verdict(flight), "without": copies.found}


def verdict(flight: JudgedFlight) -> Json:
    """Of a flight as a whole, and of each recovery in it."""
    contacts = contacts_of(flight)
    hits = [contact for contact in contacts if contact.role is Role.HIT]
    found = zip(recoveries(flight, contacts), hits, strict=True)
    return {
        "failures": [failure.cause for failure in failures(flight)],
        "hits": [_of_one(flight, figures, contact) for figures, contact in found],
    }


def _of_one(flight: JudgedFlight, figures: Json, contact: JudgedContact) -> Json:
    found = {name: figures.get(name) for name in ("past_m", "lost_m", "risen_m", "returned", "closing_m_s")}
    found["rest_s"] = _rests_after_s(flight, contact.hit)
    if contact.collision is not None:
        told, hit = flight.report.collisions[contact.collision], contact.hit
        found["normal_deg"] = round(angle_deg(told.normal_ned, hit.normal_ned), 1)
        found["v_c_m_s"] = round(math.dist(told.impact_velocity_ned_m_s, hit.impact_velocity_ned_m_s), 3)
    return found


def _rests_after_s(flight: JudgedFlight, hit: Hit) -> float | None:
    """From the touch to the beginning of the first rest; None where there was none."""
    series = flight.truth.series
    since_s = 1e-6 * (series["time_boot_us"] - hit.contact_at_boot_us)
    looked_at = (since_s >= 0.0) & (since_s <= LONGEST_S)
    since_s = since_s[looked_at]
    moves = np.linalg.norm(series["velocity_ned_m_s"][looked_at], axis=1) > RESTS_M_S
    began_s = np.concatenate([[0.0], since_s[moves], since_s[-1:]])
    long = np.flatnonzero(np.diff(began_s) >= RESTS_S)
    return round(float(began_s[long[0]]), 3) if long.size else None


@dataclass(frozen=True, slots=True)
class DetectionCase:
    """Something to hear, and the rules that are looked at."""

    kind: str
    case: HitCase | HandCase | FlightCase
    names: tuple[str, ...]


def detections_campaign(hits: int, first_seed: int, names: tuple[str, ...]) -> Campaign:
    cases: list[tuple[str, Any]] = []
    for number in range(hits):
        seed, (family, settings) = first_seed + number, KINDS[number // 2 % len(KINDS)]
        cases.append((family, draw_case(family, seed, FLOWN_WITH, is_drawn=True, **settings)))
        if number % HANDS_EVERY == 0:
            cases.append(("hand", replace(draw_hand(seed, FLOWN_WITH), is_drawn=True)))
        if number % FLIGHTS_EVERY == 0:
            turn = number // FLIGHTS_EVERY
            family, airframe = list(FAMILIES)[turn // 2 % len(FAMILIES)], AIRFRAMES[turn % 2]
            cases.append(("flight", FlightCase(family, seed, airframe, FLOWN_WITH, is_drawn=True)))
    parameters = {"hits": hits, "first_seed": first_seed, "rules": list(names)}
    heard = [DetectionCase(kind, case, names) for kind, case in cases]
    return Campaign("ablation-detections", parameters, heard, work_out_heard)


def work_out_heard(heard: DetectionCase) -> Json:
    """What the detector said, by rate; and what it said without each rule that mattered."""
    rules = [rule for rule in RULES if rule.name in heard.names]
    with switched(rules) as copies:
        said: Json | None = None
        try:
            said = _said(heard)
        finally:
            copies.leave(lambda: {"failure": "the detector failed"} if said is None else said)
        return {"kind": heard.kind, "with": said, "without": copies.found}


def _said(heard: DetectionCase) -> Json:
    """By rate: hits found and when, and alarms that were none."""
    rates = _WORK[type(heard.case)](heard.case)["rates"]
    return {rate: _of_rate(found["detectors"][FLOWN_WITH[0]]) for rate, found in rates.items()}


def _of_rate(entry: Json) -> Json:
    """Of a hit, which has `false`; of a healthy flight or a hand, in which every alarm is one."""
    if "false" not in entry:
        return {"false": len(entry["alarms"] if "alarms" in entry else entry["collisions"])}
    return {"found": "latency_ms" in entry, "ms": entry.get("latency_ms"), "false": entry["false"]}


_WORK: dict[type, Callable[[Any], Json]] = {
    HitCase: work_out_hit,
    HandCase: work_out_hand,
    FlightCase: work_out_flight,
}


def flights_table(rules: Sequence[Rule], flights: Sequence[Json]) -> str:
    """Of each rule the flights in which it changed an answer: how they end, how hits recover, medians of changes."""
    rows: list[dict[str, object]] = []
    for rule in rules:
        known = [(one["with"], one["without"][rule.name]) for one in flights if rule.name in one["without"]]
        flown = [(kept, left) for kept, left in known if "hits" in left]
        ends = sum(_ends(kept) - _ends(left) for kept, left in known)
        recovers = sum(_recovered(kept) - _recovered(left) for kept, left in flown)
        changes = {label: _change(flown, key, times, digits) for key, (label, times, digits) in FIGURES.items()}
        counts = {"mattered": len(known), "ends": f"{ends:+d}", "recovers": f"{recovers:+d}"}
        rows.append({"rule": rule.name, "what it does": rule.does, **counts, **changes})
    return table(rows)


def detections_table(rules: Sequence[Rule], heard: Sequence[Json]) -> str:
    """Hits found, false alarms, and hits told sooner."""
    rows: list[dict[str, object]] = []
    for rule in rules:
        pairs = [(one["with"], one["without"][rule.name]) for one in heard if rule.name in one["without"]]
        rates = [(kept[rate], left[rate]) for kept, left in pairs if "failure" not in left for rate in kept]
        found = sum(kept.get("found", 0) - left.get("found", 0) for kept, left in rates)
        alarms = sum(kept["false"] - left["false"] for kept, left in rates)
        sooner = sum((left.get("ms") or 0.0) > (kept.get("ms") or math.inf) for kept, left in rates)
        changes = {"found": f"{found:+d}", "alarms": f"{alarms:+d}", "sooner": sooner}
        rows += [{"rule": rule.name, "mattered": len(pairs), **changes}] if pairs else []
    return table(rows)


def _ends(found: Json) -> bool:
    return not found.get("failures", True)


def _recovered(found: Json) -> int:
    return sum(_is_recovered(hit) for hit in found["hits"])


def _is_recovered(hit: Json) -> bool:
    known = all(hit[name] is not None for name in ("past_m", "lost_m", "rest_s"))
    is_near = known and hit["past_m"] <= PAST_M and hit["lost_m"] <= LOST_M
    return is_near and hit["rest_s"] <= REST_S and not hit["returned"]


def _change(pairs: Sequence[tuple[Json, Json]], name: str, times: float, digits: int) -> str:
    same = [(kept["hits"], left["hits"]) for kept, left in pairs if len(kept["hits"]) == len(left["hits"])]
    figures = [(a.get(name), b.get(name)) for kept, left in same for a, b in zip(kept, left, strict=True)]
    changes = [times * (a - b) for a, b in figures if a is not None and b is not None]
    return f"{statistics.median(changes):+.{digits}f}" if changes else "–"
