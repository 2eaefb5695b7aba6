"""Tables of the simulated hits."""

from collections.abc import Sequence
from typing import Any

from rebound_cli.detectors.hits import AIRFRAMES, HitCase
from rebound_cli.detectors.watching import ASKED_HZ
from rebound_cli.detectors_report.figures_of_hits import (
    Entry,
    Scored,
    detection_rate,
    late_share,
    latencies_ms,
    percentile,
    rms,
    scored,
)
from rebound_cli.paper.table import markdown

BAR_SPEED_M_S = 0.5

COLUMNS = (
    "detector",
    "airframe",
    "Hz",
    "hits",
    "found [%]",
    "missed",
    "fell between, found / all",
    "later than first possible [%]",
    "two samples or more late",
    "latency, median / 99 % [ms]",
    "false before",
    "v_c error, RMS [m/s]",
    "normal error, 95 % [°]",
)


def hits_text(cases: Sequence[HitCase], results: dict[int, Entry]) -> str:
    """Markdown: every detector on the plain hits."""
    rows = [
        _row(detector, airframe, rate, hits)
        for detector in detectors_of(results)
        for airframe in AIRFRAMES
        for rate in ASKED_HZ
        if (hits := scored(cases, results, detector, rate, _plain(airframe)))
    ]
    return markdown(COLUMNS, rows, left=2)


def detectors_of(results: dict[int, Entry]) -> list[str]:
    first = next(iter(results.values()))
    return list(first["rates"][str(next(iter(ASKED_HZ)))]["detectors"])


def _plain(airframe: str) -> Any:
    return lambda case, hit: case.family == "plain" and case.airframe == airframe and hit["speed_m_s"] >= BAR_SPEED_M_S


def _row(detector: str, airframe: str, rate: int, hits: Sequence[Scored]) -> list[str]:
    found = [hit for hit in hits if hit.is_found]
    between = [hit for hit in hits if hit.fell_between]
    late = latencies_ms(hits)
    head_on = [hit.entry["normal_error_deg"] for hit in found if not hit.hit["clipped"]]
    return [
        detector,
        airframe,
        f"{rate}",
        f"{len(hits)}",
        f"{100 * detection_rate(hits):.2f}",
        f"{len(hits) - len(found)}",
        f"{sum(hit.is_found for hit in between)} / {len(between)}",
        f"{100 * late_share(hits, 0):.2f}",
        f"{100 * late_share(hits, 1):.2f}",
        f"{percentile(late, 50):.1f} / {percentile(late, 99):.1f}",
        f"{sum(hit.entry['false'] for hit in hits)}",
        f"{rms(hit.entry['speed_error_m_s'] for hit in found):.3f}",
        f"{percentile(head_on, 95):.0f}",
    ]
