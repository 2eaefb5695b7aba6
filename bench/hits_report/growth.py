"""Whether the thousandth hit costs as much as the first, here and on the workers of a scheduler."""

import statistics
import tempfile
from collections.abc import Mapping, Sequence
from pathlib import Path

from bench.campaign.plan import Json
from bench.campaign.run import RECORDS_FOLDER, Workers, run_campaign
from bench.hits.flight import flown_campaign
from bench.hits_report.cells import Flown, cells
from bench.hits_report.cost import seconds_ms


def grown(most: int, first_seed: int, is_drawn: bool, workers: Workers) -> tuple[bool, list[str]]:
    """Whether all give the same table, and the lines of the note.

    A longer campaign goes on where a shorter one ends. So its first ten hits are the campaign of ten.
    """
    campaign, rows, tables = flown_campaign(most, first_seed, is_drawn), [], set()
    with tempfile.TemporaryDirectory() as folder:
        places = {"of this command": (Workers(workers.jobs), RECORDS_FOLDER)}
        if workers.scheduler is not None:
            places["of a scheduler"] = (workers, Path(folder))
        for place, (those, where) in places.items():
            results = run_campaign(campaign, those, where).results
            tables.add("\n".join(cells(Flown(campaign.cases, results))))
            rows += _rows(place, results)
    head = ["| workers | hits | a second of flight, ms of a processor | memory of a worker, MB |", "|---|---|---|---|"]
    is_same = len(tables) == 1
    return is_same, ["", *head, *rows, "", f"The tables of the hits are {'' if is_same else 'not '}the same.", ""]


def _rows(place: str, results: Mapping[int, Json]) -> list[str]:
    everyone = list(results.values())
    sizes = sorted({10**power for power in range(6) if 10**power < len(everyone)} | {len(everyone)})
    return [f"| {place} | {size} | {_cells(everyone[size - max(1, size // 10) : size])} |" for size in sizes]


def _cells(results: Sequence[Json]) -> str:
    """Medians of the last tenth."""
    memory_mb = statistics.median(one["cost"]["memory_mb"] for one in results)
    return f"{statistics.median(seconds_ms(results)):.1f} | {memory_mb:.0f}"
