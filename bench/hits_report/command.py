"""`bench hits`: flies hits alone and writes bench/notes/hits.md."""

from argparse import Namespace

from bench.campaign.run import Workers, failures_text, run_campaign
from bench.hits.flight import flown_campaign
from bench.hits_report.cells import Flown, approaches, cells, lead, seeds
from bench.hits_report.cost import budget, cost
from bench.hits_report.growth import grown
from bench.marked import checked_text, write_part
from bench.stamps import FLOWN, stamp_text

PART, GROWTH_PART, TITLE = "hits", "growth", "Hits alone"


def run_hits(options: Namespace) -> int:
    """0 when it is written, whatever it says; 1 when a hit failed to be flown, or depends on who flies it."""
    part = GROWTH_PART if options.growth else PART
    checked_text(options.out, part, TITLE)
    workers, is_drawn = Workers(options.jobs, options.scheduler), options.vehicles == "drawn"
    if options.growth:
        is_good, lines = grown(options.hits, options.first_seed, is_drawn, workers)
    else:
        campaign = flown_campaign(options.hits, options.first_seed, is_drawn)
        results = run_campaign(campaign, workers)
        flown, failed = Flown(campaign.cases, results.results), failures_text(campaign, results)
        is_good, lines = not failed, [*lead(flown), *cells(flown), *approaches(flown), *seeds(flown)]
        lines += [*cost(flown), *budget(flown), failed]
    write_part(options.out, part, "\n".join([f"{_stamp(options)}:", *lines, ""]), TITLE)
    print(f"Written to {options.out}.")
    return 0 if is_good else 1


def _stamp(options: Namespace) -> str:
    growth = " --growth" * options.growth + " --scheduler ADDRESS" * (options.scheduler is not None)
    command = f"python -m bench hits --hits {options.hits} --first-seed {options.first_seed}"
    return stamp_text(f"{command} --vehicles {options.vehicles}{growth}", (*FLOWN, "bench/hits"))
