"""The default detector beside the baseline, a fixed threshold over a window of samples, on the same data."""

from collections.abc import Mapping, Sequence

from bench.detectors.flights import FlightCase
from bench.detectors.scoring import FOUND_WITHIN_US
from bench.detectors.vehicles import AIRFRAMES
from bench.detectors.watching import ASKED_HZ
from bench.detectors_report.bars import Bar
from bench.detectors_report.flights import alarms
from bench.detectors_report.hits import DEFAULT, plain
from bench.detectors_report.numbers import Entry, Hits, Scored, percentile, text_of
from bench.paper.table import markdown

BASELINE = "threshold"
EARLIER_BAR = 10.0
FOUND_WITHIN_MS = 1e-3 * FOUND_WITHIN_US

COLUMNS = (
    "airframe, Hz",
    "hits",
    f"missed, {BASELINE}",
    f"missed, {DEFAULT}",
    f"latency, median [ms], {BASELINE}",
    f"latency, median [ms], {DEFAULT}",
    "times earlier, median of the hits that both found",
)


def pairs(hits: Hits, airframe: str, rate: int) -> list[tuple[Scored, Scored]]:
    """The same hits as the baseline and as the default saw them."""
    theirs, ours = hits.scored(BASELINE, rate, plain(airframe)), hits.scored(DEFAULT, rate, plain(airframe))
    return [(a, b) for a, b in zip(theirs, ours, strict=True)] if len(theirs) == len(ours) else []


def comparison_bars(hits: Hits, cases: Sequence[FlightCase], flights: Mapping[int, Entry]) -> list[Bar]:
    every = [pair for airframe in AIRFRAMES for rate in ASKED_HZ for pair in pairs(hits, airframe, rate)]
    if not every:
        return []
    both = [(a.entry["latency_ms"], b.entry["latency_ms"]) for a, b in every if a.is_found and b.is_found]
    earlier = percentile([a / b for a, b in both if b > 0.0], 50)
    waited = [[side.entry.get("latency_ms", FOUND_WITHIN_MS) for side in pair] for pair in every]
    missed = [sum(not pair[side].is_found for pair in every) for side in (0, 1)]
    theirs = sum(len(alarms(cases, flights, BASELINE, rate).phases) for rate in ASKED_HZ)
    ours = sum(len(alarms(cases, flights, DEFAULT, rate).phases) for rate in ASKED_HZ)
    return [
        Bar(
            f"beside {BASELINE}: earlier",
            f"≥ {EARLIER_BAR:g} times",
            f"{earlier:.1f} times (median; latencies {percentile([a for a, _ in both], 50):.1f} and "
            f"{percentile([b for _, b in both], 50):.1f} ms)",
            earlier >= EARLIER_BAR,
            f"{len(both)} hits that both found, all rates",
        ),
        Bar(
            f"beside {BASELINE}: earlier, a miss counted as {FOUND_WITHIN_MS:g} ms",
            "no bar",
            f"{percentile([a / b for a, b in waited if b > 0.0], 50):.1f} times (median; "
            f"{percentile([a for a, _ in waited], 50):.1f} and {percentile([b for _, b in waited], 50):.1f} ms)",
            None,
            f"{len(waited)} hits, all rates",
        ),
        Bar(
            f"beside {BASELINE}: misses", "fewer", f"{missed[1]} : {missed[0]}", missed[1] < missed[0], f"{len(every)}"
        ),
        Bar(f"beside {BASELINE}: false alarms", "fewer", f"{ours} : {theirs}", ours < theirs, "the same flights"),
    ]


def baseline_text(hits: Hits) -> str:
    rows = []
    for airframe in AIRFRAMES:
        for rate in ASKED_HZ:
            every = pairs(hits, airframe, rate)
            if not every:
                continue
            both = [(a.entry["latency_ms"], b.entry["latency_ms"]) for a, b in every if a.is_found and b.is_found]
            ratio = percentile([a / b for a, b in both if b > 0.0], 50)
            rows.append(
                [
                    f"{airframe}, {rate}",
                    f"{len(every)}",
                    *[f"{sum(not pair[side].is_found for pair in every)}" for side in (0, 1)],
                    *[text_of(percentile([pair[side] for pair in both], 50), 1) for side in (0, 1)],
                    text_of(ratio, 1),
                ]
            )
    return markdown(COLUMNS, rows)
