"""What every study does: its cases are flown, and what their rows show becomes a page."""

from argparse import Namespace
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any

import pandas as pd
from matplotlib.figure import Figure

from bench.fly.campaign import Json, Results, run_campaign
from bench.rows.tables import Page


@dataclass(frozen=True, slots=True)
class Shown:
    """Sections by their headings, what is said on the terminal, pictures by their files, and rows for a file."""

    parts: Mapping[str, str]
    said: str = ""
    rows: pd.DataFrame | None = None
    figures: Mapping[str, Figure] = field(default_factory=dict)
    is_met: bool = True
    """Whether the command ends with 0."""


def run_study(
    options: Namespace,
    name: str,
    title: str,
    cases: Sequence[Any],
    work_out: Callable[[Any], Json],
    show: Callable[[Results], Shown],
) -> int:
    """Fly the cases and write the page of that name; 1 where a case failed to be flown."""
    page = Page(options.out, name)
    results = run_campaign(name, cases, work_out, options.jobs)
    shown = show(results)
    page.write(title, options.typed, shown.parts, shown.figures, shown.rows)
    print("\n".join(filter(None, (shown.said, *results.failures))))
    return 0 if shown.is_met and not results.failures else 1


def seeds_of(options: Namespace, count: int) -> range:
    """So many, from the first that was asked for."""
    return range(options.first_seed, options.first_seed + count)
