"""What a study shows of its rows: figures out of many, bars with a verdict, tables."""

import math
from collections.abc import Callable, Iterable, Mapping, Sequence

import numpy as np
import pandas as pd
from scipy.stats import beta, chi2

MET, MISSED, REPORTED = "met", "**missed**", "reported"
# Of bounds on a share: three hundred hits without a miss show that fewer than one in a hundred is missed.
CONFIDENCE = 0.95


Bar = dict[str, str]
"""A row: what must be shown, the bar, the figure, the verdict, and of how many."""


def bar(what: str, wanted: str, measured: str, is_met: bool | None, of: str) -> Bar:
    """`is_met` None where there is nothing to meet."""
    verdict = REPORTED if is_met is None else MET if is_met else MISSED
    return {"what": what, "bar": wanted, "measured": measured, "verdict": verdict, "of": of}


def summary_text(bars: Sequence[Bar]) -> str:
    """For the terminal: how many are met, and which are not."""
    judged = [one for one in bars if one["verdict"] != REPORTED]
    missed = [one for one in judged if one["verdict"] == MISSED]
    return f"{len(judged) - len(missed)} of {len(judged)} bars are met. Missed: {table(missed)}"


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
    return bar(what, wanted, f"{per_cent(part, 2)} %", is_met, f"{count - sum(holds)} of {count} not")


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
