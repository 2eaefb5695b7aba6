"""The paper's numbers beside ours: `claims.yaml` has what the paper says and how far ours may be from it."""

from collections.abc import Sequence
from pathlib import Path

import yaml

Claim = dict[str, str]
PASSED, FAILED = "agrees", "**differs**"
CLAIMS: dict[str, dict[str, str | float]] = yaml.safe_load(Path(__file__).with_name("claims.yaml").read_text("utf-8"))


def claim(name: str, ours: float, expected: float | None = None, **words: object) -> Claim:
    """The row of the claim of that name, with what was measured. `expected`: where eq. 2 or our own v_c says it."""
    stated = CLAIMS[name]
    if expected is None and "expected" in stated:
        expected = float(stated["expected"])
    claimed, paper, unit, note = (
        str(stated.get(part, "")).format(expected=expected, **words) for part in ("claim", "paper", "unit", "note")
    )
    low, high = _bounds(stated, expected)
    agrees = (low is None or ours >= low) and (high is None or ours <= high)
    return {
        "claim": claimed,
        "paper": paper,
        "ours": f"{number(ours)} {unit}".strip(),
        "tolerance": _tolerance(low, high),
        "verdict": PASSED if agrees else FAILED,
        "remark": note,
    }


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


def _tolerance(low: float | None, high: float | None) -> str:
    if low is not None and high is not None:
        return f"{number(low)} to {number(high)}"
    return f"at most {number(high or 0.0)}" if low is None else f"at least {number(low)}"


def number(value: float) -> str:
    """Three digits that count, no exponent for what people say in full, no minus before zero."""
    text = f"{value:.3g}" if abs(value) < 1000 else f"{value:.0f}"
    return "0" if float(text) == 0.0 else text


def verdict_text(rows: Sequence[Claim]) -> str:
    """How many rows agree, and which do not."""
    differing = [row for row in rows if row["verdict"] == FAILED]
    lines = [f"{len(rows) - len(differing)} of {len(rows)} of the paper's numbers agree with ours."]
    lines += [f"  differs: {row['claim']}: paper {row['paper']}, ours {row['ours']}" for row in differing]
    return "\n".join(lines)
