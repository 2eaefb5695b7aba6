"""What a healthy flight meets in the air and is no collision: faults of the simulated vehicle, drawn."""

import math
from collections.abc import Callable
from typing import Any

import numpy as np

Faults = list[dict[str, Any]]
# Seconds of the vehicle's clock between which gusts begin, and how many.
FROM_S, UNTIL_S, GUSTS = 20.0, 95.0, 6


def _calm(rng: np.random.Generator) -> Faults:
    return []


def _gusts(rng: np.random.Generator) -> Faults:
    """Up to 8 m/s from any side within a fifth of a second to a second."""
    faults = []
    for start_s in sorted(rng.uniform(FROM_S, UNTIL_S, GUSTS).tolist()):
        side, speed_m_s = rng.uniform(-math.pi, math.pi), rng.uniform(3.0, 8.0)
        velocity = [speed_m_s * math.cos(side), speed_m_s * math.sin(side), rng.uniform(-2.0, 2.0)]
        lasts_s, rise_s = float(rng.uniform(1.0, 5.0)), float(rng.uniform(0.2, 1.0))
        span = [start_s, start_s + max(lasts_s, 2.1 * rise_s)]
        faults.append({"kind": "gust", "between_s": span, "velocity_ned_m_s": velocity, "rise_s": rise_s})
    return faults


def _turbulence(rng: np.random.Generator) -> Faults:
    return [{"kind": "turbulence", "wind_20ft_m_s": float(rng.uniform(4.0, 12.0)), "at_s": 0.0}]


def _vibration(rng: np.random.Generator) -> Faults:
    """From a good vehicle's to a bent propeller's, which reaches the sensor's range again and again.

    From take-off on: a blade that breaks in the air is no healthy flight any more, and its first jolt is a hit's.
    """
    fault = {
        "kind": "vibration",
        "at_s": 0.0,
        "accelerometer_rms_m_s2": float(10.0 ** rng.uniform(0.3, 1.9)),
        "gyroscope_rms_rad_s": float(10.0 ** rng.uniform(-1.5, -0.3)),
        "motor_hz": float(rng.uniform(80.0, 220.0)),
    }
    return [fault | ({"motor": int(rng.integers(4))} if rng.random() < 0.5 else {})]


AIR: dict[str, Callable[[np.random.Generator], Faults]] = {
    "calm": _calm,
    "gusts": _gusts,
    "turbulence": _turbulence,
    "vibration": _vibration,
}
