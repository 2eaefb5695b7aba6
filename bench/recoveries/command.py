"""`bench campaign recoveries`: hits with laws `paper` and `adaptive`, as a table in build/recovery.md."""

import statistics
from argparse import Namespace
from collections.abc import Iterator, Sequence
from pathlib import Path

from bench.campaign.plan import Campaign, Json
from bench.campaign.run import Results, Workers, failures_text, run_campaign
from bench.marked import checked_text, write_part
from bench.recoveries.hits import AIRFRAMES, LAWS, SLANTS_DEG, SPEEDS_M_S, RecoveryCase, of, recoveries_campaign
from bench.stamps import stamp_text

PART = "recoveries"


def run_recoveries(options: Namespace) -> int:
    """0 when the table is written, whatever it says; 1 when a flight failed to be flown."""
    checked_text(options.out, PART)
    campaign = recoveries_campaign(options.seeds)
    results = run_campaign(campaign, Workers(options.jobs))
    write_table(options.out, campaign, results, options.seeds)
    return 1 if results.failures else 0


def write_table(path: Path, campaign: Campaign, results: Results, seeds: int) -> None:
    """Make what stands between the document's marks anew. Raises MarkedPartError where there are none."""
    body = "\n".join([*_lines(campaign.cases, results.results, seeds), failures_text(campaign, results), ""])
    write_part(path, PART, body)
    print(f"Written to {path}.")


def _lines(cases: Sequence[RecoveryCase], results: dict[int, Json], seeds: int) -> Iterator[str]:
    stamp = stamp_text(f"python -m bench campaign recoveries --seeds {seeds}")
    yield f"{stamp}: {len(cases)} flights through the whole wire;"
    yield "each cell `paper` → `adaptive`. Settled: median; the others: the worst. Clear: the guards' distance at rest."
    yield "Touched again: flights, and in brackets those of them in which the centre had come back to the wall."
    yield ""
    yield "| airframe, slant | speed | settled | past the setpoint | clear | height lost | risen | touched again |"
    yield "|---|---|---|---|---|---|---|---|"
    for airframe in AIRFRAMES:
        for slant in SLANTS_DEG:
            for speed in SPEEDS_M_S:
                pair = [
                    of(cases, results, law=law, airframe=airframe, slant_deg=slant, speed_m_s=speed) for law in LAWS
                ]
                yield f"| {airframe}, {slant}° | {speed:g} m/s | {' | '.join(_cells(*pair))} |"
    yield ""
    yield _summary(cases, results)


def _cells(paper: list[Json], adaptive: list[Json]) -> Iterator[str]:
    yield f"{_median(paper)} → {_median(adaptive)}"
    for key in ("past_m", "clear_m", "lost_m", "risen_m"):
        worst = min if key == "clear_m" else max
        yield " → ".join(
            _metres(worst(values) if (values := _known(flights, key)) else None) for flights in (paper, adaptive)
        )
    yield " → ".join(_touched_again(flights) for flights in (paper, adaptive))


def _touched_again(flights: list[Json]) -> str:
    again, back = (sum(flight.get(key, 0) > 0 for flight in flights) for key in ("recontacts", "returned"))
    return f"{again} ({back})"


def _summary(cases: Sequence[RecoveryCase], results: dict[int, Json]) -> str:
    ratios = []
    paper, adaptive = (
        {(c.airframe, c.slant_deg, c.speed_m_s, c.seed): results.get(n) for n, c in enumerate(cases) if c.law == law}
        for law in LAWS
    )
    for key, before in paper.items():
        after = adaptive[key]
        if before and after and before.get("settled_s") and after.get("settled_s"):
            ratios.append(after["settled_s"] / before["settled_s"])
    faster = f"{100 * (1 - statistics.median(ratios)):.0f} %" if ratios else "not known how much"
    return f"Of the {len(ratios)} hits after which both settled, `adaptive` settles {faster} sooner in the median."


def _known(flights: list[Json], key: str) -> list[float]:
    return [flight[key] for flight in flights if flight.get(key) is not None]


def _median(flights: list[Json]) -> str:
    values = _known(flights, "settled_s")
    missing = len(flights) - len(values)
    return (f"{statistics.median(values):.2f} s" if values else "–") + (f" ({missing} not)" if missing else "")


def _metres(value: float | None) -> str:
    return "–" if value is None else f"{value:.2f}"
