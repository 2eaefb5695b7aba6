"""What a hit costs: of a processor, of memory, and by part."""

import statistics
from collections.abc import Iterator, Sequence

from bench.campaign.plan import Json
from bench.detectors_report.numbers import percentile
from bench.hits.flight import fly
from bench.hits_report.cells import Flown
from bench.speed.budget import measured_budget
from bench.speed.parts import COMPANION, KERNEL, PLANT

# An hour on two cores, in milliseconds; hits an hour that are wanted, through the wire and without it.
TWO_CORES_MS, WANTED, WANTED_WITHOUT_WIRE = 2 * 3_600_000.0, 300_000, 1_000_000
# What is left without the wire and the autopilot: the companion and the body.
BARE = (KERNEL, PLANT, COMPANION)
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
    """Of the first hits, flown again and again in this process."""
    cases = flown.cases[:BUDGETED]

    def run() -> None:
        for case in cases:
            fly(case)

    run()  # what is imported or compiled at first counts for nothing
    found = measured_budget(REPEATS, run, COMPANION)
    hit_ms = {name: 1e-3 * us * found.intervals / len(cases) for name, us in found.mean_us.items() if us}
    yield f"Of the first {len(cases)} hits, each flown {REPEATS} times, the least that a part takes in an interval."
    yield f"{found.intervals / len(cases):.0f} intervals a hit:"
    yield ""
    yield "| part | ms a hit | µs an interval |"
    yield "|---|---|---|"
    for name, ms in hit_ms.items():
        yield f"| {name} | {ms:.1f} | {found.mean_us[name]:.1f} |"
    together_ms = sum(hit_ms.values())
    yield f"| together | {together_ms:.1f} | {found.total_us:.1f} |"
    yield ""
    yield f"That would be {TWO_CORES_MS / together_ms:,.0f} hits an hour on two cores."
    bare_ms = sum(hit_ms[name] for name in BARE)
    yield f"Without bytes and autopilot, companion and body alone, a hit would take {bare_ms:.0f} ms."
    yield f"{WANTED_WITHOUT_WIRE:,} an hour on two cores are {TWO_CORES_MS / WANTED_WITHOUT_WIRE:.1f} ms; the compiled"
    yield f"kernel alone takes {hit_ms[KERNEL]:.1f} ms."
    yield ""
