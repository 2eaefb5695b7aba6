"""The paper's numbers beside ours: `claims.yaml` has what the paper says and how far ours may be from it."""

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import yaml

from bench.rows.tables import table

PASSED, FAILED = "agrees", "**differs**"
CLAIMS: dict[str, dict[str, str | float]] = yaml.safe_load(Path(__file__).with_name("claims.yaml").read_text("utf-8"))


@dataclass(frozen=True, slots=True)
class ClaimRow:
    """One number. `low` and `high` are what ours may be."""

    claim: str
    paper: str
    ours: float
    unit: str
    low: float | None
    high: float | None
    note: str = ""

    @property
    def agrees(self) -> bool:
        above = self.low is None or self.ours >= self.low
        return above and (self.high is None or self.ours <= self.high)

    @property
    def tolerance(self) -> str:
        if self.low is None or self.high is None:
            return f"at least {number(self.low)}" if self.low is not None else f"at most {number(self.high or 0.0)}"
        return f"{number(self.low)} to {number(self.high)}"


def claim(name: str, ours: float, expected: float | None = None, **words: object) -> ClaimRow:
    """What was measured beside the claim of that name. `expected`: where eq. 2 or our own v_c says it."""
    stated = CLAIMS[name]
    if expected is None and "expected" in stated:
        expected = float(stated["expected"])
    claimed, paper, unit, note = (
        str(stated.get(part, "")).format(expected=expected, **words) for part in ("claim", "paper", "unit", "note")
    )
    return ClaimRow(claimed, paper, ours, unit, *_bounds(stated, expected), note)


def _bounds(stated: dict[str, str | float], expected: float | None) -> tuple[float | None, float | None]:
    """No factor of two fits between them."""
    if expected is None:
        least, most = stated.get("least"), stated.get("most")
        return None if least is None else float(least), None if most is None else float(most)
    if "factor" in stated:
        factor = float(stated["factor"])
        return expected / factor, expected * factor
    margin = float(stated["within"]) * abs(expected)
    return expected - margin, expected + margin


def number(value: float) -> str:
    """Three digits that count, no exponent for what people say in full, no minus before zero."""
    text = f"{value:.3g}" if abs(value) < 1000 else f"{value:.0f}"
    return "0" if float(text) == 0.0 else text


def rows_text(rows: Sequence[ClaimRow]) -> str:
    return table(
        [
            {
                "claim": row.claim,
                "paper": row.paper,
                "ours": f"{number(row.ours)} {row.unit}".strip(),
                "tolerance": row.tolerance,
                "verdict": PASSED if row.agrees else FAILED,
                "remark": row.note,
            }
            for row in rows
        ]
    )


def verdict_text(rows: Sequence[ClaimRow]) -> str:
    """How many rows agree, and which do not."""
    differing = [row for row in rows if not row.agrees]
    lines = [f"{len(rows) - len(differing)} of {len(rows)} of the paper's numbers agree with ours."]
    lines += [f"  differs: {row.claim}: paper {row.paper}, ours {row.ours:.3g} {row.unit}" for row in differing]
    return "\n".join(lines)
