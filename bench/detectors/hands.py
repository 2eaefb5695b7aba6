"""A hovering vehicle and a person's hand: held where it is, or pushed aside. Nothing to recover from."""

import math
from dataclasses import dataclass
from typing import Any

import numpy as np

from bench.detectors.hits import HEIGHT_M, SWITCHED_ON_AFTER_S
from bench.detectors.recording import VehicleRecording
from bench.detectors.vehicles import AIRFRAMES, vehicle_of
from bench.detectors.watching import ASKED_HZ, configuration, streams_asked_hz, watch_all
from bench.detectors.wire import Wire
from companion.messages import LandedState
from companion.reflex.detector import Situation
from sim_vehicle.airframe import Airframe
from sim_vehicle.cruise import Cruise
from sim_vehicle.scene import Scene

GRIPS = ("held", "pushed")
# A vehicle that holds its position wanders: half of what still counts as a hover, or its noise alone would end it.
DRIFT_MAX_M_S = 0.1
FROM_S, LASTS_S, LOOKED_AFTER_S = (1.5, 1.9), (0.4, 1.5), 0.5
# Of an arm that holds still (Mussa-Ivaldi, Hogan and Bizzi, 1985), about critically damped for half a kilogram.
STIFFNESS_N_M, DAMPING_N_S_M = (100.0, 400.0), (10.0, 30.0)
# Per unit mass: a push that a vehicle's position control still holds against, risen as fast as an arm moves.
PUSH_M_S2, RISE_S = (2.0, 6.0), (0.08, 0.2)


@dataclass(frozen=True, slots=True)
class HandCase:
    """One grip; everything that is not here is drawn from the seed."""

    grip: str
    seed: int
    airframe: str
    detectors: tuple[str, ...]
    is_drawn: bool = False


def draw_hand(seed: int, detectors: tuple[str, ...]) -> HandCase:
    """Airframes and grips in turn."""
    return HandCase(GRIPS[seed // 2 % len(GRIPS)], seed, AIRFRAMES[seed % 2], detectors)


def work_out_hand(case: HandCase) -> dict[str, Any]:
    """Hold it once, then let every detector hear it at every rate."""
    vehicle = vehicle_of(case.airframe, case.seed if case.is_drawn else None)
    recording, began_us = hover_in_hand(case, vehicle.airframe)
    wire = Wire(recording)
    result: dict[str, Any] = {"rates": {}}
    for rate in ASKED_HZ:
        arrived = wire.heard(streams_asked_hz(rate), case.seed + rate)
        entries: dict[str, Any] = {}
        for name in case.detectors:
            found, touches, _ = watch_all(configuration(name, vehicle.settings), arrived, recording.situations)
            told_us = [t.impact.sample_time_boot_us for t in touches if t.impact.sample_time_boot_us >= began_us]
            entries[name] = {
                "collisions": [f.final.impact.kind.value for f in found],
                "told_after_ms": 1e-3 * (told_us[0] - began_us) if told_us else None,
            }
        result["rates"][str(rate)] = {"detectors": entries}
    return result


def hover_in_hand(case: HandCase, airframe: Airframe) -> tuple[VehicleRecording, float]:
    """Until some time after the hand has let go; and when it came, by the vehicle's clock in microseconds."""
    rng = np.random.default_rng([case.seed, 5])
    heading, drift_m_s = rng.uniform(-math.pi, math.pi), rng.uniform(0.0, DRIFT_MAX_M_S)
    velocity = (drift_m_s * math.cos(heading), drift_m_s * math.sin(heading), 0.0)
    from_s = float(rng.uniform(*FROM_S))
    until_s = from_s + float(rng.uniform(*LASTS_S))
    grip = _held(rng) if case.grip == "held" else _pushed(rng, airframe)
    scene = Scene.model_validate({"faults": [{**grip, "between_s": [from_s, until_s]}]})
    yaw_rad = float(rng.uniform(-math.pi, math.pi))
    cruise = Cruise(airframe, scene, (0.0, 0.0, -HEIGHT_M), velocity, yaw_rad, case.seed)
    recording = VehicleRecording()
    while cruise.time_boot_us < 1e6 * (until_s + LOOKED_AFTER_S):
        setpoint = cruise.setpoint()
        output = cruise.step(setpoint)
        situation = Situation(
            off_reason="takeoff" if output.time_boot_us < 1e6 * SWITCHED_ON_AFTER_S else None,
            armed=True,
            landed_state=LandedState.IN_AIR,
            height_m=-output.position_ned_m[2],
        )
        recording.add(cruise.plant, output, situation, airframe.mass_kg)
    return recording, 1e6 * from_s


def _held(rng: np.random.Generator) -> dict[str, Any]:
    return {
        "kind": "hand_catch",
        "stiffness_n_m": float(rng.uniform(*STIFFNESS_N_M)),
        "damping_n_s_m": float(rng.uniform(*DAMPING_N_S_M)),
    }


def _pushed(rng: np.random.Generator, airframe: Airframe) -> dict[str, Any]:
    """Level, from any side, at the middle."""
    side, force_n = rng.uniform(-math.pi, math.pi), airframe.mass_kg * rng.uniform(*PUSH_M_S2)
    return {
        "kind": "push",
        "force_ned_n": [force_n * math.cos(side), force_n * math.sin(side), 0.0],
        "rise_s": float(rng.uniform(*RISE_S)),
    }
