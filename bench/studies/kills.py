"""`bench kills`: a companion that is killed at random instants around a hit. By the truth."""

import math
import random
from argparse import Namespace
from collections.abc import Iterator
from dataclasses import dataclass
from typing import Any

import pandas as pd

from bench.cases.vehicles import AIRFRAMES
from bench.cases.walls import into_a_wall
from bench.fly.campaign import Json, Results
from bench.fly.stepped import Stepped
from bench.rows.killed import became, hardest, is_down, killed_copies
from bench.rows.tables import table
from bench.studies.study import Shown, run_study
from companion.companion import Companion
from companion.mission.model import Mission
from rebound_cli.inputs import with_guards
from sim_vehicle.airframe import load_built_in
from sim_vehicle.scene import Scene
from sim_vehicle.truth import Hit
from sim_vehicle.vehicle import SimulatedVehicle

# From before the touch to after it.
KILLED_S = (-0.3, 1.5)
KILLS_A_FLIGHT = 10
# A softer touch than this is what guards are for: the goal counts harder ones alone.
SECOND_M_S = 0.3


def run_kills(options: Namespace) -> int:
    """0 when the table is written, whatever it says; 1 when a flight failed to be flown."""
    flights = cases(options.kills, options.first_seed)
    return run_study(options, "kills", "A companion that is killed around a hit", flights, work_out, shown)


def instants(kills: int, first_seed: int) -> Iterator[tuple[int, random.Random, int]]:
    """Of each flight the number, what draws it from its seed, and how many kills it is for."""
    for number in range(math.ceil(kills / KILLS_A_FLIGHT)):
        yield number, random.Random(first_seed + number), min(KILLS_A_FLIGHT, kills - KILLS_A_FLIGHT * number)


def drawn_instants(draw: random.Random, count: int) -> tuple[float, ...]:
    return tuple(sorted(round(draw.uniform(*KILLED_S), 3) for _ in range(count)))


SPEEDS_M_S = (0.7, 5.0)
IMU_HZ = (250, 50)
MOST_SLANT_DEG = 45.0
HEIGHT_M = 1.5
# The slowest flight takes 15 s to its wall.
REACHED_WITHIN_S = 60.0
# A landing from this height takes 5 s; what is not down by then has another trouble, which is told.
LANDS_WITHIN_S = 12.0
# How long a vehicle that keeps its companion is followed after the last instant: what follows then is the next item's.
WITH_IT_S = 1.5
# A tenth of a second.
BIN_S = 0.1


@dataclass(frozen=True, slots=True)
class Case:
    """A flight, and when after the first touch its companion is killed."""

    airframe: str
    imu_hz: int
    speed_m_s: float
    slant_deg: float
    seed: int
    kills_s: tuple[float, ...]


def cases(kills: int, first_seed: int) -> list[Case]:
    """Airframes and IMU rates in turn; all else as the seed draws it."""
    found = []
    for number, draw, count in instants(kills, first_seed):
        speed_m_s, slant_deg = draw.uniform(*SPEEDS_M_S), draw.uniform(-MOST_SLANT_DEG, MOST_SLANT_DEG)
        how = AIRFRAMES[number % 2], IMU_HZ[number // 2 % 2], round(speed_m_s, 3), round(slant_deg, 1)
        found.append(Case(*how, first_seed + number, drawn_instants(draw, count)))
    return found


def begun(case: Case) -> Stepped:
    """With the case's IMU rate; nobody knows of the wall."""
    data, airframe = into_a_wall("kills", case.speed_m_s, case.slant_deg, HEIGHT_M), load_built_in(case.airframe)
    data["companion"]["streams"] = {"highres_imu_hz": case.imu_hz}
    mission = Mission.model_validate(with_guards(data, airframe))
    scene = Scene.model_validate({**(mission.sim or {}), "airframe": case.airframe, "seed": case.seed})
    companion = Companion(mission)
    companion.confirm_plan()
    return Stepped(SimulatedVehicle(airframe, scene, case.seed), companion)


def work_out(case: Case) -> Json:
    """Every kill of a flight, and what the same flight does when nobody is killed."""
    first = begun(case)
    while not first.vehicle.truth.hits and first.time_s < REACHED_WITHIN_S:
        first.step()
    touch, flight = first.vehicle.truth.hits[0], begun(case)

    def fly_until(since_s: float) -> None:
        until_us = touch.contact_at_boot_us + 1e6 * since_s
        while flight.vehicle.time_boot_us < until_us and not flight.programs[0].finished:
            flight.step()

    kills = killed_copies(case.kills_s, fly_until, lambda: killed(flight, touch))
    fly_until(KILLED_S[1] + WITH_IT_S)
    again_m_s = hardest(flight.vehicle.truth.hits[1:])
    return {"touch_m_s": touch.closing_speed_m_s, "again_m_s": again_m_s, "kills": kills}


def killed(flight: Stepped, touch: Hit) -> Json:
    """The companion dies now, and nobody answers the vehicle any more."""
    vehicle, killed_us = flight.vehicle, flight.vehicle.time_boot_us
    while not is_down(vehicle) and vehicle.time_boot_us < killed_us + 1e6 * LANDS_WITHIN_S:
        flight.step_alone()
    return became(vehicle, 1e-6 * (killed_us - touch.contact_at_boot_us), killed_us)


def shown(results: Results) -> Shown:
    flights = [flight for _, flight in results.found]
    kills = pd.json_normalize(flights, "kills", ["touch_m_s"])
    again = sum(flight["again_m_s"] > SECOND_M_S for flight in flights)
    lead = (
        f"After the kill nothing is sent. Second contact: the centre closes with the wall at over {SECOND_M_S:g} "
        f"m/s after the kill, the hit itself apart. With nobody killed, {again} of {len(flights)} flights do."
    )
    return Shown({"": f"{lead}\n\n{kills_table(kills)}"}, rows=kills)


def kills_table(kills: pd.DataFrame) -> str:
    """By the instant of the kill after the touch."""
    first, last = (round(edge / BIN_S) for edge in KILLED_S)
    spans = {f"{100 * n} to {100 * (n + 1)} ms": (n * BIN_S, (n + 1) * BIN_S) for n in range(first, last)}
    spans |= {"**before the touch**": (-math.inf, 0.0), "**after it**": (0.0, math.inf)}
    some = {name: kills[kills["kill_s"].between(*span, inclusive="left")] for name, span in spans.items()}
    return table([{"killed": name, **cells(of)} for name, of in some.items()])


def cells(kills: pd.DataFrame) -> dict[str, Any]:
    again, ground = kills["again_m_s"][kills["again_m_s"] > SECOND_M_S], kills["ground_m_s"].dropna()
    return {
        "kills": len(kills),
        "second contact": f"{len(again)} ({100 * len(again) / max(len(kills), 1):.1f} %)",
        "hardest [m/s]": f"{again.max():.2f}" if len(again) else "–",
        "came down": len(ground),
        "at the ground, median [m/s]": f"{ground.median():.2f}" if len(ground) else "–",
        "most [m/s]": f"{ground.max():.2f}" if len(ground) else "–",
    }
