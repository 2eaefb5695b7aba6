"""What a pilot asks first, in a sentence; and how well the link and this program kept up, in a few rows."""

import math
from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from companion.link.vehicle import OLD_NEWS_US
from companion.reflex.detection.detector import ImpactKind
from rebound_cli.replay.report import speed_text
from rebound_cli.replay.watching import Finding
from rebound_cli.report.shown_flight import ShownFlight
from rebound_cli.results.ending import ending_text
from rebound_cli.results.run_folder import SUMMARY_NAME, reading

# A sample later than so many usual intervals after the one before: one between them was lost.
LOST_FROM = 1.5


def sentence(flight: ShownFlight) -> str:
    """Hit what, how fast, when, and how it ended."""
    hits = flight.hits
    if not hits:
        touched = sum(not finding.first.impact.is_ground for finding in flight.findings.contacts)
        touches = "a touch that is none" if touched == 1 else f"{touched} touches that are none"
        told = f"No hit, {touches}" if touched else "No hit"
    else:
        fastest = max(hits, key=lambda hit: math.hypot(*hit.first.velocity_ned_m_s))
        told = _hit_text(flight, fastest)
        if len(hits) > 1:
            told = f"{len(hits)} hits, the fastest: {told[:1].lower()}{told[1:]}"
    return f"{told}; {_end(flight)}."


def _hit_text(flight: ShownFlight, hit: Finding) -> str:
    kind = hit.first.impact.kind
    struck = {ImpactKind.UNKNOWN: "Hit something", ImpactKind.STRUCK: "Struck by something, itself"}
    what = struck.get(kind, f"Hit a {kind.value}")
    return f"{what} at {speed_text(hit)}, {flight.seconds(hit.at_us):.2f} s into the flight"


def _end(flight: ShownFlight) -> str:
    summary = flight.summary
    if summary is None:
        share = flight.findings.watched_share
        seen = "no flight was heard" if share is None else f"{100.0 * share:.0f} % of the flight was watched"
        # Only a run's own folder has versions.
        return "the recording was cut off" if flight.versions is not None else seen
    outcome, reason = str(summary.get("outcome", "")), str(summary.get("reason") or "")
    return f"{outcome}: {reason}" if reason and reason != outcome else outcome


def lines(flight: ShownFlight) -> Sequence[str]:
    """What the terminal said at the end; of a guard and a foreign log there is none."""
    summary = flight.summary
    if summary is None or "mission" not in summary:
        return []
    with reading(SUMMARY_NAME):
        return [line for line in ending_text(summary).splitlines() if line]


def link_rows(flight: ShownFlight) -> Sequence[tuple[str, str]]:
    """Streams, latency, lateness, and what was not accepted."""
    rows = [*_imu_rows(flight)]
    findings = flight.findings
    for word, spans in (("Blind", findings.blind), ("Off", findings.off)):
        reasons = ", ".join(dict.fromkeys(span.reason for span in spans))
        total_s = sum(span.duration_s for span in spans)
        rows.append((word, f"{total_s:.2f} s: {reasons}" if spans else "never"))
    share = findings.watched_share
    if share is not None:
        rows.append(("Watched", f"{100.0 * share:.1f} % of the time in the air"))
    with reading(SUMMARY_NAME):
        rows += _summary_rows(flight.summary or {})
    return rows if flight.difference is None else [*rows, ("Decided again", f"not the same: {flight.difference}")]


def _imu_rows(flight: ShownFlight) -> Sequence[tuple[str, str]]:
    boot_us, at_us = flight.log.imu_time_boot_us, flight.log.imu_at_us
    if len(boot_us) < 2:
        return [("IMU samples", str(len(boot_us)))]
    intervals_us, heard_us = np.diff(boot_us), np.diff(at_us)
    usual_us = float(np.median(intervals_us))
    # Times that run back, or on without any that was heard, are another clock's: of one that was reset or has jumped.
    is_anew = (intervals_us < 0.0) | (intervals_us > heard_us + OLD_NEWS_US)
    gaps_us = intervals_us[~is_anew]
    lost = int(sum(round(gap_us / usual_us) - 1 for gap_us in gaps_us if gap_us > LOST_FROM * usual_us))
    pieces_us = np.split(at_us - boot_us, np.flatnonzero(is_anew) + 1)
    delays_ms = np.concatenate([piece_us - piece_us.min() for piece_us in pieces_us]) / 1e3
    p50, p99, most = np.percentile(delays_ms, 50), np.percentile(delays_ms, 99), delays_ms.max()
    averaging_ms = flight.config.estimate.imu_averaging_interval_s * 1e3
    return [
        ("IMU samples", f"{len(boot_us)}, one every {usual_us / 1e3:.1f} ms, each of the last {averaging_ms:.1f} ms"),
        ("Lost, or not sent", f"{lost} of {lost + len(boot_us)}"),
        ("Later than the quickest", f"{p50:.1f} ms (median), {p99:.1f} ms (99 %), {most:.1f} ms (most)"),
    ]


def _summary_rows(summary: Mapping[str, Any]) -> list[tuple[str, str]]:
    rows = []
    trip = summary.get("round_trip_ms") or {}
    if trip.get("median") is not None:
        rows.append(("Round trip", f"{trip['median']:.1f} ms (median), {trip['worst']:.1f} ms (worst)"))
    for key, word in (("tick_lateness_ms", "Loop late by"), ("step_ms", "A step took")):
        spread = summary.get(key)
        if isinstance(spread, dict):
            said = f"{spread['p50']:.1f} ms (median), {spread['p99']:.1f} ms (99 %), {spread['max']:.1f} ms (most)"
            rows.append((word, said))
    rates = summary.get("stream_rates_hz") or {}
    if rates:
        rows.append(("Streams", ", ".join(f"{name} {rate:.0f} Hz" for name, rate in rates.items())))
    for key, word in (("refused_messages", "Messages not accepted"), ("refused_packets", "Packets refused")):
        counts = summary.get(key) or {}
        if counts:
            rows.append((word, ", ".join(f"{name} {count}" for name, count in counts.items())))
    if "reconnects" in summary:
        rows.append(("Reconnects", str(summary["reconnects"])))
    return rows
