"""What every study of the paper is: flights, and what is concluded from their rows (`bench/rows/paper.py`).

`claims.yaml` has what the paper says and how far ours may be from it.
"""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np
import pandas as pd
import yaml
from matplotlib.figure import Figure

from bench.rows.paper import BREAKING_FORCE_N, StudyFlight
from bench.rows.tables import table

Claim = dict[str, str]
PASSED, FAILED = "agrees", "**differs**"
CLAIMS: dict[str, dict[str, str | float]] = yaml.safe_load(Path(__file__).with_name("claims.yaml").read_text("utf-8"))


@dataclass(frozen=True, slots=True)
class Findings:
    """`tables` by their headings; pictures by the name of their file."""

    rows: Sequence[Claim]
    pictures: Mapping[str, Figure] = field(default_factory=dict)
    tables: Mapping[str, str] = field(default_factory=dict)


@dataclass(frozen=True, slots=True)
class Study:
    """`conclude` gets a row of each flight, in their order."""

    title: str
    flights: Callable[[], list[StudyFlight]]
    conclude: Callable[[pd.DataFrame], Findings]


def flown_table(flights: pd.DataFrame, **names: str) -> str:
    """Of flights that hit the wall: a row for those alike in some columns, under these headings."""
    groups = flights[flights["hits"] > 0].groupby(list(names), sort=False)
    return table([dict(zip(names.values(), key, strict=True)) | _cells(some) for key, some in groups])


def _cells(flights: pd.DataFrame) -> dict[str, object]:
    """Overshoot by the truth, and as the vehicle itself saw it."""
    ratio, seen = flights["rebound_m_s"] / flights["impact_m_s"], flights[flights["seen"]]
    back_m = [np.hypot(*np.subtract(*places)[:2]) for places in zip(seen["contact_m"], seen["setpoint_m"], strict=True)]
    return {
        "flights": len(flights),
        "`HIGHRES_IMU` received [Hz]": f"{flights['imu_hz'].mean():.0f}",
        "first hit lost": flights["lost"].sum(),
        "first hit seen": len(seen),
        "latency, mean [ms]": f"{1e3 * seen['latency_s'].mean():.1f}" if len(seen) else "",
        "touched again": (flights["again"] > 0).sum(),
        "with a second hit": (flights["second_hits"] > 0).sum(),
        "contact, mean [ms]": f"{1e3 * flights['contact_s'].mean():.1f}",
        "speed after / before": f"{ratio.mean():.2f} ({ratio.min():.2f} to {ratio.max():.2f})",
        "setpoint from true x(t_c) [m]": f"{np.mean(back_m):.2f}" if back_m else "",
        "overshoot, max [m]": number(round(float(flights["past_m"].max()), 3)),
        "by its own estimate [m]": number(round(float(flights["own_past_m"].max()), 3)),
        "peak force, max [N]": f"{flights['peak_n'].max():.0f}",
        "factor of safety": f"{BREAKING_FORCE_N / flights['peak_n'].max():.2f}",
    }


# --- verdicts


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
