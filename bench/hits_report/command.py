"""`bench hits`: flies hits alone and writes build/hits.md."""

from argparse import Namespace
from collections.abc import Iterator

from bench.campaign.plan import Campaign
from bench.campaign.run import Results, Workers, failures_text, run_campaign
from bench.hits.flight import flown_campaign, fly
from bench.hits.verdicts import HITS_AN_APPROACH, Approach, verdict_campaign
from bench.hits.worst import FIGURES, worst_campaign
from bench.hits_report import verdicts
from bench.hits_report.cells import Flown, approaches, cells, lead, seeds
from bench.hits_report.cost import BUDGETED, budget, cost
from bench.hits_report.growth import grown
from bench.hits_report.worst import keep, worst
from bench.marked import checked_text, write_part
from bench.stamps import FLOWN, stamp_text

PART, TITLE = "hits", "Hits alone"
APPROACHES_BUDGETED = 4


def run_hits(options: Namespace) -> int:
    """0 when it is written, whatever it says; 1 when a hit failed to be flown, or depends on who flies it."""
    part = options.part or PART
    checked_text(options.out, part, TITLE)
    workers, is_drawn = Workers(options.jobs, options.scheduler), options.vehicles == "drawn"
    if part == "growth":
        is_good, lines = grown(options.hits, options.first_seed, is_drawn, workers)
    else:
        campaign = _campaign(part, options.hits, options.first_seed, is_drawn)
        results = run_campaign(campaign, workers)
        failed = failures_text(campaign, results)
        lines = [*_lines(part, campaign, results), failed]
        if part in FIGURES and options.corpus is not None:
            for at, numbers in results.results.items():
                case = campaign.cases[at]
                keep(case, numbers, options.corpus / f"{case.airframe}-{case.imu_hz}")
        is_good = not failed and all(one.get("agrees", True) for one in results.results.values())
    write_part(options.out, part, "\n".join([f"{_stamp(options, part)}:", *lines, ""]), TITLE)
    print(f"Written to {options.out}.")
    return 0 if is_good else 1


def _campaign(part: str, hits: int, first_seed: int, is_drawn: bool) -> Campaign:
    if part in FIGURES:
        return worst_campaign(part, hits, first_seed)
    return (verdict_campaign if part == "verdicts" else flown_campaign)(hits, first_seed, is_drawn)


def _lines(part: str, campaign: Campaign, results: Results) -> Iterator[str]:
    cases, known = campaign.cases, results.results
    if part in FIGURES:
        yield from worst(cases, known)
    elif part == "verdicts":
        hits = verdicts.judged(cases, known)
        yield from (*verdicts.lead(known, hits), *verdicts.cells(hits), *verdicts.seeds(known, cases, hits))
        yield from verdicts.cost(known)
        few = cases[:APPROACHES_BUDGETED]
        yield from budget(lambda: [list(Approach(case).hits()) for case in few], HITS_AN_APPROACH * len(few))
    else:
        flown, few = Flown(cases, known), cases[:BUDGETED]
        yield from (*lead(flown), *cells(flown), *approaches(flown), *seeds(flown), *cost(flown))
        yield from budget(lambda: [fly(case) for case in few], len(few))


def _stamp(options: Namespace, part: str) -> str:
    option = f" {'--worst ' if part in FIGURES else '--'}{part}" * (part != PART)
    other = option + " --scheduler ADDRESS" * (options.scheduler is not None)
    vehicles = f" --vehicles {options.vehicles}" * (part not in FIGURES)
    command = f"python -m bench hits --hits {options.hits} --first-seed {options.first_seed}"
    return stamp_text(f"{command}{vehicles}{other}", (*FLOWN, "bench/hits"))
