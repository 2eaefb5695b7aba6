"""`bench kills` and `bench kills-between`: a companion, or a guard that is the link, killed around a hit; the truth."""

import math
import random
from argparse import Namespace
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from typing import Any

import pandas as pd

from bench.cases.vehicles import AIRFRAMES
from bench.cases.walls import into_a_wall
from bench.fly.campaign import Json, Results
from bench.fly.commanded import BetweenFlight, by_places, by_sticks, fly_a_mission
from bench.fly.copies import Copies
from bench.fly.lockstep import STANDS_M
from bench.fly.stepped import Stepped
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
# Both airframes stand as high.
DOWN_M = -load_built_in(AIRFRAMES[0]).geometry.foot_depth_m - STANDS_M


def run_kills(options: Namespace) -> int:
    """0 when the table is written, whatever it says; 1 when a flight failed to be flown."""
    cases = companion_cases(options.kills, options.first_seed)
    return run_study(options, "kills", "A companion that is killed around a hit", cases, work_out_companion, shown)


def run_kills_between(options: Namespace) -> int:
    """The same of a guard in between."""
    cases, title = guard_cases(options.kills, options.first_seed), "A guard in between that is killed around a hit"
    return run_study(options, "kills-between", title, cases, work_out_guard, shown_between)


def instants(kills: int, first_seed: int) -> Iterator[tuple[int, random.Random, int]]:
    """Of each flight the number, what draws it from its seed, and how many kills it is for."""
    for number in range(math.ceil(kills / KILLS_A_FLIGHT)):
        yield number, random.Random(first_seed + number), min(KILLS_A_FLIGHT, kills - KILLS_A_FLIGHT * number)


def _drawn(draw: random.Random, count: int) -> tuple[float, ...]:
    return tuple(sorted(round(draw.uniform(*KILLED_S), 3) for _ in range(count)))


def killed_copies(kills_s: Sequence[float], fly_until: Callable[[float], None], die: Callable[[], Json]) -> list[Json]:
    """Of each instant what became of a copy of the flight in which somebody dies then."""
    copies = Copies()
    for kill_s in kills_s:
        fly_until(kill_s)
        if copies.fork(str(kill_s)):
            copies.leave(die)
    return [*copies.found.values()]


def _is_down(vehicle: SimulatedVehicle) -> bool:
    return float(vehicle.state.body[2]) > DOWN_M


def _became(vehicle: SimulatedVehicle, since_s: float, killed_us: int) -> Json:
    """Since when somebody was dead, how hard the wall was met again (0: not), and how fast the ground."""
    later = [hit for hit in vehicle.truth.hits if hit.contact_at_boot_us >= killed_us]
    # The touch itself is no second one, whenever it came.
    again_m_s = _hardest(later[1:] if since_s < 0.0 else later)
    ground_m_s = math.hypot(*vehicle.truth.series()["velocity_ned_m_s"][-1]) if _is_down(vehicle) else None
    return {"kill_s": since_s, "again_m_s": again_m_s, "ground_m_s": ground_m_s}


def _hardest(hits: Sequence[Hit]) -> float:
    """0 where there is none."""
    return max((hit.closing_speed_m_s for hit in hits), default=0.0)


# --- a companion with a mission

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
class CompanionCase:
    """A flight, and when after the first touch its companion is killed."""

    airframe: str
    imu_hz: int
    speed_m_s: float
    slant_deg: float
    seed: int
    kills_s: tuple[float, ...]


def companion_cases(kills: int, first_seed: int) -> list[CompanionCase]:
    """Airframes and IMU rates in turn; all else as the seed draws it."""
    found = []
    for number, draw, count in instants(kills, first_seed):
        speed_m_s, slant_deg = draw.uniform(*SPEEDS_M_S), draw.uniform(-MOST_SLANT_DEG, MOST_SLANT_DEG)
        how = AIRFRAMES[number % 2], IMU_HZ[number // 2 % 2], round(speed_m_s, 3), round(slant_deg, 1)
        found.append(CompanionCase(*how, first_seed + number, _drawn(draw, count)))
    return found


def _with_companion(case: CompanionCase) -> Stepped:
    """With the case's IMU rate; nobody knows of the wall."""
    data, airframe = into_a_wall("kills", case.speed_m_s, case.slant_deg, HEIGHT_M), load_built_in(case.airframe)
    data["companion"]["streams"] = {"highres_imu_hz": case.imu_hz}
    mission = Mission.model_validate(with_guards(data, airframe))
    scene = Scene.model_validate({**(mission.sim or {}), "airframe": case.airframe, "seed": case.seed})
    companion = Companion(mission)
    companion.confirm_plan()
    return Stepped(SimulatedVehicle(airframe, scene, case.seed), companion)


def work_out_companion(case: CompanionCase) -> Json:
    """Every kill of a flight, and what the same flight does when nobody is killed."""
    first = _with_companion(case)
    while not first.vehicle.truth.hits and first.time_s < REACHED_WITHIN_S:
        first.step()
    touch, flight = first.vehicle.truth.hits[0], _with_companion(case)

    def fly_until(since_s: float) -> None:
        until_us = touch.contact_at_boot_us + 1e6 * since_s
        while flight.vehicle.time_boot_us < until_us and not flight.programs[0].finished:
            flight.step()

    kills = killed_copies(case.kills_s, fly_until, lambda: companion_killed(flight, touch))
    fly_until(KILLED_S[1] + WITH_IT_S)
    again_m_s = _hardest(flight.vehicle.truth.hits[1:])
    return {"touch_m_s": touch.closing_speed_m_s, "again_m_s": again_m_s, "kills": kills}


def companion_killed(flight: Stepped, touch: Hit) -> Json:
    """The companion dies now, and nobody answers the vehicle any more."""
    vehicle, killed_us = flight.vehicle, flight.vehicle.time_boot_us
    while not _is_down(vehicle) and vehicle.time_boot_us < killed_us + 1e6 * LANDS_WITHIN_S:
        flight.step_alone()
    return _became(vehicle, 1e-6 * (killed_us - touch.contact_at_boot_us), killed_us)


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
    return table([{"killed": name, **_cells(of)} for name, of in some.items()])


def _cells(kills: pd.DataFrame) -> dict[str, Any]:
    again, ground = kills["again_m_s"][kills["again_m_s"] > SECOND_M_S], kills["ground_m_s"].dropna()
    return {
        "kills": len(kills),
        "second contact": f"{len(again)} ({100 * len(again) / max(len(kills), 1):.1f} %)",
        "hardest [m/s]": f"{again.max():.2f}" if len(again) else "–",
        "came down": len(ground),
        "at the ground, median [m/s]": f"{ground.median():.2f}" if len(ground) else "–",
        "most [m/s]": f"{ground.max():.2f}" if len(ground) else "–",
    }


# --- a guard that is the link of somebody who flies

PROGRAMS: dict[str, Callable[[BetweenFlight], None]] = {
    "places in OFFBOARD": by_places,
    "AUTO mission": fly_a_mission,
    "sticks in POSCTL": by_sticks,
}
# PX4's default, and what preflight asks for.
LOSS_S = (1.0, 0.3)
# The service begins another guard within this time (companion.service: RestartSec).
RESTARTED_S = 1.0
# By then the new guard has met the vehicle, and PX4's failsafe shows.
MET_S = 1.0
# PX4's failsafe without sticks comes down from a take-off's height in 4 s; one that holds is watched for twice as long.
WATCHED_S = 8.0
TOUCHED_WITHIN_S = 30.0


@dataclass(frozen=True, slots=True)
class GuardCase:
    """A flight, and when after the first touch the guard is killed."""

    program: str
    loss_s: float
    seed: int
    kills_s: tuple[float, ...]


def guard_cases(kills: int, first_seed: int) -> list[GuardCase]:
    """Programs and time-outs in turn; instants as the seed draws them."""
    return [
        GuardCase(list(PROGRAMS)[number % 3], LOSS_S[number // 3 % 2], first_seed + number, _drawn(draw, count))
        for number, draw, count in instants(kills, first_seed)
    ]


def _with_guard(case: GuardCase) -> BetweenFlight:
    """On its way to the wall."""
    air = BetweenFlight(None, {"COM_OF_LOSS_T": case.loss_s}, seed=case.seed)
    air.take_off()
    PROGRAMS[case.program](air)
    return air


def work_out_guard(case: GuardCase) -> Json:
    """Every kill of a flight."""
    first = _with_guard(case)
    first.run_until(lambda: bool(first.vehicle.truth.hits), TOUCHED_WITHIN_S)
    touch_s, air = 1e-6 * first.vehicle.truth.hits[0].contact_at_boot_us, _with_guard(case)
    kills = killed_copies(
        case.kills_s,
        lambda kill_s: air.run_for(touch_s + kill_s - air.time_s),
        lambda: guard_killed(air, air.time_s - touch_s),
    )
    return {"program": case.program, "loss_s": case.loss_s, "kills": kills}


def guard_killed(air: BetweenFlight, since_s: float) -> Json:
    """The guard dies now, and the link with it; another one begins."""
    killed_us = air.vehicle.time_boot_us
    air.be_restarted(RESTARTED_S)
    air.run_for(MET_S)
    mode, until_s = air.mode, air.time_s + WATCHED_S
    while not _is_down(air.vehicle) and air.time_s < until_s:
        air.step()
    return {**_became(air.vehicle, since_s, killed_us), "mode": mode}


def shown_between(results: Results) -> Shown:
    flights = [flight for _, flight in results.found]
    kills = pd.json_normalize(flights, "kills", ["program", "loss_s"])
    lead = (
        f"The guard is the link. It dies, and another one begins {RESTARTED_S:g} s later; {WATCHED_S:g} s are watched. "
        f"Second contact: the centre closes with the wall at over {SECOND_M_S:g} m/s after the kill, the hit apart."
    )
    return Shown({"": f"{lead}\n\n{between_table(kills)}"}, rows=kills)


def between_table(kills: pd.DataFrame) -> str:
    """By who flies, and for how long PX4 waits; before the touch, and after it."""
    rows: list[dict[str, Any]] = []
    for (program, loss_s), group in kills.groupby(["program", "loss_s"], sort=False):
        for when, some in (("before", group[group["kill_s"] < 0.0]), ("after", group[group["kill_s"] >= 0.0])):
            modes = ", ".join(f"{mode} {count}" for mode, count in some["mode"].value_counts().items()) or "–"
            who = {"who flies": program, "COM_OF_LOSS_T [s]": f"{loss_s:g}", "killed": f"{when} the touch"}
            rows.append({**who, **_cells(some), "mode then": modes})
    return table(rows)
