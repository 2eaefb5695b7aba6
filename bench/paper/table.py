"""Rows of the paper's numbers beside ours: each with a tolerance and a verdict."""

from collections.abc import Sequence
from dataclasses import dataclass

PASSED, FAILED = "agrees", "**differs**"


@dataclass(frozen=True, slots=True)
class ClaimRow:
    """One number. `low` and `high` are what ours may be; a row without bounds only reports."""

    claim: str
    paper: str
    ours: float
    unit: str
    low: float | None
    high: float | None
    note: str = ""

    @property
    def is_judged(self) -> bool:
        return self.low is not None or self.high is not None

    @property
    def agrees(self) -> bool:
        above = self.low is None or self.ours >= self.low
        return above and (self.high is None or self.ours <= self.high)

    @property
    def verdict(self) -> str:
        return (PASSED if self.agrees else FAILED) if self.is_judged else "for comparison"

    @property
    def tolerance(self) -> str:
        if self.low is not None and self.high is not None:
            return f"{number(self.low)} to {number(self.high)}"
        if self.high is not None:
            return f"at most {number(self.high)}"
        return f"at least {number(self.low)}" if self.low is not None else ""


def around(claim: str, paper: str, expected: float, ours: float, unit: str, share: float, note: str = "") -> ClaimRow:
    """A row whose tolerance is a share of the expected value: less than half, so that no factor of two fits."""
    assert 0.0 < share < 0.5, "a factor of two would pass"
    margin = share * abs(expected)
    return ClaimRow(claim, paper, ours, unit, expected - margin, expected + margin, note)


def within_factor(
    claim: str, paper: str, expected: float, ours: float, unit: str, factor: float, note: str = ""
) -> ClaimRow:
    """A row for a number that the paper gives in round figures ("≈") and without saying how it was measured."""
    assert 1.0 < factor < 2.0, "a factor of two would pass"
    return ClaimRow(claim, paper, ours, unit, expected / factor, expected * factor, note)


def at_most(claim: str, paper: str, high: float, ours: float, unit: str, note: str = "") -> ClaimRow:
    return ClaimRow(claim, paper, ours, unit, None, high, note)


def at_least(claim: str, paper: str, low: float, ours: float, unit: str, note: str = "") -> ClaimRow:
    return ClaimRow(claim, paper, ours, unit, low, None, note)


def number(value: float) -> str:
    """Three digits that count, no exponent for what people say in full, no minus before zero."""
    text = f"{value:.3g}" if abs(value) < 1000 else f"{value:.0f}"
    return "0" if float(text) == 0.0 else text


def rows_text(rows: Sequence[ClaimRow]) -> str:
    return markdown(
        ("claim", "paper", "ours", "tolerance", "verdict", "remark"),
        [
            (row.claim, row.paper, f"{number(row.ours)} {row.unit}".strip(), row.tolerance, row.verdict, row.note)
            for row in rows
        ],
        left=6,
    )


def markdown(head: Sequence[str], rows: Sequence[Sequence[str]], left: int = 1) -> str:
    """A Markdown table, its first `left` columns flush left and the others, numbers, flush right."""
    marks = ["---" if column < left else "---:" for column in range(len(head))]
    lines = ["| " + " | ".join(cells) + " |" for cells in (head, *rows)]
    lines.insert(1, "|" + "|".join(marks) + "|")
    return "\n".join(lines) + "\n"
