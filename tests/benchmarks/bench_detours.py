"""Random walls in the way, `then: detour`: how many hits until they are passed, and none where a wall is remembered.

    python -m tests.benchmarks.bench_detours [FLIGHTS]

Flies each wall with both airframes and prints a line for each, and what bench/notes/results.md says of all.
"""

import math
import random
import statistics
import sys
from dataclasses import dataclass

from shapely import Point

from companion.memory.patch import Patch
from companion.memory.stored import KnownPatch
from companion.memory.surroundings import core
from companion.report import FlightReport
from tests.simulated import SimulatedFlight, simulated

SEED = 1
REACH_M = 0.2
GOAL_NED_M = (7.0, 0.0, -1.5)


@dataclass(frozen=True)
class Wall:
    """Its face 4 m north, its middle so far east, turned by so much about the vertical."""

    width_m: float
    east_m: float
    yaw_deg: float


@dataclass(frozen=True)
class Detour:
    """`off_known_m`: of each hit on a way, how far the centre was from the nearest wall remembered before it.

    `while_recovering`: hits that came before the one before them had been recovered from.
    """

    report: FlightReport
    off_known_m: list[float]
    while_recovering: int
    nearest_to_goal_m: float


def fly_detour(wall: Wall, speed_m_s: float, airframe: str, seed: int) -> Detour:
    yaw_rad = math.radians(wall.yaw_deg)
    screen = {
        "name": "screen",
        "point_ned_m": [4, wall.east_m, -1.5],
        "normal_ned": [-math.cos(yaw_rad), math.sin(yaw_rad), 0],
        "width_m": wall.width_m,
        "height_m": 3,
    }
    items = [
        {"takeoff": {"height_m": 1.5}},
        {"go_to": {"position_ned_m": list(GOAL_NED_M), "speed_m_s": speed_m_s}},
        {"return": {}},
    ]
    flight = simulated(
        "detour",
        items=items,
        on_collision={"then": "detour", "max_hits": 12},
        # too low to fly over it
        fence={"radius_m": 10, "max_height_m": 2.5},
        sim={"airframe": airframe, "seed": seed, "walls": [screen]},
    )
    report = flight.run_to_end(600.0)
    path = flight.series["position_ned_m"]
    nearest_m = min(math.dist(place, GOAL_NED_M) for place in path[::50].tolist())
    return Detour(report, *_beside_known(flight), nearest_m)


def _beside_known(flight: SimulatedFlight) -> tuple[list[float], int]:
    """By the timeline: each hit on a way beside what had been remembered when it came, and how many others."""
    known: list[Patch] = []
    found, others, is_recovering = [], 0, False
    north_m, east_m, _ = flight.report.origin_ned_m
    for event in flight.events:
        if event.kind == "obstacle":
            known.append(KnownPatch.model_validate(event.data).patch())
        elif event.kind == "recovered":
            is_recovering = False
        elif event.kind == "detection" and is_recovering:
            others += 1
        elif event.kind == "detection":
            is_recovering = True
            if not known:
                continue
            north, east, _ = event.data["position_ned_m"]
            centre = Point(north - north_m, east - east_m)
            found.append(min(core(patch).distance(centre) for patch in known))
    return found, others


def main() -> None:
    flights = int(sys.argv[1]) if len(sys.argv) > 1 else 20
    print(f"seed {SEED}, {flights} walls: 0.5 to 5 m wide, up to 35 degrees askew, met at 0.8 to 2.5 m/s")
    for airframe in ("foldable", "rigid"):
        draw = random.Random(SEED)
        hits, others, through, off_m = [], 0, 0, []
        for seed in range(1, flights + 1):
            wall = Wall(draw.choice([0.5, 1.5, 3.0, 5.0]), draw.uniform(-1.0, 1.0), draw.uniform(-35.0, 35.0))
            speed_m_s = draw.uniform(0.8, 2.5)
            detour = fly_detour(wall, speed_m_s, airframe, seed)
            reached = detour.nearest_to_goal_m < 0.5 and detour.report.outcome == "completed"
            through += reached
            hits.append(len(detour.report.collisions))
            off_m += detour.off_known_m
            others += detour.while_recovering
            nearest = f"{min(detour.off_known_m):.2f} m" if detour.off_known_m else "-"
            end = "goal" if reached else f"{detour.report.reason}, out of reach: {detour.report.unreachable}"
            print(f"{airframe} {seed:2d}: {wall}, {speed_m_s:.1f} m/s: {hits[-1]} hits, nearest known {nearest}, {end}")
        again = sum(distance_m < REACH_M for distance_m in off_m)
        print(
            f"{airframe}: {through} of {flights} reached the goal, hits {statistics.mean(hits):.1f} in the mean and "
            f"{max(hits)} at most, {others} of all while recovering; of {len(off_m)} hits on ways with a wall "
            f"remembered {again} were on it, the nearest had the centre {min(off_m, default=float('nan')):.2f} m off"
        )


if __name__ == "__main__":
    main()
