"""Speed, measured: `python tests/benchmarks/bench_speed.py`. Nothing here passes or fails.

Prints the whole lockstep loop over the mission wall.yaml (times real time, log on, one core), its parts for each
interval of 4 ms, and the share of a core that `rebound sim` needs to keep real time.
"""

import os
import resource
import statistics
import subprocess
import sys
import tempfile
import time
from pathlib import Path

from companion.companion import Companion
from rebound_cli.inputs import load_mission_document, mission_from, world_from
from rebound_cli.interrupts import Interrupts
from rebound_cli.lockstep import EPOCH_US, fly_mission_lockstep
from rebound_cli.run_folder import FlightRecorder
from sim_vehicle.vehicle import SimulatedVehicle

MISSION = Path("missions/wall.yaml")
RUNS = 7
SIM_SECONDS = 20


def lockstep_factor() -> float:
    """Virtual time over wall clock of one whole flight with its log."""
    document = load_mission_document(MISSION, [], None, None)
    world = world_from(document)
    with tempfile.TemporaryDirectory() as folder:
        recorder = FlightRecorder(Path(folder))
        flown, _ = fly_mission_lockstep(mission_from(document, world), world, recorder, Interrupts())
        recorder.close()
    return (flown.report.ended_at_us - flown.report.started_at_us) * 1e-6 / flown.wall_clock_s


def parts_us() -> tuple[float, float, float]:
    """Mean microseconds per interval: vehicle, companion; and IMU samples per second of flight."""
    document = load_mission_document(MISSION, [], None, None)
    world = world_from(document)
    companion = Companion(mission_from(document, world))
    vehicle = SimulatedVehicle(world.airframe, world.scene, world.seed)
    companion.confirm_plan()
    pending, intervals, vehicle_s, companion_s = b"", 0, 0.0, 0.0
    while not companion.finished:
        begun = time.perf_counter()
        frames = vehicle.step(pending)
        between = time.perf_counter()
        result = companion.step(b"".join(frames), EPOCH_US + vehicle.time_boot_us)
        pending = b"".join(result.sent_frames)
        companion_s += time.perf_counter() - between
        vehicle_s += between - begun
        intervals += 1
    rates = companion.report().stream_rates_hz
    return 1e6 * vehicle_s / intervals, 1e6 * companion_s / intervals, rates["HIGHRES_IMU"]


def sim_share_of_a_core() -> float:
    """CPU seconds of `rebound sim` for each second, start-up left out by measuring two lengths."""

    def cpu_s(seconds: float) -> float:
        before = resource.getrusage(resource.RUSAGE_CHILDREN)
        process = subprocess.Popen(
            [sys.executable, "-m", "rebound_cli", "sim", "--port", "0", "--stop-with-stdin"], stdin=subprocess.PIPE
        )
        time.sleep(seconds)
        process.communicate()
        after = resource.getrusage(resource.RUSAGE_CHILDREN)
        return after.ru_utime + after.ru_stime - before.ru_utime - before.ru_stime

    return (cpu_s(5 + SIM_SECONDS) - cpu_s(5)) / SIM_SECONDS


def main() -> None:
    os.sched_setaffinity(0, {sorted(os.sched_getaffinity(0))[0]})
    lockstep_factor()
    factors = [lockstep_factor() for _ in range(RUNS)]
    print(
        f"lockstep: {statistics.median(factors):.0f} times real time (of {RUNS}: {min(factors):.0f}-{max(factors):.0f})"
    )
    vehicle_us, companion_us, imu_hz = parts_us()
    parts = f"vehicle {vehicle_us:.0f} us, companion {companion_us:.0f} us"
    print(f"an interval of 4 ms: {parts}; HIGHRES_IMU {imu_hz:.0f} Hz")
    print(f"rebound sim: {sim_share_of_a_core():.3f} of a core at real time")


if __name__ == "__main__":
    main()
