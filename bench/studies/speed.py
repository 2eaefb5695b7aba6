"""`bench speed`: how many times real time a flight in lockstep goes; or how soon a hit is answered in real time."""

import contextlib
import gc
import io
import math
import multiprocessing
import os
import socket
import statistics
import tempfile
import time
from argparse import Namespace
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path
from time import perf_counter_ns
from typing import Any

import numpy as np
import pandas as pd
from pymavlink.dialects.v20 import development as dialect

from bench.fly.campaign import Json
from bench.fly.faulted import mission_of
from bench.fly.lockstep import Stepped, flown_in
from bench.rows.tables import table
from bench.studies.study import Shown, page_path, write_page
from companion.companion import Companion
from companion.mavlink.packet import message_id_of
from companion.mission.model import Mission
from companion.shell.clock import Clock
from companion.shell.connections.addresses import open_connection
from companion.shell.service_manager import ServiceManager
from rebound_cli.background import Background
from rebound_cli.inputs.inputs import load_mission_document, mission_from, world_from
from rebound_cli.live.console import Console
from rebound_cli.live.interrupts import Interrupts
from rebound_cli.live.realtime import Loop
from rebound_cli.results.run_folder import FlightRecorder
from rebound_cli.results.timing import undisturbed
from rebound_cli.simulation.lockstep import EPOCH_US
from sim_vehicle.airframe import load_built_in
from sim_vehicle.scene import Scene
from sim_vehicle.vehicle import SimulatedVehicle

MISSION = Path(__file__).parents[2] / "missions" / "wall.yaml"
REPEATS = 2000


def fly() -> float:
    """One flight as `rebound fly wall --lockstep` flies it, with its log: virtual time over wall clock."""
    document = load_mission_document(MISSION, [], None, None)
    world = world_from(document)
    with tempfile.TemporaryDirectory() as folder:
        # What flights before have left is not this one's.
        gc.collect()
        flown, _ = flown_in(Path(folder), mission_from(document, world), world.scene, world.airframe)
    return (flown.report.ended_at_us - flown.report.started_at_us) * 1e-6 / flown.wall_clock_s


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
        parts = {"Times real time": flights_table(options.flights)}
    write_page(page, "Speed", options.typed, Shown(parts))
    print("\n".join(parts.values()))
    return 0


def flights_table(flights: int) -> str:
    """The best and the worst. A product with the parser's time is the same on a fast machine and on a slow one."""
    flown = []
    for _ in range(flights):
        before_us, factor = parse_us(), fly()
        parsed_us = (before_us + parse_us()) / 2
        flown.append((factor * parsed_us, factor, parsed_us))
    # The first is the product of the others.
    names = ["product", "times real time", "a parse of HIGHRES_IMU [µs]"]
    rows = pd.DataFrame({"": names, "best": max(flown), "worst": min(flown)})
    return table(rows.round(2))


# --- from a hit's datagram to the setpoint on the wire, at 250 Hz, quiet and beside two busy loops

SET_ATTITUDE_TARGET = 82
BUSY_LOOPS, _FLIGHTS = 2, 5
# Intervals in real time before the hit.
LEAD = 30
# Intervals after the hit in which a setpoint is waited for: half a second.
AFTER = 125


@dataclass(frozen=True, slots=True)
class Recorded:
    """What the vehicle said in each interval, and the interval whose packets show the hit."""

    mission: Mission
    said: Sequence[bytes]
    hit: int


class Going(Clock):
    """The real clock, from a moment of the recording on."""

    def __init__(self, from_us: int) -> None:
        super().__init__()
        self._ahead_us = from_us - super().now_us()

    def now_us(self) -> int:
        return super().now_us() + self._ahead_us


def recorded(mission: Mission) -> Recorded:
    """The flight up to its first hit, and what the vehicle says after it to whoever does nothing."""
    scene = Scene.model_validate(mission.sim or {})
    companion = Companion(mission)
    companion.confirm_plan()
    flight = Stepped(SimulatedVehicle(load_built_in(scene.airframe), scene, scene.seed), companion)
    said: list[bytes] = []
    while not companion.finished:
        results = flight.step()
        said.append(b"".join(frame for result in results for frame in result.received_frames))
        if any(event.kind == "detection" for result in results for event in result.events):
            after = [flight.step_alone() for _ in range(AFTER)]
            return Recorded(mission, [*said, *after], len(said) - 1)
    raise AssertionError("the vehicle never met the wall")


def now_us_of(interval: int) -> int:
    return EPOCH_US + 4000 * (interval + 2)


def timed(flight: Recorded, times: int) -> Iterator[float | None]:
    """Seconds from the hit's datagram to the recovery setpoint; None where there was none in time."""
    with tempfile.TemporaryDirectory() as folder, socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as ours:
        ours.bind(("127.0.0.1", 0))
        for trial in range(times):
            (place := Path(folder) / str(trial)).mkdir()
            with beside(_fly_on, flight, ours.getsockname()[1], place):
                yield exchanged(flight, flight.hit - LEAD, ours, _address_of_child(ours))


@contextlib.contextmanager
def beside(run: Callable[..., None], *arguments: Any) -> Iterator[None]:
    """A process, killed in the end."""
    child = multiprocessing.get_context("fork").Process(target=run, args=arguments)
    child.start()
    try:
        yield
    finally:
        child.kill()
        child.join()


def _fly_on(flight: Recorded, port: int, folder: Path) -> None:
    """The child: the loop of real flights, log and all, with a service's priority. It flies to there itself, in memory
    that is its own."""
    companion, start = Companion(flight.mission), flight.hit - LEAD
    companion.confirm_plan()
    for interval in range(start):
        companion.step(flight.said[interval], now_us_of(interval))
    connection = open_connection(f"udpout://127.0.0.1:{port}")
    recorder = FlightRecorder(folder, Background("log"))
    clock = Going(now_us_of(start))
    loop = Loop(companion, connection, clock, recorder, Console(io.StringIO(), Background("console")), Interrupts())
    ServiceManager("@nobody", None).go_first()
    companion.rehearse()
    with undisturbed():
        connection.send(b"\0")
        while True:
            loop.exchange()


def exchanged(flight: Recorded, start: int, ours: socket.socket, theirs: tuple[str, int]) -> float | None:
    """Plays what the vehicle said from an interval on. Seconds from the hit's datagram to the first attitude."""
    began_s, hit_s = time.monotonic(), math.inf
    for interval in range(start, len(flight.said)):
        due_s = began_s + 0.004 * (interval - start)
        while (left_s := due_s - time.monotonic()) > 0.0:
            ours.settimeout(left_s)
            try:
                frame, sender = ours.recvfrom(65_536)
            except TimeoutError:
                break
            at_s = time.monotonic()
            # Not the last words of the one before.
            if sender == theirs and len(frame) > 12 and message_id_of(frame) == SET_ATTITUDE_TARGET:
                return at_s - hit_s
        if interval == flight.hit:
            hit_s = time.monotonic()
        ours.sendto(flight.said[interval], theirs)
    return None


def _address_of_child(ours: socket.socket) -> tuple[str, int]:
    """Where its first packet came from; what an earlier child sent last is passed over."""
    ours.settimeout(10.0)
    data, sender = b"", ("", 0)
    while data != b"\0":
        data, sender = ours.recvfrom(65_536)
    return sender


def reckon() -> None:
    """For ever."""
    while True:
        math.fsum(range(1000))


def spread(taken: Sequence[float | None]) -> Json:
    """Milliseconds; one that did not come in time is without bound, and counts. One before the hit is below none."""
    sizes = [math.inf if seconds is None else 1e3 * seconds for seconds in taken]
    found = sum(0.0 <= size < math.inf for size in sizes)
    p50, p99, p999 = np.quantile(sizes, (0.5, 0.99, 0.999), method="inverted_cdf")
    shares = {"p50": p50, "p99": p99, "p99.9": p999, "most": max(sizes)}
    return {"setpoints": found, **{name: f"{size:.2f}" for name, size in shares.items()}}


def measured(hits: int) -> list[Json]:
    """Quiet and busy: how the milliseconds of so many hits are spread."""
    flights, times = [recorded(mission_of(number)) for number in range(_FLIGHTS)], -(-hits // _FLIGHTS)

    def spread_of_all(state: str) -> Json:
        return {"beside it": state, **spread([taken for flight in flights for taken in timed(flight, times)])}

    quiet = spread_of_all("quiet")
    with contextlib.ExitStack() as loops:
        for _ in range(BUSY_LOOPS):
            loops.enter_context(beside(reckon))
        return [quiet, spread_of_all("busy")]
