"""`bench ablation`: a table of what each special rule is worth, written into a note."""

import math
import statistics
from argparse import Namespace
from collections.abc import Iterator, Sequence

from bench.ablation.detections import detections_campaign
from bench.ablation.flights import ablation_campaign
from bench.ablation.rules import RULES, Rule
from bench.campaign.plan import Campaign, Json
from bench.campaign.run import Results, Workers, failures_text, run_campaign
from bench.marked import checked_text, write_part

PART, TITLE = "ablation", "What each special rule is worth"
# What a recovery must show: past its setpoint, height lost, time to rest.
PAST_M, LOST_M, REST_S = 0.05, 0.10, 3.5


def run_ablation(options: Namespace) -> int:
    """0 when the table is written, whatever it says; 1 when a flight failed to be flown."""
    options.out.parent.mkdir(parents=True, exist_ok=True)
    checked_text(options.out, PART, TITLE)
    names = tuple(options.rule or (rule.name for rule in RULES))
    campaign = ablation_campaign(options.missions, options.first_seed, names)
    workers = Workers(options.jobs, options.scheduler)
    results = run_campaign(campaign, workers)
    text, failed = table(campaign, results), bool(results.failures)
    if options.hits is not None:
        heard = detections_campaign(options.hits, options.first_seed, names, options.data)
        detections = run_campaign(heard, workers)
        text += detections_table(heard, detections)
        failed |= bool(detections.failures)
    write_part(options.out, PART, text, TITLE)
    print(f"Written to {options.out}.")
    return 1 if failed else 0


def table(campaign: Campaign, results: Results) -> str:
    """What stands between the note's marks."""
    lines = _lines(list(results.results.values()), campaign)
    return "\n".join([*lines, failures_text(campaign, results), ""])


def detections_table(campaign: Campaign, results: Results) -> str:
    """The same of the detector alone."""
    lines = _detection_lines(list(results.results.values()), campaign)
    return "\n".join(["", *lines, failures_text(campaign, results), ""])


def _detection_lines(heard: Sequence[Json], campaign: Campaign) -> Iterator[str]:
    kinds = sorted({case["kind"] for case in heard})
    counted = ", ".join(f"{sum(case['kind'] == kind for case in heard)} {kind}" for kind in kinds)
    yield f"The detector alone, at each rate (`--hits {campaign.parameters['hits']}`): {counted}."
    yield "`found`: hits found, with the rule less without; `alarms`: of false ones, or of hands taken for hits;"
    yield "`sooner`: hits told earlier with it."
    yield ""
    yield "| rule | mattered | found | alarms | sooner |"
    yield "|---|---|---|---|---|"
    for rule in RULES:
        pairs = [(case["with"], case["without"][rule.name]) for case in heard if rule.name in case["without"]]
        if pairs:
            yield _detection_row(rule, pairs)


def _detection_row(rule: Rule, pairs: Sequence[tuple[Json, Json]]) -> str:
    rates = [(kept[rate], left[rate]) for kept, left in pairs if "failure" not in left for rate in kept]
    found = sum(kept.get("found", 0) - left.get("found", 0) for kept, left in rates)
    alarms = sum(kept["false"] - left["false"] for kept, left in rates)
    sooner = sum((left.get("ms") or 0.0) > (kept.get("ms") or math.inf) for kept, left in rates)
    return f"| {rule.name} | {len(pairs)} | {found:+d} | {alarms:+d} | {sooner} |"


def _lines(flights: Sequence[Json], campaign: Campaign) -> Iterator[str]:
    missions, first = (campaign.parameters[name] for name in ("missions", "first_seed"))
    hits = [hit for flight in flights for hit in flight["with"]["hits"]]
    yield f"`python -m bench ablation --missions {missions} --first-seed {first}` (version {campaign.version}):"
    yield f"{len(flights)} flights of drawn vehicles, {len(hits)} hits. A rule's row is about the flights in which it"
    yield "changed an answer: `mattered`. `ends`: flights that end as their mission says, with the rule less without."
    yield "`recovers`: the same of hits that are at most 5 cm past, lose at most 10 cm, do not come back and rest"
    yield "within 3.5 s. Then the medians of what the rule changes, with the rule less without: time to rest, way past"
    yield "the setpoint, height lost, error of the normal and of v_c; over the hits of flights with as many hits."
    yield ""
    yield "| rule | | mattered | ends | recovers | rest, s | past, cm | lost, cm | normal, ° | v_c, cm/s |"
    yield "|---|---|---|---|---|---|---|---|---|---|"
    for rule in RULES:
        if rule.name in campaign.parameters["rules"]:
            yield _row(rule, [(flight["with"], flight["without"].get(rule.name)) for flight in flights])


def _row(rule: Rule, pairs: Sequence[tuple[Json, Json | None]]) -> str:
    known = [(kept, left) for kept, left in pairs if left is not None]
    flown = [(kept, left) for kept, left in known if "hits" in left]
    ends = sum(_ends(kept) - _ends(left) for kept, left in known)
    recovers = sum(_recovered(kept) - _recovered(left) for kept, left in flown)
    figures = [("rest_s", 1.0, 2), ("past_m", 100.0, 1), ("lost_m", 100.0, 1), ("normal_deg", 1.0, 1)]
    figures.append(("v_c_m_s", 100.0, 1))
    changes = [_change(flown, name, times, digits) for name, times, digits in figures]
    return f"| {rule.name} | {rule.does} | {len(known)} | {ends:+d} | {recovers:+d} | {' | '.join(changes)} |"


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
