"""One hit: a mission that flies into a wall, and what the simulator knows of the recovery."""

import math
import tempfile
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from bench.campaign.plan import Campaign, Json
from companion.mission.model import Mission
from rebound_cli.inputs import SimulatedWorld, with_guards
from rebound_cli.live.interrupts import Interrupts
from rebound_cli.results.run_folder import FlightRecorder
from rebound_cli.results.summary import LONGEST_RECOVERY_S, Flown
from rebound_cli.results.truth_match import FlightTruth, match_contacts
from rebound_cli.simulation.lockstep import fly_mission_lockstep
from sim_vehicle.airframe import load_built_in
from sim_vehicle.scene import Scene

LAWS = ("paper", "adaptive")
AIRFRAMES = ("foldable", "rigid")
SPEEDS_M_S = (1.0, 2.0, 3.0, 4.0, 5.0)
SLANTS_DEG = (0, 30)
HEIGHT_M = 2.5
RUN_UP_M_S2 = 3.0
# After speeding up, the vehicle flies steadily for this long before the wall.
STEADY_S = 1.0
# A vehicle that leaves a wall does not come nearer again; its estimate has nothing to do with this.
CAME_BACK_M = 0.02
# How long the vehicle is watched at its recovery setpoint.
HOLD_S = 2.0


@dataclass(frozen=True, slots=True)
class RecoveryCase:
    """A hit at a speed on a wall that stands square to the way or slanted."""

    law: str
    airframe: str
    slant_deg: int
    speed_m_s: float
    seed: int


def cases(seeds: int) -> list[RecoveryCase]:
    return [
        RecoveryCase(law, airframe, slant, speed, seed)
        for airframe in AIRFRAMES
        for slant in SLANTS_DEG
        for speed in SPEEDS_M_S
        for seed in range(1, seeds + 1)
        for law in LAWS
    ]


def recoveries_campaign(seeds: int) -> Campaign:
    return Campaign("recoveries", {"seeds": seeds}, cases(seeds), work_out)


def mission_data(case: RecoveryCase) -> dict[str, Any]:
    """The mission: up, into the wall, hold, down."""
    data = into_a_wall("recovery", case.speed_m_s, case.slant_deg, HEIGHT_M)
    return data | {"on_collision": {"then": "hold", "hold_s": HOLD_S}, "recovery": {"law": case.law}}


def into_a_wall(name: str, speed_m_s: float, slant_deg: float, height_m: float) -> dict[str, Any]:
    """Up, and at the speed into a wall; the target is so far behind it that braking has not begun there."""
    wall_m = round(0.5 * speed_m_s**2 / RUN_UP_M_S2 + STEADY_S * speed_m_s + 1.0, 3)
    beyond_m = wall_m + speed_m_s**2 / RUN_UP_M_S2 + 2.0
    slant = math.radians(slant_deg)
    go_to = {"position_ned_m": [beyond_m, 0, -height_m], "speed_m_s": speed_m_s, "acceleration_m_s2": RUN_UP_M_S2}
    wall = {
        "point_ned_m": [wall_m, 0, -4],
        "normal_ned": [-math.cos(slant), -math.sin(slant), 0],
        "width_m": 40,
        "height_m": 8,
    }
    return {
        "name": name,
        "items": [{"takeoff": {"height_m": height_m}}, {"go_to": go_to}, {"land": {}}],
        "companion": {"flight": {"speeding_up_m_s2": RUN_UP_M_S2}},
        "fence": {"radius_m": 40, "max_height_m": 8},
        "sim": {"walls": [wall]},
    }


def work_out(case: RecoveryCase) -> Json:
    """Fly it in lockstep; what happened after the first hit, by the simulator's truth. SI units."""
    airframe = load_built_in(case.airframe)
    mission = Mission.model_validate(with_guards(mission_data(case), airframe))
    scene = Scene.model_validate({**(mission.sim or {}), "airframe": case.airframe, "seed": case.seed})
    with tempfile.TemporaryDirectory() as name:
        recorder = FlightRecorder(Path(name))
        try:
            world = SimulatedWorld(scene, airframe)
            flown, _ = fly_mission_lockstep(mission, world, recorder, Interrupts())
        finally:
            recorder.close()
    assert flown.truth is not None, "a lockstep flight has its truth"
    matches = match_contacts(flown.report.collisions, flown.truth.hits, mission.companion.settled.duration_s)
    figures = _figures(flown, flown.truth, mission) if flown.report.collisions and flown.truth.hits else {}
    return {"outcome": flown.report.outcome, "recontacts": matches.recontacts, **figures}


def _figures(flown: Flown, truth: FlightTruth, mission: Mission) -> Json:
    hit, last = truth.hits[0], flown.report.collisions[-1]
    normal, touched = np.array(hit.normal_ned), np.array(hit.contact_position_ned_m)
    settled_s = last.settled_after_s
    if settled_s is not None:
        settled_s += 1e-6 * (last.sample_time_boot_us - hit.contact_at_boot_us)
    since_s = 1e-6 * (truth.series["time_boot_us"] - hit.contact_at_boot_us)
    until_s = (settled_s or LONGEST_RECOVERY_S) + mission.companion.settled.duration_s
    during = (since_s >= 0.0) & (since_s <= until_s)
    resting = (since_s >= until_s) & (since_s <= until_s + HOLD_S)
    path = truth.series["position_ned_m"]
    below_m = path[during, 2] - touched[2]
    past_m = (path[during] - np.array(last.recovery_setpoint_ned_m)) @ normal
    return {
        "returned": returns(truth, normal, until_s),
        "settled_s": settled_s,
        "past_m": max(0.0, float(past_m.max())),
        "clear_m": float(((path[resting] - touched) @ normal).min()) if resting.any() else None,
        "lost_m": max(0.0, float(below_m.max())),
        "risen_m": max(0.0, float(-below_m.min())),
    }


def returns(truth: FlightTruth, normal: np.ndarray, until_s: float) -> int:
    """Touches in the recovery to which the centre had come back; the others are another guard swinging in."""
    hit, time_us = truth.hits[0], truth.series["time_boot_us"]
    off_m = truth.series["position_ned_m"] @ normal
    returned = 0
    for touch in truth.hits[1:]:
        if touch.contact_at_boot_us > hit.contact_at_boot_us + 1e6 * until_s:
            break
        between = off_m[(time_us >= hit.ended_at_boot_us) & (time_us <= touch.contact_at_boot_us)]
        returned += len(between) > 0 and float(between.max() - between[-1]) > CAME_BACK_M
    return returned


def of(all_cases: Sequence[RecoveryCase], results: dict[int, Json], **wanted: object) -> list[Json]:
    """The results of the cases with these fields."""
    return [
        results[number]
        for number, case in enumerate(all_cases)
        if number in results and all(getattr(case, name) == value for name, value in wanted.items())
    ]
