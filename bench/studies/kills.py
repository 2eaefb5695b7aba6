"""`bench kills`: a companion that is killed at random instants around a hit. By the truth."""

import math
import random
from argparse import Namespace
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import pandas as pd

from bench.cases.vehicles import AIRFRAMES
from bench.cases.walls import into_a_wall
from bench.fly.campaign import Campaign, Json, Workers, run_campaign
from bench.fly.copies import Copies
from bench.fly.lockstep import STANDS_M
from bench.fly.stepped import Stepped
from bench.rows.tables import Page, table
from companion.companion import Companion
from companion.mission.model import Mission
from rebound_cli.inputs import with_guards
from sim_vehicle.airframe import load_built_in
from sim_vehicle.scene import Scene
from sim_vehicle.truth import Hit
from sim_vehicle.vehicle import SimulatedVehicle

SPEEDS_M_S = (0.7, 5.0)
# From before the touch to after it.
KILLED_S = (-0.3, 1.5)
KILLS_A_FLIGHT = 10
IMU_HZ = (250, 50)
MOST_SLANT_DEG = 45.0
HEIGHT_M = 1.5
# The slowest flight takes 15 s to its wall.
REACHED_WITHIN_S = 60.0
# A landing from this height takes 5 s; what is not down by then has another trouble, which is told.
WATCHED_S = 12.0
# How long a vehicle that keeps its companion is followed after the last instant: what follows then is the next item's.
WITH_IT_S = 1.5
BIN_S = 0.1
# A softer touch than this is what guards are for: the goal counts harder ones alone.
SECOND_M_S = 0.3


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
    found: list[Case] = []
    for number in range(math.ceil(kills / KILLS_A_FLIGHT)):
        seed = first_seed + number
        draw = random.Random(seed)
        speed_m_s, slant_deg = draw.uniform(*SPEEDS_M_S), draw.uniform(-MOST_SLANT_DEG, MOST_SLANT_DEG)
        count = min(KILLS_A_FLIGHT, kills - KILLS_A_FLIGHT * number)
        instants_s = tuple(round(draw.uniform(*KILLED_S), 3) for _ in range(count))
        airframe, imu_hz = AIRFRAMES[number % 2], IMU_HZ[number // 2 % 2]
        found.append(Case(airframe, imu_hz, round(speed_m_s, 3), round(slant_deg, 1), seed, instants_s))
    return found


def mission_data(case: Case) -> dict[str, Any]:
    """With the case's IMU rate; nobody knows of the wall."""
    data = into_a_wall("kills", case.speed_m_s, case.slant_deg, HEIGHT_M)
    data["companion"]["streams"] = {"highres_imu_hz": case.imu_hz}
    return data


def begun(case: Case) -> Stepped:
    airframe = load_built_in(case.airframe)
    mission = Mission.model_validate(with_guards(mission_data(case), airframe))
    scene = Scene.model_validate({**(mission.sim or {}), "airframe": case.airframe, "seed": case.seed})
    companion = Companion(mission)
    companion.confirm_plan()
    return Stepped(SimulatedVehicle(airframe, scene, case.seed), companion)


def work_out(case: Case) -> Json:
    """Every kill of a flight, and what the same flight does when nobody is killed."""
    first = begun(case)
    while not first.vehicle.truth.hits and first.time_s < REACHED_WITHIN_S:
        first.step()
    touch = first.vehicle.truth.hits[0]
    flight, copies = begun(case), Copies()
    for kill_s in sorted(case.kills_s):
        _fly_until(flight, touch.contact_at_boot_us + kill_s * 1e6)
        if copies.fork(str(kill_s)):
            copies.leave(lambda: _killed(flight, touch))
    _fly_until(flight, touch.contact_at_boot_us + 1e6 * (KILLED_S[1] + WITH_IT_S))
    again_m_s = _hardest(flight.vehicle.truth.hits[1:])
    return {"touch_m_s": touch.closing_speed_m_s, "again_m_s": again_m_s, "kills": [*copies.found.values()]}


def _fly_until(flight: Stepped, boot_us: float) -> None:
    while flight.vehicle.time_boot_us < boot_us and not flight.programs[0].finished:
        flight.step()


def _killed(flight: Stepped, touch: Hit) -> Json:
    vehicle, killed_at_us = flight.vehicle, flight.vehicle.time_boot_us
    since_s = 1e-6 * (killed_at_us - touch.contact_at_boot_us)
    # Both airframes stand as high.
    down_m, is_down = -load_built_in(AIRFRAMES[0]).geometry.foot_depth_m - STANDS_M, False
    while not is_down and vehicle.time_boot_us < killed_at_us + 1e6 * WATCHED_S:
        flight.step_alone()
        is_down = float(vehicle.state.body[2]) > down_m
    # The touch itself is no second one, whenever it came.
    later = [hit for hit in vehicle.truth.hits if hit.contact_at_boot_us >= killed_at_us][1 if since_s < 0.0 else 0 :]
    ground_m_s = math.hypot(*vehicle.truth.series()["velocity_ned_m_s"][-1]) if is_down else None
    return {"kill_s": since_s, "again_m_s": _hardest(later), "ground_m_s": ground_m_s}


def _hardest(hits: Sequence[Hit]) -> float:
    """0 where there is none."""
    return max((hit.closing_speed_m_s for hit in hits), default=0.0)


def run_kills(options: Namespace) -> int:
    """0 when the table is written, whatever it says; 1 when a flight failed to be flown."""
    page, parameters = Page(options.out, "kills"), {"kills": options.kills, "first_seed": options.first_seed}
    campaign = Campaign("kills", parameters, cases(**parameters), work_out)
    results = run_campaign(campaign, Workers(options.jobs, options.scheduler))
    flights = list(results.results.values())
    kills = pd.json_normalize(flights, "kills", ["touch_m_s"])
    parts = {"": f"{_lead(flights)}\n\n{kills_table(kills)}", "Not flown": results.text(campaign) or "None.\n"}
    page.write("A companion that is killed around a hit", options.typed, parts, rows=kills)
    return 1 if results.failures else 0


def _lead(flights: Sequence[Json]) -> str:
    again = sum(flight["again_m_s"] > SECOND_M_S for flight in flights)
    return (
        f"After the kill nothing is sent. Second contact: the centre closes with the wall at over {SECOND_M_S:g} "
        f"m/s after the kill, the hit itself apart. With nobody killed, {again} of {len(flights)} flights do."
    )


def kills_table(kills: pd.DataFrame) -> str:
    """By the instant of the kill after the touch."""
    first, last = (round(edge / BIN_S) for edge in KILLED_S)
    edges = [
        (f"{1e3 * n * BIN_S:.0f} to {1e3 * (n + 1) * BIN_S:.0f} ms", n * BIN_S, (n + 1) * BIN_S)
        for n in range(first, last)
    ]
    edges += [("**before the touch**", -math.inf, 0.0), ("**after it**", 0.0, math.inf)]
    since_s = kills["kill_s"]
    return table([{"killed": name, **_cells(kills[(low <= since_s) & (since_s < high)])} for name, low, high in edges])


def _cells(kills: pd.DataFrame) -> dict[str, Any]:
    again, ground = kills["again_m_s"][kills["again_m_s"] > SECOND_M_S], kills["ground_m_s"].dropna()
    return {
        "kills": len(kills),
        "second contact": f"{len(again)} ({100 * len(again) / max(len(kills), 1):.1f} %)",
        "hardest [m/s]": f"{again.max():.2f}" if len(again) else "–",
        "at the ground, median [m/s]": f"{ground.median():.2f}" if len(ground) else "–",
        "most [m/s]": f"{ground.max():.2f}" if len(ground) else "–",
    }
