"""Beside the plain hits: heard over a bad link, a hovering vehicle that is struck, and one in a person's hand."""

from collections import Counter
from collections.abc import Callable, Mapping, Sequence

from bench.detectors.hands import GRIPS, HandCase
from bench.detectors.hits import SPEEDS_M_S, HitCase
from bench.detectors.links import JITTERY
from bench.detectors.vehicles import AIRFRAMES
from bench.detectors.watching import ASKED_HZ
from bench.detectors_report.bars import Bar
from bench.detectors_report.hit_bars import FOUND_BARS
from bench.detectors_report.hits import DEFAULT
from bench.detectors_report.numbers import (
    Entry,
    Hits,
    Scored,
    detection_rate,
    latencies_ms,
    per_cent,
    percentile,
    share,
    text_of,
)
from bench.paper.table import markdown
from companion.reflex.detector import ImpactKind


def _over_link(airframe: str) -> Callable[[HitCase], bool]:
    return lambda case: case.link is not None and case.airframe == airframe and case.speed_m_s >= SPEEDS_M_S[0]


def _struck(airframe: str) -> Callable[[HitCase], bool]:
    return lambda case: case.is_struck and case.airframe == airframe


def family_bars(hits: Hits) -> list[Bar]:
    """Over a bad link, and of a hovering vehicle that is struck, as of the hits in flight."""
    bars: list[Bar] = []
    for airframe in AIRFRAMES:
        for rate in ASKED_HZ:
            scored = hits.scored(DEFAULT, rate, _over_link(airframe))
            what = f"{airframe}, {rate} Hz, link with {JITTERY}: detected"
            bars.append(_found_bar(what, FOUND_BARS[airframe, rate], scored))
    for airframe in AIRFRAMES:
        for rate in ASKED_HZ:
            scored = hits.scored(DEFAULT, rate, _struck(airframe))
            what = f"{airframe}, {rate} Hz, struck in hover at 0.5 to 3 m/s: detected"
            bars.append(_found_bar(what, FOUND_BARS[airframe, rate], scored))
    return bars


def _found_bar(what: str, wanted: float, hits: Sequence[Scored]) -> Bar:
    found, late = detection_rate(hits), latencies_ms(hits)
    missed, false = sum(not hit.is_found for hit in hits), sum(hit.entry["false"] for hit in hits)
    soft = sum(bool(hit.entry["touches"]) for hit in hits)
    return Bar(
        what,
        f"{'' if wanted == 1.0 else '≥ '}{100 * wanted:g} %",
        f"{per_cent(found, 2)} %, after {text_of(percentile(late, 50))} ms (median), "
        f"{text_of(percentile(late, 99))} ms (99 %)",
        found >= wanted if hits else None,
        f"{len(hits)} hits, {missed} missed, {soft} told as a mere contact, too, {false} false before",
    )


def families_text(hits: Hits) -> str:
    """Every detector that was tried on them."""
    rows = []
    for what, which in ((f"link: {JITTERY}", _over_link), ("struck in hover", _struck)):
        for detector in hits.detectors:
            for airframe in AIRFRAMES:
                for rate in ASKED_HZ:
                    scored = hits.scored(detector, rate, which(airframe))
                    if scored:
                        rows.append([what, detector, airframe, f"{rate}", *_numbers(scored)])
    columns = (
        "hits",
        "detector",
        "airframe",
        "Hz",
        "number",
        "found [%]",
        "latency, median / 99 % [ms]",
        "false before",
        "told as a mere contact, too",
        "said it was blind",
        "told as",
    )
    return markdown(columns, rows, left=3)


def _numbers(hits: Sequence[Scored]) -> list[str]:
    late = latencies_ms(hits)
    kinds = Counter(hit.entry["kind"] for hit in hits if hit.is_found)
    return [
        f"{len(hits)}",
        per_cent(detection_rate(hits), 2),
        f"{text_of(percentile(late, 50))} / {text_of(percentile(late, 99))}",
        f"{sum(hit.entry['false'] for hit in hits)}",
        f"{sum(bool(hit.entry['touches']) for hit in hits)}",
        f"{sum(hit.entry['blind'] for hit in hits)}",
        ", ".join(f"{kind} {count}" for kind, count in kinds.most_common(3)),
    ]


# --- hands ------------------------------------------------------------------------------------------------------------


def hand_bars(cases: Sequence[HandCase], results: Mapping[int, Entry]) -> list[Bar]:
    """A hand is never answered; whether it was felt at all depends on how firm it was."""
    bars = []
    for grip in GRIPS:
        for rate in ASKED_HZ:
            entries = _of(cases, results, DEFAULT, rate, grip)
            wrong = sum(bool(entry["collisions"]) for entry in entries)
            told = share(entry["told_after_ms"] is not None for entry in entries)
            bars.append(
                Bar(
                    f"{rate} Hz, hovering and {grip} by a hand: taken for a collision",
                    "none",
                    f"{wrong}; {per_cent(told)} % told as {ImpactKind.CONTACT.value}",
                    wrong == 0 if entries else None,
                    f"{len(entries)} hands",
                )
            )
    return bars


def hands_text(cases: Sequence[HandCase], results: Mapping[int, Entry]) -> str:
    rows = []
    for grip in GRIPS:
        for detector in max((case.detectors for case in cases), key=len):
            for rate in ASKED_HZ:
                entries = _of(cases, results, detector, rate, grip)
                after = [e["told_after_ms"] for e in entries if e["told_after_ms"] is not None]
                kinds = Counter(kind for e in entries for kind in e["collisions"][:1])
                rows.append(
                    [
                        grip,
                        detector,
                        f"{rate}",
                        f"{len(entries)}",
                        f"{sum(bool(e['collisions']) for e in entries)}",
                        f"{len(after)}",
                        text_of(percentile(after, 50)),
                        ", ".join(f"{kind} {count}" for kind, count in kinds.most_common(3)),
                    ]
                )
    columns = (
        "hand",
        "detector",
        "Hz",
        "number",
        "taken for a collision",
        "told as contact",
        "after, median [ms]",
        "wrongly told as",
    )
    return markdown(columns, rows, left=2)


def _of(cases: Sequence[HandCase], results: Mapping[int, Entry], detector: str, rate: int, grip: str) -> list[Entry]:
    return [
        hand["rates"][str(rate)]["detectors"][detector]
        for number, hand in results.items()
        if detector in cases[number].detectors and cases[number].grip == grip
    ]
