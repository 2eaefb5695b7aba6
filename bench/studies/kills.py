"""`bench kills`: a companion, or with --guard a guard that is the link, killed at random instants around a hit."""

import math
import random
from argparse import Namespace
from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass
from typing import Any

import pandas as pd

from bench.cases.vehicles import AIRFRAMES
from bench.cases.walls import into_a_wall
from bench.fly.campaign import Json, Results
from bench.fly.commanded import BetweenFlight, by_places, by_sticks, fly_a_mission
from bench.fly.copies import in_a_copy
from bench.fly.lockstep import STANDS_M, Stepped
from bench.fly.virtual_time import INTERVAL_US
from bench.rows.tables import table
from bench.studies.study import Shown, run_study
from companion.companion import Companion
from companion.mission.model import Mission
from rebound_cli.inputs.inputs import with_guards
from sim_vehicle.airframe import load_built_in
from sim_vehicle.scene import Scene
from sim_vehicle.truth import Hit
from sim_vehicle.vehicle import SimulatedVehicle

# From before the touch to after it.
KILLED_S = (-0.3, 1.5)
KILLS_A_FLIGHT = 10
# A softer touch than this is what guards are for: the goal counts harder ones alone.
SECOND_M_S = 0.3
SPEEDS_M_S, MOST_SLANT_DEG, HEIGHT_M = (0.7, 5.0), 45.0, 1.5
IMU_HZ = (250, 50)
# The slowest flight takes 15 s to its wall.
REACHED_WITHIN_S = 60.0
# A landing from this height takes 5 s; what is not down by then has another trouble, which is told.
LANDS_WITHIN_S = 12.0
# How long a vehicle that keeps its companion is followed after the last instant: what follows then is the next item's.
WITH_IT_S = 1.5
# Of the table, seconds after the touch; within the first tenth the answer has just begun.
SPANS_S = {"before the touch": (-math.inf, 0.0), "after it": (0.0, math.inf), "within 0.1 s of it": (0.0, 0.1)}
# Both airframes stand as high.
DOWN_M = -load_built_in(AIRFRAMES[0]).geometry.foot_depth_m - STANDS_M
# Who flies where the guard is the link; and PX4's default for its patience, and what preflight asks for.
PROGRAMS: dict[str, Callable[[BetweenFlight], None]] = {
    "places in OFFBOARD": by_places,
    "AUTO mission": fly_a_mission,
    "sticks in POSCTL": by_sticks,
}
LOSS_S = (1.0, 0.3)
# The service begins another guard within this time (companion.service: RestartSec). After the next the new guard has
# met the vehicle, and PX4's failsafe shows.
RESTARTED_S, MET_S = 1.0, 1.0
# PX4's failsafe without sticks comes down from a take-off's height in 4 s; one that holds is watched for twice as long.
WATCHED_S = 8.0
Flight = Stepped | BetweenFlight


@dataclass(frozen=True, slots=True)
class Case:
    """A flight, and when after the first touch its companion is killed; with a program's name the guard between."""

    seed: int
    kills_s: tuple[float, ...]
    airframe: str = "foldable"
    imu_hz: int = 250
    speed_m_s: float = 0.0
    slant_deg: float = 0.0
    program: str = ""
    loss_s: float = LOSS_S[1]


def run_kills(options: Namespace) -> int:
    """0 when the table is written, whatever it says; 1 when a flight failed to be flown."""
    name, who = ("kills-guard", "guard in between") if options.guard else ("kills", "companion")
    flights = cases(options.kills, options.first_seed, options.guard)
    return run_study(options, name, f"A {who} that is killed around a hit", flights, work_out, shown)


def cases(kills: int, first_seed: int, of_guard: bool = False) -> list[Case]:
    """Airframes and IMU rates, or programs and time-outs, in turn; all else as the seed draws it."""
    found = []
    for number in range(math.ceil(kills / KILLS_A_FLIGHT)):
        draw, how = random.Random(first_seed + number), dict[str, Any]()
        if of_guard:
            how = {"program": list(PROGRAMS)[number % 3], "loss_s": LOSS_S[number // 3 % 2]}
        else:
            speed_m_s, slant_deg = draw.uniform(*SPEEDS_M_S), draw.uniform(-MOST_SLANT_DEG, MOST_SLANT_DEG)
            how = {"airframe": AIRFRAMES[number % 2], "imu_hz": IMU_HZ[number // 2 % 2]}
            how |= {"speed_m_s": round(speed_m_s, 3), "slant_deg": round(slant_deg, 1)}
            how["loss_s"] = LOSS_S[number // 4 % 2]
        count = min(KILLS_A_FLIGHT, kills - KILLS_A_FLIGHT * number)
        instants_s = sorted(round(draw.uniform(*KILLED_S), 3) for _ in range(count))
        found.append(Case(first_seed + number, tuple(instants_s), **how))
    return found


def begun(case: Case) -> Flight:
    """Nobody knows of the wall; where somebody else flies, on the way to it."""
    if case.program:
        air = BetweenFlight(None, {"COM_OF_LOSS_T": case.loss_s}, seed=case.seed)
        air.take_off()
        PROGRAMS[case.program](air)
        return air
    data, airframe = into_a_wall("kills", case.speed_m_s, case.slant_deg, HEIGHT_M), load_built_in(case.airframe)
    data["companion"]["streams"] = {"highres_imu_hz": case.imu_hz}
    mission = Mission.model_validate(with_guards(data, airframe))
    scene = Scene.model_validate({**(mission.sim or {}), "airframe": case.airframe, "seed": case.seed})
    companion = Companion(mission)
    companion.confirm_plan()
    vehicle = SimulatedVehicle(airframe, scene, case.seed, parameters={"COM_OF_LOSS_T": case.loss_s})
    return Stepped(vehicle, companion)


def work_out(case: Case) -> Json:
    """Every kill of a flight, and what the same flight does when nobody is killed."""
    first = begun(case)
    first.run_until(lambda: bool(first.vehicle.truth.hits), REACHED_WITHIN_S)
    touch, flight = first.vehicle.truth.hits[0], begun(case)
    kills = []
    for kill_s in case.kills_s:
        fly_on(flight, touch, kill_s)
        kills.append(in_a_copy(lambda: killed(flight, touch)))
    fly_on(flight, touch, KILLED_S[1] + WITH_IT_S)
    again_m_s = hardest(flight.vehicle.truth.hits[1:])
    return {"touch_m_s": touch.closing_speed_m_s, "again_m_s": again_m_s, "kills": kills}


def fly_on(flight: Flight, touch: Hit, since_s: float) -> None:
    """Until so long after the touch, by whole intervals: the next, of a guard the nearest; or until it is over."""
    until_us = touch.contact_at_boot_us + 1e6 * since_s
    if isinstance(flight, BetweenFlight):
        until_us -= INTERVAL_US / 2
    while flight.vehicle.time_boot_us < until_us and not (isinstance(flight, Stepped) and flight.programs[0].finished):
        flight.step()


def killed(flight: Flight, touch: Hit) -> Json:
    """It dies now. A guard's link dies with it, and another one begins."""
    vehicle, killed_us, mode = flight.vehicle, flight.vehicle.time_boot_us, ""
    step: Callable[[], object] = flight.step
    until_us = killed_us + 1e6 * LANDS_WITHIN_S
    if isinstance(flight, BetweenFlight):
        flight.be_restarted(RESTARTED_S)
        flight.run_for(MET_S)
        mode, until_us = flight.mode, vehicle.time_boot_us + 1e6 * WATCHED_S
    else:
        step = unattended(flight).__next__
    while not is_down(vehicle) and vehicle.time_boot_us < until_us:
        step()
    since_s = 1e-6 * (killed_us - touch.contact_at_boot_us)
    later = [hit for hit in vehicle.truth.hits_so_far() if hit.contact_at_boot_us >= killed_us]
    # The touch itself is no second one, whenever it came.
    again_m_s = hardest(later[1:] if since_s < 0.0 else later)
    ground_m_s = math.hypot(*vehicle.truth.series()["velocity_ned_m_s"][-1]) if is_down(vehicle) else None
    return {"kill_s": since_s, "again_m_s": again_m_s, "ground_m_s": ground_m_s, "mode": mode}


def unattended(flight: Stepped) -> Iterator[bytes]:
    """Nobody answers but by the companion's last words; what the vehicle says in each interval."""
    words, died_us = flight.programs[0].last_words(), flight.vehicle.time_boot_us
    while True:
        due = [word for later_s, word in words if later_s <= 1e-6 * (flight.vehicle.time_boot_us - died_us)]
        words = words[len(due) :]
        yield flight.step_alone(b"".join(due))


def is_down(vehicle: SimulatedVehicle) -> bool:
    return float(vehicle.state.body[2]) > DOWN_M


def hardest(hits: list[Hit]) -> float:
    """How fast the wall was met; 0 where there is none."""
    return max((hit.closing_speed_m_s for hit in hits), default=0.0)


def shown(results: Results) -> Shown:
    flights = results.rows()
    kills = pd.json_normalize(flights, "kills", ["touch_m_s", "program", "loss_s"])
    again = sum(flight["again_m_s"] > SECOND_M_S for flight in flights)
    lead = "After the kill nothing but the last words is sent."
    if flights[0]["program"]:
        lead = f"The link dies with the guard; another one begins {RESTARTED_S:g} s later; {WATCHED_S:g} s are watched."
    lead += (
        f" Second contact: the centre closes with the wall at over {SECOND_M_S:g} m/s after the kill, the hit apart."
    )
    lead += f" With nobody killed, {again} of {len(flights)} flights do."
    return Shown({"": f"{lead}\n\n{kills_table(kills)}"}, rows=kills)


def kills_table(kills: pd.DataFrame) -> str:
    """By who flies, for how long PX4 waits, and when; with PX4's mode afterwards, where another guard asks."""
    rows: list[dict[str, Any]] = []
    for (program, loss_s), group in kills.groupby(["program", "loss_s"], sort=False):
        for when, span in SPANS_S.items():
            some = group[group["kill_s"].between(*span, inclusive="left")]
            modes = ", ".join(f"{mode} {count}" for mode, count in some["mode"].value_counts().items() if mode) or "–"
            who = {"who flies": program or "the companion", "COM_OF_LOSS_T [s]": f"{loss_s:g}"}
            rows.append({**who, "killed": when, **cells(some), "mode then": modes})
    return table(rows)


def cells(kills: pd.DataFrame) -> Mapping[str, Any]:
    again, ground = kills["again_m_s"][kills["again_m_s"] > SECOND_M_S], kills["ground_m_s"].dropna()
    return {
        "kills": len(kills),
        "second contact": f"{len(again)} ({100 * len(again) / max(len(kills), 1):.1f} %)",
        "hardest [m/s]": f"{again.max():.2f}" if len(again) else "–",
        "came down": len(ground),
        "at the ground, median [m/s]": f"{ground.median():.2f}" if len(ground) else "–",
        "most [m/s]": f"{ground.max():.2f}" if len(ground) else "–",
    }
