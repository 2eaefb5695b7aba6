"""Energy out of hits, counted: `python -m tests.benchmarks.bench_obstacles`. Nothing here passes or fails.

Throws leaning and tumbling vehicles at every kind of obstacle and prints, for each, how many hits there were, how many
gave more energy than a two-thousandth of what they took, and the worst of those.
"""

import numpy as np

from tests.sim_vehicle.physics.test_obstacles import HEIGHT_M, SCENES, smooth, thrown

THROWS = 80


def gains(name: str, scene: str) -> list[float]:
    """Energy gained over energy before, of every hit."""
    airframe, rng, found = smooth(name), np.random.default_rng(5), []
    for number in range(THROWS):
        plant = thrown(
            airframe,
            SCENES[scene],
            (1.5, rng.uniform(-0.3, 0.3), -HEIGHT_M - rng.uniform(0.0, 0.3)),
            (rng.uniform(2, 4), rng.uniform(-1, 1), rng.uniform(-1, 1)),
            rng.uniform(-3, 3),
            rng.uniform(-3, 3, 3) * (number % 2),
            rng.uniform(-0.5, 0.5, 2) * (number % 3 == 0),
            duration_s=0.4,
        )
        series = plant.truth.series()
        for hit in plant.truth.hits:
            start_m, end_m = (
                np.interp(time_us, series["time_boot_us"], series["position_ned_m"][:, 2])
                for time_us in (hit.contact_at_boot_us, hit.ended_at_boot_us)
            )
            fallen_j = airframe.mass_kg * 9.81 * (end_m - start_m)
            found.append((hit.energy_after_j - hit.energy_before_j - fallen_j) / hit.energy_before_j)
    return [float(gain) for gain in found]


def main() -> None:
    for scene in SCENES:
        for name in ("foldable", "rigid"):
            shares = gains(name, scene)
            more = [share for share in shares if share > 5e-4]
            worst = f", the worst {100 * max(more):.1f} %" if more else ""
            print(f"{scene:13} {name:9} {len(shares):4} hits, {len(more)} gave energy{worst}")


if __name__ == "__main__":
    main()
