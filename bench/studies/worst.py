"""The hits nearest to being missed, and the worst recoveries: by differential evolution over what is met, how, by whom.

A hit's margin is the factor by which all thresholds of the detector could grow until it is missed. It is found by the
detector itself: the same hit is flown with other thresholds, from the same moment.

The worst recoveries are falls, the slower the hit the worse. Then come those that touch again or do not rest, then the
others, the later the rest the worse. Walls that lean over the vehicle are left out: they are known to be unsolved, and
would hide all else.
"""

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import cast

import numpy as np
import pandas as pd
from scipy.optimize import differential_evolution

from bench.cases import vehicles as drawn
from bench.cases.hits import Floats, HitCase
from bench.cases.vehicles import AIRFRAMES, BenchVehicle
from bench.fly.campaign import Campaign, Json, Results
from bench.fly.guarded import (
    APPROACHES,
    FREE_S,
    IMU_HZ,
    LEAD_S,
    LED_PATIENCE_S,
    MOST_RECOVERY_S,
    OVERTURNED_DEG,
    SPEEDS_M_S,
    Approach,
    FlownHit,
    begun,
    followed,
    to_rest,
    velocity_of,
)
from bench.fly.watching import FLOWN_WITH, configuration
from bench.rows.hits import judged
from bench.rows.tables import table
from companion.mission.model import Mission
from rebound_cli.inputs import SimulatedWorld, resolved
from rebound_cli.results.run_folder import RESOLVED_NAME, TRUTH_NAME, FlightRecorder, write_yaml
from rebound_cli.simulation.lockstep import EPOCH_US
from sim_vehicle.airframe import Airframe, with_base
from sim_vehicle.scene import Scene
from sim_vehicle.shell.truth_file import save_truth

# Margins are looked for between these, half of what is left each time: to 2.5 %.
LEAST, MOST, HALVINGS = 1 / 8, 64.0, 8
# Into the surface; slower hits do not count.
NOTICED_M_S = 0.5
# Of nothing touched, or too slowly; greater than any figure that a search makes least.
NO_HIT = 2.0 * MOST
# A fall: ten times what a hit may lose that counts as recovered (bench/notes/decisions.md).
FALL_M = 1.0
# From one class of recoveries to the next: more than a speed and a time to rest together.
BETTER = 15.0
# Members of a generation for each number that is varied: fewer than scipy's 15, for more generations.
MEMBERS = 4

# What is varied of the named airframe, within the ranges of drawn vehicles.
_LOG_VIBRATION = tuple(math.log(value) for value in drawn.VIBRATION_M_S2)
VEHICLE = {
    "vibration_log": _LOG_VIBRATION,
    "gyroscope_noise_rad_s": drawn.GYROSCOPE_NOISE_RAD_S,
    "delay_s": drawn.DELAY_S,
    "velocity_noise_m_s": drawn.VELOCITY_NOISE_M_S,
    "velocity_correlation_s": drawn.VELOCITY_CORRELATION_S,
    "guard_friction": drawn.FRICTION,
    "spring_rad_s": drawn.SPRING_RAD_S,
    "spring_damping": drawn.SPRING_DAMPING,
    "stop_s_share": (0.0, 1.0),
    "restitution_share": (0.0, 1.0),
}
MEETING = {
    "approach": (0, len(APPROACHES) - 1),
    "speed_m_s": SPEEDS_M_S,
    "lead_s": LEAD_S,
    "first_share": (0.0, 1.0),
    "second_share": (0.0, 1.0),
}


@dataclass(frozen=True, slots=True)
class SearchCase:
    """Which hits are searched, and about how many of them are flown."""

    airframe: str
    imu_hz: int
    seed: int
    tries: int
    of: str = "margin"


def worst_campaign(of: str, tries: int, seed: int) -> Campaign:
    cases = [SearchCase(airframe, imu_hz, seed, tries, of) for airframe in AIRFRAMES for imu_hz in IMU_HZ]
    return Campaign("worst-hits", {"of": of, "tries": tries, "seed": seed}, cases, search)


class _Given:
    """Stands for a generator of random numbers: its numbers are chosen."""

    def __init__(self, shares: Sequence[float]) -> None:
        self._shares = list(shares)

    def uniform(self, low: float, high: float) -> float:
        return low + (high - low) * self._shares.pop(0)


def search(case: SearchCase) -> Json:
    """What became of the worst hit, and all that makes it again."""
    figure = FIGURES[case.of]
    bounds = list({**MEETING, **VEHICLE}.values())
    found = differential_evolution(
        lambda values: figure(case, _printed(values))[0],
        bounds,
        popsize=MEMBERS,
        maxiter=max(1, round(case.tries / (MEMBERS * len(bounds))) - 1),
        integrality=[name == "approach" for name in (*MEETING, *VEHICLE)],
        rng=case.seed,
        polish=False,
        tol=0.0,
    )
    numbers = _printed(found.x)
    return {**figure(case, numbers)[1], "flown": int(found.nfev), **numbers}


def _printed(values: Floats) -> dict[str, float]:
    """By name, with the digits that are shown: what is flown again from a page is the same hit."""
    return {name: float(f"{value:.6g}") for name, value in zip((*MEETING, *VEHICLE), values, strict=True)}


def recovery(case: SearchCase, numbers: Mapping[str, float]) -> tuple[float, Json]:
    """How good that of one hit is, and what became of it."""
    approach, scene = begun_with(case, numbers)
    if approach.is_false or any(wall.normal_ned[2] > 0.0 for wall in scene.walls):
        return NO_HIT, {}
    flight = approach.flight
    flight.vehicle.truth.keeps_path = True
    flight.vehicle.meet(scene)
    rest_us = to_rest(flight, LED_PATIENCE_S)
    hit = judged(flight.vehicle, flight.guard.collisions(), rest_us)
    return how_good(hit), hit


def how_good(hit: Json) -> float:
    """What became of it as one figure: the least is the worst."""
    if not hit.get("found") or hit["closing_m_s"] < NOTICED_M_S:
        return NO_HIT
    if hit["tilt_deg"] > OVERTURNED_DEG or hit["lost_m"] > FALL_M:
        return hit["closing_m_s"]  # type: ignore[no-any-return]
    rest_s = MOST_RECOVERY_S if hit["rest_s"] is None else hit["rest_s"]
    is_bad = hit["again"] > 0 or hit["rest_s"] is None
    return (1.0 if is_bad else 2.0) * BETTER - rest_s


def margin(case: SearchCase, numbers: Mapping[str, float]) -> tuple[float, Json]:
    """Of one hit, and its speed into the surface."""
    approach, scene = begun_with(case, numbers)
    if approach.is_false:
        return NO_HIT, {}
    approach.flight.vehicle.meet(scene)
    moment, core = approach.moment(), approach.flight.guard.core
    assert core is not None
    monitor = core.monitor
    low, high, closing_m_s = math.log(LEAST), math.log(MOST), 0.0
    for _ in range(HALVINGS):
        factor = math.exp(0.5 * (low + high))
        config = configuration(FLOWN_WITH[0], approach.built.settings, factor)
        averaging_us = round(config.estimate.imu_averaging_interval_s * 1e6)
        monitor.detector = config.detectors[config.detector](getattr(config, config.detector), averaging_us)
        monitor.state.threshold_m_s2 *= factor
        verdict = followed(approach.flight, LED_PATIENCE_S)
        moment.rewind()
        if verdict.is_early:
            low = math.log(factor)
            continue
        closing_m_s = verdict.closing_m_s
        if verdict.touched_us is None or closing_m_s < NOTICED_M_S:
            return NO_HIT, {"closing_m_s": closing_m_s}
        if verdict.late_us is None:
            high = math.log(factor)
        else:
            low = math.log(factor)
    found = math.exp(0.5 * (low + high))
    return found, {"margin": round(found, 3), "closing_m_s": round(closing_m_s, 3)}


FIGURES: Mapping[str, Callable[[SearchCase, Mapping[str, float]], tuple[float, Json]]] = {
    "margin": margin,
    "recovery": recovery,
}


def begun_with(case: SearchCase, numbers: Mapping[str, float]) -> tuple[Approach, Scene]:
    """The approach up to the moment from which the hit is flown, and what then stands before the vehicle."""
    met = APPROACHES[round(numbers["approach"])]
    hit = HitCase("worst", case.seed, case.airframe, met, numbers["speed_m_s"], ())
    approach = Approach(FlownHit(hit, case.imu_hz), vehicle_with(case.airframe, numbers))
    approach.fly_until(FREE_S)
    rng = cast(np.random.Generator, _Given([numbers["first_share"], numbers["second_share"]]))
    return approach, approach.scene(met, numbers["lead_s"], rng)


def vehicle_with(kind: str, numbers: Mapping[str, float]) -> BenchVehicle:
    """The named airframe with other numbers, and its owner's settings."""
    rad_s = numbers["spring_rad_s"]
    springs = {"stiffness_per_s2": rad_s**2, "damping_per_s": 2.0 * numbers["spring_damping"] * rad_s}
    stop = {
        "contact_time_s": _between(drawn.STOP_TIME_S[kind], numbers["stop_s_share"]),
        "restitution": _between(drawn.RESTITUTION[kind], numbers["restitution_share"]),
    }
    data = {
        "based_on": kind,
        "imu": {
            "accelerometer_noise_m_s2": math.exp(numbers["vibration_log"]),
            "gyroscope_noise_rad_s": numbers["gyroscope_noise_rad_s"],
        },
        "estimate": {name: numbers[name] for name in ("delay_s", "velocity_noise_m_s", "velocity_correlation_s")},
        "surface": {"guard_friction": numbers["guard_friction"]},
        "arms": {**(springs if kind == "foldable" else {}), "stop": stop},
    }
    return BenchVehicle(Airframe.model_validate(with_base(data)), drawn.companion_settings(data))


def _between(ends: tuple[float, float], share: float) -> float:
    return ends[0] + (ends[1] - ends[0]) * share


def worst_table(campaign: Campaign, results: Results) -> str:
    """The worst hit of each search, with all that makes it again."""
    columns = {
        f"{campaign.cases[at].airframe}, {campaign.cases[at].imu_hz} Hz": {
            key: APPROACHES[round(value)] if key == "approach" else value for key, value in one.items()
        }
        for at, one in results.results.items()
    }
    return table(pd.DataFrame(columns).rename_axis("").reset_index())


def keep(case: SearchCase, numbers: Mapping[str, float], folder: Path) -> None:
    """The hit and its recovery as bytes and truth, for `bench corpus judge`. The obstacle is there from the first."""
    approach, scene = begun_with(case, numbers)
    flight = begun(approach.built, approach.case, velocity_of(approach.case.hit), scene, keeps_path=True)
    folder.mkdir(parents=True, exist_ok=True)
    recorder = FlightRecorder(folder)
    try:
        while flight.vehicle.time_boot_us < 1e6 * (FREE_S + LED_PATIENCE_S + MOST_RECOVERY_S):
            result = flight.step()
            recorder.record(EPOCH_US + flight.vehicle.time_boot_us, result)
    finally:
        recorder.close()
    flight.vehicle.note_hit()
    # A replay reads a mission file; of this one only what the vehicle's owner knows counts.
    items = [{"takeoff": {"height_m": 2.0}}, {"land": {}}]
    mission = Mission.model_validate({"name": "hit", "items": items, "companion": approach.built.settings})
    write_yaml(folder / RESOLVED_NAME, resolved(mission, SimulatedWorld(scene, approach.built.airframe)))
    save_truth(folder / TRUTH_NAME, flight.vehicle.truth, EPOCH_US)
