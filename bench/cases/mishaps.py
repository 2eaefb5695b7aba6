"""What befalls a flight and is no collision: faults of the simulated vehicle, drawn for a family of flights."""

import math
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np

Fault = dict[str, Any]
# Seconds of the vehicle's clock between which a flight is up in the air whatever its manoeuvres.
UP_FROM_S, UP_UNTIL_S = 20.0, 95.0
# A vehicle that has lost a motor is looked at for as long as it surely has not reached the ground.
LOST_FOR_S = 1.0
RESETS = 4
GUSTS = 6
# Between take-off and landing.
AIRBORNE_S = 100.0


@dataclass(frozen=True, slots=True)
class Mishaps:
    """Faults as a scene has them; `ends_s` is when the recording stops before its time."""

    faults: tuple[Fault, ...] = ()
    ends_s: float | None = None


def _calm(rng: np.random.Generator) -> Mishaps:
    return Mishaps()


def _gusts(rng: np.random.Generator) -> Mishaps:
    """Up to 8 m/s from any side within a fifth of a second to a second."""
    faults = []
    for start_s in _moments(rng, GUSTS):
        side, speed_m_s = rng.uniform(-math.pi, math.pi), rng.uniform(3.0, 8.0)
        velocity = [speed_m_s * math.cos(side), speed_m_s * math.sin(side), rng.uniform(-2.0, 2.0)]
        lasts_s, rise_s = float(rng.uniform(1.0, 5.0)), float(rng.uniform(0.2, 1.0))
        span = [start_s, start_s + max(lasts_s, 2.1 * rise_s)]
        faults.append({"kind": "gust", "between_s": span, "velocity_ned_m_s": velocity, "rise_s": rise_s})
    return Mishaps(tuple(faults))


def _turbulence(rng: np.random.Generator) -> Mishaps:
    return Mishaps(({"kind": "turbulence", "wind_20ft_m_s": float(rng.uniform(4.0, 12.0)), "at_s": 0.0},))


def _vibration(rng: np.random.Generator) -> Mishaps:
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
    if rng.random() < 0.5:
        fault["motor"] = int(rng.integers(4))
    return Mishaps((fault,))


def _payload(rng: np.random.Generator) -> Mishaps:
    (at_s,) = _moments(rng, 1)
    return Mishaps(({"kind": "payload_drop", "at_s": at_s, "mass_kg": float(rng.uniform(0.03, 0.15))},))


def _sag(rng: np.random.Generator) -> Mishaps:
    (at_s,) = _moments(rng, 1)
    # Thrust goes with the voltage's square; both airframes hover at 78 % of it.
    share = float(rng.uniform(0.92, 0.98))
    return Mishaps(({"kind": "battery_sag", "between_s": [at_s, at_s + 30.0], "voltage_share": share},))


def _resets(rng: np.random.Generator) -> Mishaps:
    """The estimator lets its position, its velocity or both jump."""
    faults: list[Fault] = []
    for at_s in _moments(rng, RESETS):
        jump, hop = rng.uniform(-2.0, 2.0, 3), rng.uniform(-0.7, 0.7, 3)
        faults.append(
            {
                "kind": "estimator_reset",
                "at_s": at_s,
                "position_jump_ned_m": jump.tolist(),
                "velocity_jump_ned_m_s": (hop if rng.random() < 0.5 else 0.0 * hop).tolist(),
                "settles_s": float(rng.uniform(0.5, 3.0)),
            }
        )
    return Mishaps(tuple(faults))


def _motor(rng: np.random.Generator) -> Mishaps:
    """The last second of a flight."""
    (at_s,) = _moments(rng, 1)
    share = float(rng.choice([0.0, 0.0, rng.uniform(0.2, 0.8)]))
    fault = {"kind": "motor_failure", "motor": int(rng.integers(4)), "thrust_share": share, "at_s": at_s}
    return Mishaps((fault,), at_s + LOST_FOR_S)


def _fall(rng: np.random.Generator) -> Mishaps:
    """All motors silent for a moment."""
    (at_s,) = _moments(rng, 1)
    return Mishaps(({"kind": "free_fall", "between_s": [at_s, at_s + float(rng.uniform(0.1, 0.6))]},))


def _moments(rng: np.random.Generator, count: int) -> list[float]:
    """In order."""
    return sorted(float(value) for value in rng.uniform(UP_FROM_S, UP_UNTIL_S, count))


@dataclass(frozen=True, slots=True)
class FlightCase:
    """One flight; everything that is not here is drawn from the seed."""

    family: str
    seed: int
    airframe: str
    detectors: tuple[str, ...]
    is_drawn: bool = False


# Every family as often as it is named.
FAMILIES: dict[str, Callable[[np.random.Generator], Mishaps]] = {
    "calm": _calm,
    "gusts": _gusts,
    "vibration": _vibration,
    "turbulence": _turbulence,
    "payload drop": _payload,
    "battery sag": _sag,
    "estimator resets": _resets,
    "free fall": _fall,
    "motor failure": _motor,
}
