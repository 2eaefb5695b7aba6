"""What a detector makes of a hit, a hand or a healthy flight with and without each of its rules.

Hits, hands and flights are of drawn vehicles; with `--data` there are recorded flights and recorded impacts, too.
"""

from collections.abc import Callable
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

from bench.ablation.rules import RULES
from bench.ablation.switching import switched
from bench.campaign.plan import Campaign, Json
from bench.detectors.campaigns import healthy_campaign, injected_campaign
from bench.detectors.flights import FlightCase, work_out_flight
from bench.detectors.hands import HandCase, draw_hand, work_out_hand
from bench.detectors.hits import HitCase, draw_case, work_out_hit
from bench.detectors.links import JITTERY
from bench.detectors.mishaps import FAMILIES
from bench.detectors.recorded import HealthyCase, InjectedCase, work_out_healthy, work_out_injected
from bench.detectors.vehicles import AIRFRAMES
from bench.detectors.watching import FLOWN_WITH

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
# Recorded impacts are put into so many flights each.
ROUNDS = 1


@dataclass(frozen=True, slots=True)
class DetectionCase:
    """Something to hear, and the rules that are looked at."""

    kind: str
    case: HitCase | HandCase | FlightCase | HealthyCase | InjectedCase
    names: tuple[str, ...]


def detections_campaign(hits: int, first_seed: int, names: tuple[str, ...], data: Path | None) -> Campaign:
    """`data`: the folder of recorded flights and impacts."""
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
    if data is not None:
        cases += [("recorded flight", case) for case in healthy_campaign(data, FLOWN_WITH).cases]
        cases += [("recorded impact", case) for case in injected_campaign(data, ROUNDS, FLOWN_WITH).cases]
    parameters = {"hits": hits, "first_seed": first_seed, "rules": list(names), "recorded": data is not None}
    heard = [DetectionCase(kind, case, names) for kind, case in cases]
    return Campaign("ablation-detections", parameters, heard, work_out, uses=("bench.detectors", "bench.baselines"))


def work_out(heard: DetectionCase) -> Json:
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
    return {rate: _of_rate(found.get("detectors", found)[FLOWN_WITH[0]]) for rate, found in rates.items()}


def _of_rate(entry: Json) -> Json:
    """Of a hit, which has `false`; of a healthy flight or a hand, in which every alarm is one."""
    if "false" not in entry:
        return {"false": len(entry["alarms"] if "alarms" in entry else entry["collisions"])}
    return {"found": "latency_ms" in entry, "ms": entry.get("latency_ms"), "false": entry["false"]}


_WORK: dict[type, Callable[[Any], Json]] = {
    HitCase: work_out_hit,
    HandCase: work_out_hand,
    FlightCase: work_out_flight,
    HealthyCase: work_out_healthy,
    InjectedCase: work_out_injected,
}
