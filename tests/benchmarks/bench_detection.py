"""The cost of detection, measured: `python tests/benchmarks/bench_detection.py`. Nothing here passes or fails.

From the decoded HIGHRES_IMU sample to the decision, through the whole watch (detector, estimate, sight), one sample a
call as in flight, on one core: microseconds for each IMU sample, alone and with the other messages of a flight (30 to
50 Hz each) charged to the IMU samples between them. The bar is 15 us for the first.
"""

import os
import random
import statistics
import time

from bench.detectors.config import BaselineConfig
from companion.messages import Attitude, AttitudeTarget, ImuSample, LandedState, LocalPosition, Odometry, Sample
from companion.reflex.detector import Situation
from companion.reflex.monitor import advance, start_monitor

INTERVAL_US = 4_000
SAMPLES = 20_000
ROUNDS = 5
IN_FLIGHT = Situation(armed=True, landed_state=LandedState.IN_AIR, height_m=5.0)


def flight(with_others: bool) -> list[tuple[int, list[Sample]]]:
    """Hovering with the noise of a good vehicle; the same every time."""
    rng = random.Random(1)
    steps: list[tuple[int, list[Sample]]] = []
    for number in range(1, SAMPLES + 1):
        t = number * INTERVAL_US
        force = (rng.gauss(0.0, 0.25), rng.gauss(0.0, 0.25), rng.gauss(-9.81, 0.25))
        samples: list[Sample] = [ImuSample(t, force, (rng.gauss(0.0, 0.01), rng.gauss(0.0, 0.01), 0.0))]
        velocity = (rng.gauss(0.0, 0.03), rng.gauss(0.0, 0.03), rng.gauss(0.0, 0.03))
        if with_others and number % 5 == 0:
            samples.append(LocalPosition(t, (0.0, 0.0, -5.0), velocity))
        if with_others and number % 8 == 0:
            samples.append(Odometry(t, (0.0, 0.0, -5.0), velocity, 0))
        if with_others and number % 5 == 1:
            samples.append(Attitude(t, (1.0, 0.0, 0.0, 0.0), (0.0, 0.0, 0.0)))
        if with_others and number % 5 == 2:
            samples.append(AttitudeTarget(t, 0.7))
        steps.append((t, samples))
    return steps


def microseconds(name: str, steps: list[tuple[int, list[Sample]]]) -> float:
    monitor = start_monitor(BaselineConfig(detector=name), 0)
    begun = time.perf_counter()
    for t, samples in steps:
        advance(monitor, samples, IN_FLIGHT, t)
    return 1e6 * (time.perf_counter() - begun) / len(steps)


def main() -> None:
    os.sched_setaffinity(0, {sorted(os.sched_getaffinity(0))[0]})
    alone, together = flight(False), flight(True)
    print("microseconds for each IMU sample: alone, with all other messages")
    for name in sorted(BaselineConfig.detectors):
        figures = [statistics.median(microseconds(name, steps) for _ in range(ROUNDS)) for steps in (alone, together)]
        print(f"{name:10} {figures[0]:6.1f} {figures[1]:6.1f}")


if __name__ == "__main__":
    main()
