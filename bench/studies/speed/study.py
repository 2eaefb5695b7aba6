"""`bench speed`: how many times real time, and the budget of an interval; or the calls, or the latency, alone."""

import os
from argparse import Namespace

from bench.rows.tables import Page, table
from bench.stamps import FLOWN
from bench.studies.speed.budget import measured_budget
from bench.studies.speed.calls import calls_an_interval, hold_to
from bench.studies.speed.flight import fly, parse_us
from bench.studies.speed.latency import measured
from bench.studies.speed.parts import PARTS

CODE = (*FLOWN, "rebound_cli")


def run_speed(options: Namespace) -> int:
    """0 when it is measured, whatever it says."""
    if options.calls:
        fly()  # what is imported or compiled at first counts for nothing
        calls = calls_an_interval()
        hold_to(calls)
        print(f"{sum(calls.values()):.1f} calls an interval: {calls}")
        return 0
    page = Page(options.out, "speed")
    if options.latency:
        parts = {"From the hit to the setpoint": latency_table(options.latency)}
    else:
        os.sched_setaffinity(0, {min(os.sched_getaffinity(0))})
        fly()
        parts = {
            "Times real time": flights_table(options.flights),
            "An interval of 4 ms": budget_table(options.flights),
        }
    page.write("Speed", options.typed, parts, code=CODE)
    print("\n".join(parts.values()))
    return 0


def flights_table(flights: int) -> str:
    """The best and the worst. A product with the parser's time is the same on a fast machine and on a slow one."""
    flown = []
    for _ in range(flights):
        before_us, (factor, processor_factor) = parse_us(), fly()
        parsed_us = (before_us + parse_us()) / 2
        flown.append((factor * parsed_us, factor, processor_factor, parsed_us))
    names = (
        "product of the first and the last",
        "times real time",
        "by the processor's time",
        "a parse of HIGHRES_IMU [µs]",
    )
    best, worst = max(flown), min(flown)
    rows = zip(names, best, worst, strict=True)
    return table([{"": name, "best": f"{most:.2f}", "worst": f"{least:.2f}"} for name, most, least in rows])


def budget_table(flights: int) -> str:
    budget, calls = measured_budget(flights), calls_an_interval()
    spent = {part.name: (budget.mean_us[part.name], calls[part.name]) for part in PARTS}
    spent["together"] = (budget.total_us, sum(calls.values()))
    return table(
        [
            {"part": name, "µs": f"{us:.1f}", "share": f"{us / budget.total_us:.0%}", "calls": f"{count:.0f}"}
            for name, (us, count) in spent.items()
        ]
    )


def latency_table(hits: int) -> str:
    """Milliseconds."""
    columns = {"p50": "p50", "p99": "p99", "p999": "p99.9", "most": "most"}
    rows = [
        {"beside it": state, "setpoints": row["found"]} | {label: f"{row[key]:.2f}" for key, label in columns.items()}
        for state, row in measured(hits).items()
    ]
    return table(rows)
