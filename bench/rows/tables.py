"""What a study shows of its rows: figures out of many, bars with a verdict, tables, and a page to look at."""

import math
import os
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import pandas as pd
from matplotlib.figure import Figure
from scipy.stats import beta, chi2

from bench.stamps import FLOWN, stamp_text
from rebound_cli.results.run_folder import RunFolderError

MET, MISSED, REPORTED = "met", "**missed**", "reported"
# Of bounds on a share: three hundred hits without a miss show that fewer than one in a hundred is missed.
CONFIDENCE = 0.95
# Nothing of a study is committed.
BUILD = Path("build")


@dataclass(frozen=True, slots=True)
class Bar:
    """What must be shown, with the figure and a verdict; `is_met` None where there is no bar."""

    what: str
    wanted: str
    measured: str
    is_met: bool | None
    of: str = ""

    @property
    def verdict(self) -> str:
        if self.is_met is None:
            return REPORTED
        return MET if self.is_met else MISSED


def bars_text(bars: Sequence[Bar]) -> str:
    return table(
        [{"what": b.what, "bar": b.wanted, "measured": b.measured, "verdict": b.verdict, "of": b.of} for b in bars]
    )


def summary_text(bars: Sequence[Bar]) -> str:
    """For the terminal: how many are met, and which are not."""
    judged = [bar for bar in bars if bar.is_met is not None]
    missed = [bar for bar in judged if not bar.is_met]
    lines = [f"{len(judged) - len(missed)} of {len(judged)} bars are met."]
    lines += [f"  missed: {bar.what}: wanted {bar.wanted}, measured {bar.measured} ({bar.of})" for bar in missed]
    return "\n".join(lines)


def table(rows: pd.DataFrame | Sequence[Mapping[str, object]]) -> str:
    """In Markdown, each cell as it is; a sentence where there is none."""
    frame = pd.DataFrame(rows)
    text: str = frame.to_markdown(index=False, disable_numparse=True) if len(frame) else "None."
    return text + "\n"


def by_each(rows: pd.DataFrame, columns: Sequence[str], figures: Callable[[pd.DataFrame], Mapping[str, object]]) -> str:
    """A line for each value of one column after the other."""
    groups = [(value, some) for column in columns for value, some in rows.groupby(column, sort=False)]
    return table([{"": value, **figures(some)} for value, some in groups])


def share_bar(what: str, holds: "pd.Series[bool]", least: float | None = None) -> Bar:
    """Of how many it must hold, and of how many it does. Without a least or with none there is no verdict."""
    part, count = float(holds.astype(bool).mean()), len(holds)
    wanted = "" if least is None else f"≥ {100 * least:g} %"
    is_met = part >= least if least is not None and count else None
    return Bar(what, wanted, f"{per_cent(part, 2)} %", is_met, f"{count - sum(holds)} of {count} not")


def rms(values: Iterable[float]) -> float:
    numbers = np.array(list(values), float)
    return float(np.sqrt(np.mean(numbers**2))) if len(numbers) else math.nan


def at_most(events: float, of: float) -> float:
    """The share that is not exceeded with the confidence, by Clopper and Pearson."""
    return float(beta.ppf(CONFIDENCE, events + 1, of - events)) if events < of else 1.0


def at_most_an_hour(events: int, hours: float) -> float:
    """The rate that is not exceeded with the confidence, by Poisson, exactly."""
    return float(chi2.ppf(CONFIDENCE, 2 * (events + 1))) / (2.0 * hours)


def at_most_of_groups(groups: Sequence[tuple[int, int]]) -> float:
    """The same share of groups of hits (missed, flown), each by one vehicle, by Korn and Graubard.

    Hits by one vehicle are no independent ones. They count as fewer, by how much more vehicles differ than independent
    hits would; where none is missed, as one a vehicle.
    """
    flown, missed = sum(of for _, of in groups), sum(events for events, _ in groups)
    if missed in (0, flown) or len(groups) < 2:
        return at_most(len(groups) if missed else 0, len(groups))
    part = missed / flown
    squares = sum((events - part * of) ** 2 for events, of in groups)
    variance = squares / flown**2 * len(groups) / (len(groups) - 1)
    effective = min(flown, part * (1.0 - part) / variance)
    return at_most(part * effective, effective)


def per_cent(value: float, digits: int = 1) -> str:
    """A share for people; 100 only if it is all."""
    if math.isnan(value):
        return "-"
    text = f"{100 * value:.{digits}f}"
    return text if value == 1.0 or float(text) < 100.0 else f"{100 - 10.0**-digits:.{digits}f}"


def text_of(value: float, digits: int = 1) -> str:
    return "-" if math.isnan(value) else f"{value:.{digits}f}"


class Page:
    """A study's page, its pictures and its rows, in a folder that is made or refused before hours are flown for it."""

    def __init__(self, out: Path | None, name: str) -> None:
        """`out`: the folder, the page itself or its rows. Raises RunFolderError where it cannot be had."""
        out = BUILD / name if out is None else out
        self.path = out.with_suffix(".md") if out.suffix in (".md", ".jsonl") else out / f"{name}.md"
        self.folder = self.path.parent
        try:
            self.folder.mkdir(parents=True, exist_ok=True)
        except OSError as error:
            raise RunFolderError(f"The folder {self.folder} cannot be made: {error.strerror}.") from error
        if not os.access(self.folder, os.W_OK) or self.path.is_dir():
            raise RunFolderError(f"{self.path} cannot be written to.")

    def write(
        self,
        title: str,
        command: str,
        parts: Mapping[str, str],
        figures: Mapping[str, Figure] | None = None,
        rows: pd.DataFrame | None = None,
        code: Sequence[str] = FLOWN,
    ) -> None:
        """Sections by their headings, after what measured them; the rows as JSON, one a line."""
        sections = [f"## {head}\n\n{text}" if head else text for head, text in parts.items()]
        for name, figure in (figures or {}).items():
            figure.savefig(self.folder / name)
            sections.append(f"![{name.removesuffix('.png')}]({name})\n")
        if rows is not None:
            rows.to_json(self.path.with_suffix(".jsonl"), orient="records", lines=True)
        text = "\n".join([f"# {title}\n", f"{stamp_text(command, code)}.\n", *sections])
        self.path.write_text(text, encoding="utf-8")
        print(f"Written to {self.path}.")
