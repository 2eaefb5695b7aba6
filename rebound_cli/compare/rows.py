"""What is compared of a flight, for the CSV; and what is told of those that differ by their seeds, for the table."""

import csv
import math
import statistics
from collections.abc import Callable, Mapping, Sequence
from dataclasses import astuple, dataclass
from itertools import groupby
from pathlib import Path
from typing import Any

from rebound_cli.compare.cases import Case
from rebound_cli.results.run_folder import REPORT_NAME

NOTE = "Medians, and in brackets the worst: the fastest, the latest, the most, the nearest."
_HEADING = ("", "completed", "hit [m/s]", "at rest [s]", "height lost [m]", "second touches", "stopped off it [m]")


@dataclass(frozen=True, slots=True)
class Row:
    """Of the first hit, as summary.json has it; None: there was none, or the vehicle did not come to rest."""

    group: str
    law: str | None
    speed_m_s: float | None
    seed: int
    report: str  # beside the CSV
    outcome: str = "failed"
    reason: str = "it left no summary"
    second_touches: int | None = None
    impact_speed_m_s: float | None = None
    at_rest_after_s: float | None = None
    height_lost_m: float | None = None
    stopped_off_m: float | None = None


def row_of(case: Case, summary: Mapping[str, Any] | None, reason: str = "") -> Row:
    place = (case.group, case.law, case.speed_m_s, case.seed, f"{case.folder}/{REPORT_NAME}")
    if summary is None:
        return Row(*place, reason=reason)
    flown = (*place, summary["outcome"], summary["reason"], summary["recontacts"])
    for hit in summary["collisions"]:
        if (truth := hit["truth"]) is not None:
            rest_s, off_m = hit["settled_after_s"], truth["stopped_off_m"]
            speed_m_s = math.hypot(*truth["impact_velocity_ned_m_s"])
            return Row(*flown, speed_m_s, rest_s, truth["height_lost_m"], None if rest_s is None else off_m)
    return Row(*flown)


def write_csv(rows: Sequence[Row], path: Path) -> None:
    with path.open("w", newline="", encoding="utf-8") as file:
        csv.writer(file).writerows([Row.__slots__, *map(astuple, rows)])


def lines_of(rows: Sequence[Row]) -> list[tuple[str, ...]]:
    """A heading, then a line for what has the same law and speed."""
    lines: list[tuple[str, ...]] = [_HEADING]
    for group, some in groupby(rows, key=lambda row: row.group):
        flights = list(some)
        completed = f"{sum(row.outcome == 'completed' for row in flights)} of {len(flights)}"
        hit, rest = ([getattr(row, name) for row in flights] for name in ("impact_speed_m_s", "at_rest_after_s"))
        lost, off = ([getattr(row, name) for row in flights] for name in ("height_lost_m", "stopped_off_m"))
        touches = str(sum(row.second_touches or 0 for row in flights))
        lines.append((group, completed, _told(hit), _told(rest), _told(lost), touches, _told(off, min)))
    return lines


def _told(values: Sequence[float | None], worst: Callable[[Sequence[float]], float] = max) -> str:
    known = [value for value in values if value is not None]
    return f"{statistics.median(known):.2f} ({worst(known):.2f})" if known else "-"


def table(rows: Sequence[Row]) -> str:
    """For a terminal."""
    lines = lines_of(rows)
    widths = [max(map(len, column)) for column in zip(*lines, strict=True)]
    return "\n".join([*("  ".join(map(str.ljust, line, widths)).rstrip() for line in lines), NOTE])
