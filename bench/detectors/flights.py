"""Healthy flights, hard ones: whatever a detector reports in them is false."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from bench.detectors.mishaps import FAMILIES
from bench.detectors.pilot import Pilot, PilotDemand, as_known
from bench.detectors.recording import VehicleRecording
from bench.detectors.vehicles import BenchVehicle, vehicle_of
from bench.detectors.watching import (
    ASKED_HZ,
    SWEPT_FACTORS,
    configuration,
    streams_asked_hz,
    watch_all,
)
from bench.detectors.wire import Wire
from companion.reflex.detector import Situation
from sim_vehicle.airframe import Airframe
from sim_vehicle.plant.plant import Plant
from sim_vehicle.scene import Scene

SWEPT_RATE = 246
# A vehicle this low that was not asked to be is about to hit the ground, which would be a collision.
LOST_BELOW_M = 1.0
NEAR_GROUND = frozenset({"ground", "takeoff", "climb", "descend", "landing", "landed"})
# Between take-off and landing.
AIRBORNE_S = 100.0


@dataclass(frozen=True, slots=True)
class FlightCase:
    """One flight; everything that is not here is drawn from the seed."""

    family: str
    seed: int
    airframe: str
    detectors: tuple[str, ...]
    sweeps: bool = False
    is_drawn: bool = False


@dataclass(slots=True)
class FlownHealthy:
    """A recorded flight and the phase of each interval."""

    recording: VehicleRecording
    phases: list[str]


def work_out_flight(case: FlightCase) -> dict[str, Any]:
    """Fly it, let every detector hear it at every rate, list what they report."""
    vehicle = vehicle_of(case.airframe, case.seed if case.is_drawn else None)
    flown = fly_healthy(case, vehicle.airframe)
    samples = flown.recording.samples
    result: dict[str, Any] = {
        "seconds": 1e-6 * (samples[-1].time_boot_us - samples[0].time_boot_us),
        "clipped": sum(samples[-1].clipping_counts),
        "rates": {},
    }
    wire = Wire(flown.recording)
    for rate in ASKED_HZ:
        result["rates"][str(rate)] = _reports(case, vehicle, flown, wire, rate)
    return result


def _reports(case: FlightCase, vehicle: BenchVehicle, flown: FlownHealthy, wire: Wire, rate: int) -> dict[str, Any]:
    arrived = wire.heard(streams_asked_hz(rate), case.seed + rate)
    situations = flown.recording.situations
    index_at = {step.time_boot_us: step.index for step in arrived}
    detectors: dict[str, Any] = {}
    for name in case.detectors:
        found, touches, blind = watch_all(configuration(name, vehicle.settings), arrived, situations)
        entry: dict[str, Any] = {
            "alarms": [
                _told(f.time_boot_us, flown.phases[index_at[f.time_boot_us]], f.first.impact.kind) for f in found
            ],
            "touches": len(touches),
            "blind": blind,
        }
        if case.sweeps and rate == SWEPT_RATE:
            configs = [configuration(name, vehicle.settings, factor) for factor in SWEPT_FACTORS]
            entry["swept"] = [len(watch_all(config, arrived, situations)[0]) for config in configs]
        detectors[name] = entry
    return detectors


def _told(time_boot_us: int, phase: str, kind: Any) -> Sequence[Any]:
    return [round(1e-6 * time_boot_us, 3), phase, kind.value]


def fly_healthy(case: FlightCase, airframe: Airframe) -> FlownHealthy:
    """From the ground to the ground; a flight that its fault ends is recorded up to there."""
    rng = np.random.default_rng([case.seed, 2])
    mishaps = FAMILIES[case.family](np.random.default_rng([case.seed, 4]))
    scene = Scene.model_validate({"faults": mishaps.faults})
    plant = Plant(airframe, scene, case.seed, keeps_path=False)
    pilot = Pilot(plant, airframe, rng, AIRBORNE_S)
    flown = FlownHealthy(VehicleRecording(), [])
    ground_m = plant.state.body[2]
    for asked in pilot.fly():
        output = plant.step(asked.setpoint, asked.armed)
        flown.recording.add(plant, output, _situation(asked, ground_m - output.position_ned_m[2]), airframe.mass_kg)
        flown.phases.append(asked.phase)
        is_lost = asked.phase not in NEAR_GROUND and ground_m - plant.state.body[2] < LOST_BELOW_M
        if is_lost or (mishaps.ends_s is not None and output.time_boot_us > 1e6 * mishaps.ends_s):
            break
    return flown


def _situation(asked: PilotDemand, height_m: float) -> Situation:
    return Situation(
        off_reason=asked.off_reason,
        armed=asked.armed,
        landed_state=asked.landed_state,
        height_m=height_m,
        descent_commanded=asked.phase in ("landing", "landed"),
        setpoint_position_ned_m=as_known(asked.setpoint, "position_ned_m"),
    )
