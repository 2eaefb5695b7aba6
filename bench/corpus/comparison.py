"""Two versions' verdicts on the same flights, beside each other."""

import statistics
from collections.abc import Iterator, Sequence

from bench.campaign.plan import Json
from bench.corpus.verdict import ASKED_HZ
from bench.detectors.watching import FLOWN_WITH
from bench.detectors_report.numbers import percentile, rms, text_of

# Hits with less change of velocity are counted apart: five times a good estimate's noise of 0.03 m/s.
VISIBLE_M_S = 0.15
MOST_LISTED = 40


def comparison_text(old: Json, new: Json) -> str:
    """A table of figures old and new, then the flights that differ. Only what both have counts."""
    both = [name for name in old["flights"] if name in new["flights"]]
    lines = [f"{len(both)} flights", "", f"{'':<44}{'old':>12}{'new':>12}"]
    for rate in ASKED_HZ:
        sides = [_figures([side["flights"][name]["rates"][rate] for name in both]) for side in (old, new)]
        lines += [f"{f'{rate}: {name}':<44}{sides[0][name]:>12}{sides[1][name]:>12}" for name in sides[0]]
    if "recorded" in old and "recorded" in new:
        sides = [_recorded(side["recorded"]) for side in (old, new)]
        lines += [f"{name:<44}{sides[0][name]:>12}{sides[1][name]:>12}" for name in sides[0]]
    changed = list(_changed(both, old, new))
    lines += ["", *changed[:MOST_LISTED]]
    if len(changed) > MOST_LISTED:
        lines.append(f"and {len(changed) - MOST_LISTED} more")
    return "\n".join(lines)


def _figures(verdicts: Sequence[Json]) -> dict[str, str]:
    hits = [hit for verdict in verdicts for hit in verdict["hits"]]
    plain = [hit for hit in hits if hit["change_m_s"] >= VISIBLE_M_S]
    faint = [hit for hit in hits if hit["change_m_s"] < VISIBLE_M_S]
    found = [hit for hit in plain if "latency_ms" in hit]
    late = [hit["latency_ms"] for hit in found]
    normals = [hit["normal_error_deg"] for hit in found]
    return {
        "hits found": f"{len(found)}/{len(plain)}",
        f"of those under {VISIBLE_M_S:g} m/s": f"{sum('latency_ms' in hit for hit in faint)}/{len(faint)}",
        "told, and none": str(sum(len(verdict["false_boot_us"]) for verdict in verdicts)),
        "ms late, median": text_of(percentile(late, 50)),
        "ms late, 99 %": text_of(percentile(late, 99)),
        "velocity error, RMS m/s": f"{rms(hit['velocity_error_m_s'] for hit in found):.3f}",
        "normal error, median deg": f"{statistics.median(normals):.1f}" if normals else "–",
        "normal error, 95 % deg": text_of(percentile(normals, 95)),
    }


def _recorded(recorded: Json) -> dict[str, str]:
    """Of the real logs: collisions told, which in one of them are true; and recorded impacts found in them."""
    figures = {}
    (name,) = FLOWN_WITH
    for rate in recorded["healthy"][0]:
        told = sum(len(rates[rate][name]["collisions"]) for rates in recorded["healthy"])
        figures[f"real logs, {rate} Hz: collisions told"] = str(told)
    for rate in recorded["impacts"][0]:
        entries = [rates[rate][name] for rates in recorded["impacts"]]
        found = sum("latency_ms" in entry for entry in entries)
        figures[f"recorded impacts, {rate} Hz: found"] = f"{found}/{len(entries)}"
        figures[f"recorded impacts, {rate} Hz: told before"] = str(sum(entry["false"] for entry in entries))
    return figures


def _changed(names: Sequence[str], old: Json, new: Json) -> Iterator[str]:
    """A line for each flight and rate in which other hits are found, or others told that are none."""
    for name in names:
        for rate in ASKED_HZ:
            before, after = (side["flights"][name]["rates"][rate] for side in (old, new))
            pairs = list(zip(before["hits"], after["hits"], strict=True))
            lost = sum("latency_ms" in a and "latency_ms" not in b for a, b in pairs)
            won = sum("latency_ms" in b and "latency_ms" not in a for a, b in pairs)
            more = len(after["false_boot_us"]) - len(before["false_boot_us"])
            if lost or won or more:
                yield f"{name}, {rate}: {won} hits won, {lost} lost, {more:+d} told that are none"
