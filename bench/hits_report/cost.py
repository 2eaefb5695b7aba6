"""What a hit costs: of a processor, of memory, and by part."""

import statistics
from collections.abc import Callable, Iterator, Sequence

from bench.campaign.plan import Json
from bench.detectors_report.numbers import percentile
from bench.hits_report.cells import Flown
from bench.speed.budget import measured_budget
from bench.speed.parts import COMPANION

# An hour on two cores, in milliseconds; hits an hour that are wanted.
TWO_CORES_MS, WANTED = 2 * 3_600_000.0, 300_000
BUDGETED, REPEATS = 20, 5


def cost(flown: Flown) -> Iterator[str]:
    everyone = list(flown.results.values())
    lasts_s = statistics.fmean(one["seconds"] for one in everyone)
    parse_us = [one["cost"]["parse_us"] for one in everyone]
    yield "### What a hit costs"
    yield ""
    yield f"A hit lasts {lasts_s:.2f} s, the approach included. {WANTED:,} an hour on two cores would be"
    yield f"{TWO_CORES_MS / WANTED:.0f} ms a hit, {lasts_s * 1e3 * WANTED / TWO_CORES_MS:.0f} times real time."
    yield "Each process also times pymavlink's parse of a HIGHRES_IMU, after each hit."
    yield ""
    yield from costs("a second of flight", seconds_ms(everyone), lasts_s, parse_us)


def costs(what: str, spent_ms: Sequence[float], in_a_hit: float, parse_us: Sequence[float]) -> Iterator[str]:
    """Of a processor: for something that happens so often in a hit."""
    yield "| | the least disturbed tenth | median |"
    yield "|---|---|---|"
    spent, parse = ([percentile(values, share) for share in (10, 50)] for values in (spent_ms, parse_us))
    for name, values, digits in (
        (f"{what}, ms of a processor", spent, 2),
        ("hits an hour on two cores", [TWO_CORES_MS / (in_a_hit * one) for one in spent], 0),
        ("a parse, µs", parse, 2),
    ):
        yield f"| {name} | {' | '.join(f'{value:,.{digits}f}' for value in values)} |"
    yield ""


def seconds_ms(results: Sequence[Json]) -> list[float]:
    """Of a processor, for a second of flight, hit by hit."""
    return [1e3 * one["cost"]["processor_s"] / one["seconds"] for one in results]


def budget(run: Callable[[], object], hits: int) -> Iterator[str]:
    """Of so many hits, flown again and again in this process."""
    run()  # what is imported or compiled at first counts for nothing
    found = measured_budget(REPEATS, run, COMPANION)
    hit_ms = {name: 1e-3 * us * found.intervals / hits for name, us in found.mean_us.items() if us}
    yield f"Of the first {hits} hits, each flown {REPEATS} times, the least that a part takes in an interval."
    yield f"{found.intervals / hits:.0f} intervals a hit:"
    yield ""
    yield "| part | ms a hit | µs an interval |"
    yield "|---|---|---|"
    for name, ms in hit_ms.items():
        yield f"| {name} | {ms:.2f} | {found.mean_us[name]:.1f} |"
    together_ms = sum(hit_ms.values())
    yield f"| together | {together_ms:.2f} | {found.total_us:.1f} |"
    yield ""
    bytes_ms = sum(ms for name, ms in hit_ms.items() if "MAVLink" in name)
    yield f"The four parts of MAVLink take {100 * bytes_ms / together_ms:.0f} % of it."
    yield ""
