"""Random walls in the way, `then: detour`: how many hits until they are passed, and none where a wall is remembered.

    python -m tests.benchmarks.bench_detours [FLIGHTS]

Flies each wall with both airframes and prints a line for each, and what bench/notes/results.md says of all.
"""

import random
import statistics
import sys

from tests.benchmarks.detours import Wall, fly_detour

SEED = 1
REACH_M = 0.2


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
