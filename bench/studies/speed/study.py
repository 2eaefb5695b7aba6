"""`bench speed`: how many times real time, and the budget of an interval; or the latency alone."""

import gc
import importlib
import os
import statistics
import tempfile
from argparse import Namespace
from collections.abc import Callable
from pathlib import Path
from time import perf_counter_ns, process_time
from typing import Any, NamedTuple
from unittest.mock import patch

import pandas as pd
from pymavlink.dialects.v20 import development as dialect

from bench.fly.lockstep import flown_in
from bench.rows.tables import table
from bench.studies.speed.latency import measured
from bench.studies.study import Shown, page_path, write_page
from rebound_cli.inputs import load_mission_document, mission_from, world_from

MISSION = Path(__file__).parents[3] / "missions" / "wall.yaml"
REPEATS = 2000


class Part(NamedTuple):
    """A function ("module:name" or "module:Class.name"), and the part that calls it, whose time is without it."""

    name: str
    place: str
    caller: str = ""


KERNEL, PLANT, VEHICLE, COMPANION, LOG = "plant: kernel", "plant: the rest", "vehicle: autopilot", "companion", "log"
PARTS = (
    Part(KERNEL, "sim_vehicle.plant.plant:advance_interval", PLANT),
    Part(PLANT, "sim_vehicle.plant.plant:Plant._advance", VEHICLE),
    Part(VEHICLE, "sim_vehicle.vehicle:SimulatedVehicle.advance"),
    Part("vehicle: MAVLink in", "sim_vehicle.mavlink.link:Link.receive", VEHICLE),
    Part("vehicle: MAVLink out", "sim_vehicle.mavlink.link:Link.update", VEHICLE),
    Part("companion: MAVLink in", "companion.mavlink.decode:Decoder.feed", COMPANION),
    Part(COMPANION, "companion.companion:Stepped.step"),
    Part("companion: MAVLink out", "companion.mavlink.encode:Encoder.all_packets", COMPANION),
    # The last of an interval of a flight that is logged.
    Part(LOG, "rebound_cli.results.run_folder:FlightRecorder.record"),
)


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
        # Milliseconds.
        parts = {"From the hit to the setpoint": table(measured(options.latency))}
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
    # The first is the product of the second and the last.
    names = ["product", "times real time", "by the processor's time", "a parse of HIGHRES_IMU [µs]"]
    rows = pd.DataFrame({"": names, "best": max(flown), "worst": min(flown)})
    return table(rows.round(2))


def budget_table(flights: int) -> str:
    """Each part's time without the parts that it calls: the least of so many flights, which are the same to the bit."""
    flown = [spent_us() for _ in range(flights)]
    least = {part.name: min(spent[part.name] for spent in flown) for part in PARTS}
    own = {name: us - sum(least[part.name] for part in PARTS if part.caller == name) for name, us in least.items()}
    own["together"] = total_us = sum(own.values())
    return table([{"part": name, "µs": f"{us:.1f}", "share": f"{us / total_us:.0%}"} for name, us in own.items()])


def spent_us() -> dict[str, float]:
    """Of an interval, by part, with the parts that it calls; a timer costs 0.1 us, which its caller has."""
    spent_ns, intervals = dict.fromkeys((part.name for part in PARTS), 0), 0

    def timed(name: str, function: Callable[..., Any]) -> Callable[..., Any]:
        def run(*arguments: Any, **named: Any) -> Any:
            nonlocal intervals
            begun = perf_counter_ns()
            try:
                return function(*arguments, **named)
            finally:
                spent_ns[name] += perf_counter_ns() - begun
                intervals += name == LOG

        return run

    timers = []
    for part in PARTS:
        module, _, names = part.place.partition(":")
        owner: Any = importlib.import_module(module)
        *classes, name = names.split(".")
        for class_name in classes:
            owner = getattr(owner, class_name)
        timers.append(patch.object(owner, name, timed(part.name, getattr(owner, name))))
        timers[-1].start()
    try:
        fly()
    finally:
        for timer in timers:
            timer.stop()
    return {name: 1e-3 * ns / intervals for name, ns in spent_ns.items()}
