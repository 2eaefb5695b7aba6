"""The vehicle's own filter, measured: `python -m tests.benchmarks.bench_estimator [--missions]`, in a minute.

Prints the figures of bench/notes/results.md on its filter; with ``--missions`` also five flights of each mission.
Nothing here passes or fails.
"""

import json
import math
import subprocess
import sys
import tempfile
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np

from sim_vehicle.airframe import Airframe
from sim_vehicle.setpoint import TrajectorySetpoint
from tests.sim_vehicle.estimator.flying import HOVER, STEP_S, WITH_CAMERAS, Flight, circle, cruise, filtered, hit_wall

SEEDS = range(1, 11)
HIT_SEEDS = range(1, 6)
# 50 ms are no whole number of intervals.
AFTER_MS = (0, 52, 200, 1000, 2000)
MISSIONS = ("wall", "corner", "oblique", "paper", "square")
PX4_EXCESS = {"estimator": {"clipped_excess_m_s2": 4.9}}
AIRFRAME = "based_on: foldable\nname: foldable-ekf\nestimate: {kind: ekf}\n"

Way = Callable[[float], TrajectorySetpoint]


def straight(time_s: float) -> TrajectorySetpoint:
    """North, to 2 m/s and on."""
    return cruise(2.0)(time_s)


def hover(_: float) -> TrajectorySetpoint:
    return HOVER


def flights(title: str, airframe: Airframe, way: Way, seconds: float) -> None:
    """Velocity and position errors and innovations, pooled over the seeds."""
    squares, drifts = [], []
    pooled: dict[str, list[float]] = {}
    for seed in SEEDS:
        flight = Flight(airframe, seed)
        flight.climb()
        flight.forget_innovations()
        start = flight.position_error_m
        errors = flight.fly_along(way, seconds)
        squares.append((errors**2).mean(axis=0))
        drifts.append(np.hypot(*(flight.position_error_m - start)[:2]))
        for name, innovations in flight.onboard.filter.innovations.items():
            freedom, total = pooled.setdefault(name, [0.0, 0.0])
            pooled[name] = [freedom + innovations.count * innovations.dimension, total + innovations.total]
    north, east, down = np.sqrt(np.mean(squares, axis=0))
    print(f"{title}, {len(SEEDS)} flights of {seconds:.0f} s")
    print(f"  velocity error, RMS       {north:.3f} north, {east:.3f} east, {down:.3f} down m/s")
    print(f"  drift                     {np.sqrt(np.mean(np.square(drifts))):.3f} m RMS, {max(drifts):.3f} at most")
    for name, (freedom, total) in pooled.items():
        half = 1.96 * math.sqrt(2 / freedom)
        inside = "" if abs(total / freedom - 1) < half else "  outside"
        print(f"  NIS per value, {name:<10} {total / freedom:.3f} in {1 - half:.3f}..{1 + half:.3f}{inside}")


def hits(title: str, airframe: Airframe, speed_m_s: float) -> None:
    """Velocity error through a hit, mean and greatest over the seeds."""
    flown = [hit_wall(airframe, speed_m_s, seed, AFTER_MS) for seed in HIT_SEEDS]
    columns = [[hit.before for hit in flown]] + [[hit.after[moment] for hit in flown] for moment in AFTER_MS]
    figures = "   ".join(f"{np.mean(column):5.2f} ({max(column):4.2f})" for column in columns)
    clipped = np.mean([sum(hit.flight.output.clipping_counts) for hit in flown])
    resets = [hit.flight.output.reset_counter for hit in flown]
    print(f"  {title:<34}{figures}   {clipped:4.0f}      {resets}")


def drop_out() -> None:
    """Flow lost for 4 s in hover."""
    lost = {"sensors": {"optical_flow": {"lost_between_s": [[9.0, 13.0]]}}}
    print("Flow lost from 9 s to 13 s in hover: velocity error and reset counter just before and 0.3 s after")
    for seed in HIT_SEEDS:
        flight = Flight(filtered(changes=lost), seed)
        flight.climb()
        flight.fly(HOVER, 5.0 - 2 * STEP_S)
        before = np.linalg.norm(flight.velocity_error_m_s), flight.output.reset_counter
        flight.fly(HOVER, 0.3)
        after = np.linalg.norm(flight.velocity_error_m_s), flight.output.reset_counter
        print(f"  seed {seed}: {before[0]:.2f} m/s, {before[1]} -> {after[0]:.2f} m/s, {after[1]}")


def missions() -> None:
    """Five flights of each mission, through the whole lockstep loop."""
    with tempfile.TemporaryDirectory() as folder:
        airframe = Path(folder) / "ekf.yaml"
        airframe.write_text(AIRFRAME)
        for name in MISSIONS:
            summaries = [_flown(name, airframe, seed, Path(folder) / f"{name}{seed}") for seed in HIT_SEEDS]
            collisions = [c for summary in summaries for c in summary["collisions"]]
            completed = sum(summary["outcome"] == "completed" for summary in summaries)
            line = f"  {name:<9} completed {completed} of {len(summaries)}, hits {len(collisions)}"
            if collisions:
                line += _collision_figures(collisions)
            print(f"{line}, missed {sum(s['missed_contacts'] for s in summaries)}", flush=True)


def _flown(name: str, airframe: Path, seed: int, folder: Path) -> dict[str, Any]:
    command = [sys.executable, "-m", "rebound_cli", "fly", f"missions/{name}.yaml", "--lockstep", "--json"]
    command += ["--airframe", str(airframe), "--seed", str(seed), "--out", str(folder)]
    summary: dict[str, Any] = json.loads(subprocess.run(command, capture_output=True, text=True).stdout)
    return summary


def _collision_figures(collisions: list[dict[str, Any]]) -> str:
    shares, overshoots, true_overshoots = [], [], []
    for collision in collisions:
        if collision.get("truth") is None:
            return ", a detection without a hit"
        true_m_s = math.hypot(*collision["truth"]["impact_velocity_ned_m_s"])
        shares.append(collision["impact_speed_m_s"] / true_m_s - 1)
        overshoots.append(collision["overshoot_m"])
        true_overshoots.append(collision["truth"]["overshoot_m"])
    rms = 100 * float(np.sqrt(np.mean(np.square(shares))))
    return (
        f", v_c error {rms:.1f} % RMS, overshoot at most {100 * max(overshoots):.1f} cm by the estimate"
        f" and {100 * max(true_overshoots):.1f} cm by the truth"
    )


def main() -> None:
    flights("Hover at 1.5 m", filtered(), hover, 30.0)
    flights("Straight on to 2 m/s", filtered(), straight, 10.0)
    flights("Circle of 2 m at 1.5 m/s", filtered(), circle(2.0, 1.5), 20.0)
    flights("Hover with motion capture", filtered(changes=WITH_CAMERAS), hover, 30.0)
    flights("Circle with motion capture", filtered(changes=WITH_CAMERAS), circle(2.0, 1.5), 20.0)
    print(f"Velocity error through a hit, m/s, mean (greatest) of {len(HIT_SEEDS)} flights")
    moments = "".join(f"{f'{moment} ms':>15}" for moment in AFTER_MS)
    print(f"  {'':<34}{'before':>9}{moments}   clipped   resets by then")
    hits("foldable, 1 m/s", filtered(), 1.0)
    hits("foldable, 2 m/s", filtered(), 2.0)
    hits("foldable, 5 m/s", filtered(), 5.0)
    hits("foldable, 2 m/s, as PX4 (4.9)", filtered(changes=PX4_EXCESS), 2.0)
    hits("foldable, 2 m/s, motion capture", filtered(changes=WITH_CAMERAS), 2.0)
    hits("rigid, 1 m/s", filtered("rigid"), 1.0)
    hits("rigid, 2 m/s", filtered("rigid"), 2.0)
    hits("rigid, 2 m/s, as PX4 (4.9)", filtered("rigid", PX4_EXCESS), 2.0)
    hits("rigid, 2 m/s, motion capture", filtered("rigid", WITH_CAMERAS), 2.0)
    drop_out()
    if "--missions" in sys.argv:
        print("Missions by the filter, seeds 1 to 5")
        missions()


if __name__ == "__main__":
    main()
