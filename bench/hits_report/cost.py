"""What a hit costs: of a processor, of memory, and by part."""

import statistics
from collections.abc import Iterator, Sequence
from functools import partial

from bench.campaign.plan import Json
from bench.detectors_report.numbers import percentile
from bench.hits.flight import fly
from bench.hits_report.cells import Flown
from bench.speed.budget import spent_ms
from bench.speed.parts import COMPANION, KERNEL, PARTS, PLANT

# An hour on two cores, in milliseconds; hits an hour that are wanted, through the wire and without it.
TWO_CORES_MS, WANTED, WANTED_WITHOUT_WIRE = 2 * 3_600_000.0, 300_000, 1_000_000
# What is left without the wire and the autopilot: the companion and the body.
BARE = (KERNEL, PLANT, COMPANION)
BUDGETED, REPEATS = 30, 6


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
    yield "| | the least disturbed tenth | median |"
    yield "|---|---|---|"
    second = [percentile(seconds_ms(everyone), share) for share in (10, 50)]
    parse = [percentile(parse_us, share) for share in (10, 50)]
    for name, values, digits in (
        ("a second of flight, ms of a processor", second, 1),
        ("hits an hour on two cores", [TWO_CORES_MS / (lasts_s * one) for one in second], 0),
        ("a parse, µs", parse, 2),
    ):
        yield f"| {name} | {' | '.join(f'{value:,.{digits}f}' for value in values)} |"
    yield ""


def seconds_ms(results: Sequence[Json]) -> list[float]:
    """Of a processor, for a second of flight, hit by hit."""
    return [1e3 * one["cost"]["processor_s"] / one["seconds"] for one in results]


def budget(flown: Flown) -> Iterator[str]:
    """Of the first hits, flown again and again in this process: of each part the least, hit by hit."""
    cases, intervals = flown.cases[:BUDGETED], 0
    spent = dict.fromkeys((part.name for part in PARTS), 0.0)
    for case in cases:
        vehicle, _, _ = fly(case)
        intervals += vehicle.time_boot_us // vehicle.interval_us
        runs = [spent_ms(partial(fly, case)) for _ in range(REPEATS)]
        for name in spent:
            spent[name] += min(run[name] for run in runs)
    yield f"{len(cases)} flown {REPEATS} times, {intervals / len(cases):.0f} intervals a hit; of each part the least:"
    yield ""
    yield "| part | ms a hit | µs an interval |"
    yield "|---|---|---|"
    for name, ms in [*spent.items(), ("together", sum(spent.values()))]:
        if ms:
            yield f"| {name} | {ms / len(cases):.1f} | {1e3 * ms / intervals:.1f} |"
    yield ""
    bare_ms, kernel_ms = sum(spent[name] for name in BARE) / len(cases), spent[KERNEL] / len(cases)
    yield f"Without bytes and autopilot, companion and body alone, a hit would take {bare_ms:.0f} ms."
    yield f"{WANTED_WITHOUT_WIRE:,} an hour on two cores are {TWO_CORES_MS / WANTED_WITHOUT_WIRE:.1f} ms; the compiled"
    yield f"kernel alone takes {kernel_ms:.1f} ms."
    yield ""
