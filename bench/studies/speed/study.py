"""`bench speed`: how many times real time, and the budget of an interval; or the latency alone."""

import gc
import os
import statistics
import tempfile
from argparse import Namespace
from pathlib import Path
from time import perf_counter_ns, process_time

from pymavlink.dialects.v20 import development as dialect

from bench.fly.lockstep import flown_in
from bench.rows.tables import table
from bench.studies.speed.latency import measured
from bench.studies.speed.parts import calls_an_interval, mean_us
from bench.studies.study import Shown, page_path, write_page
from rebound_cli.inputs import load_mission_document, mission_from, world_from

MISSION = Path(__file__).parents[3] / "missions" / "wall.yaml"
REPEATS = 2000


def fly() -> tuple[float, float]:
    """One flight as `rebound fly wall --lockstep` flies it, with its log: virtual time over wall clock, and over what
    this process had of a processor.
    """
    document = load_mission_document(MISSION, [], None, None)
    world = world_from(document)
    with tempfile.TemporaryDirectory() as folder:
        # What flights before have left is not this one's.
        gc.collect()
        mission, begun_s = mission_from(document, world), process_time()
        flown, _ = flown_in(Path(folder), mission, world.scene, world.airframe)
        processor_s = process_time() - begun_s
    virtual_s = (flown.report.ended_at_us - flown.report.started_at_us) * 1e-6
    return virtual_s / flown.wall_clock_s, virtual_s / processor_s


def parse_us() -> float:
    """One HIGHRES_IMU through pymavlink's own parser, whose checksum is fastcrc's: median microseconds."""
    link = dialect.MAVLink(None, 1, 1)
    force, rates, field, air = (0.1, -0.2, -9.8), (0.01, 0.02, -0.03), (0.2, 0.0, 0.4), (950.0, 0.0, 490.0, 20.0)
    packet = bytes(dialect.MAVLink_highres_imu_message(12_345_678, *force, *rates, *field, *air, 0x3F, 0).pack(link))
    spent = []
    for _ in range(REPEATS):
        begun = perf_counter_ns()
        link.parse_buffer(packet)
        spent.append(perf_counter_ns() - begun)
    return statistics.median(spent) / 1e3


def run_speed(options: Namespace) -> int:
    """0 when it is measured, whatever it says."""
    page = page_path(options.out, "speed")
    if options.latency:
        parts = {"From the hit to the setpoint": latency_table(options.latency)}
    else:
        os.sched_setaffinity(0, {min(os.sched_getaffinity(0))})
        fly()
        parts = {
            "Times real time": flights_table(options.flights),
            "An interval of 4 ms": budget_table(options.flights),
        }
    write_page(page, "Speed", options.typed, Shown(parts))
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
    spent_us, calls = mean_us(fly, flights), calls_an_interval(fly)
    spent_us["together"], calls["together"] = total_us, _ = sum(spent_us.values()), sum(calls.values())
    return table(
        [
            {"part": name, "µs": f"{us:.1f}", "share": f"{us / total_us:.0%}", "calls": f"{calls[name]:.0f}"}
            for name, us in spent_us.items()
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
