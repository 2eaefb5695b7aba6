"""`bench kills-between`: the link dies with the guard in between, and another guard begins. By the truth."""

import math
import random
from argparse import Namespace
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import pandas as pd

from bench.cases.vehicles import AIRFRAMES
from bench.fly.campaign import Campaign, Json, Workers, run_campaign
from bench.fly.commanded import BetweenFlight, by_places, by_sticks, fly_a_mission
from bench.fly.copies import Copies
from bench.fly.lockstep import STANDS_M
from bench.rows.tables import Page, table
from bench.studies.kills import KILLED_S, KILLS_A_FLIGHT, SECOND_M_S
from companion.guard.config import GuardConfig
from sim_vehicle.airframe import load_built_in

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
class Case:
    """A flight, and when after the first touch the guard is killed."""

    program: str
    loss_s: float
    seed: int
    kills_s: tuple[float, ...]


def cases(kills: int, first_seed: int) -> list[Case]:
    """Programs and time-outs in turn; instants as the seed draws them."""
    found = []
    for number in range(math.ceil(kills / KILLS_A_FLIGHT)):
        draw = random.Random(first_seed + number)
        count = min(KILLS_A_FLIGHT, kills - KILLS_A_FLIGHT * number)
        instants_s = tuple(sorted(round(draw.uniform(*KILLED_S), 3) for _ in range(count)))
        program, loss_s = list(PROGRAMS)[number % 3], LOSS_S[number // 3 % 2]
        found.append(Case(program, loss_s, first_seed + number, instants_s))
    return found


def begun(case: Case) -> BetweenFlight:
    """On its way to the wall."""
    air = BetweenFlight(GuardConfig(), {"COM_OF_LOSS_T": case.loss_s}, seed=case.seed)
    air.take_off()
    PROGRAMS[case.program](air)
    return air


def work_out(case: Case) -> Json:
    """Every kill of a flight."""
    first = begun(case)
    first.run_until(lambda: bool(first.vehicle.truth.hits), TOUCHED_WITHIN_S)
    touch_s = 1e-6 * first.vehicle.truth.hits[0].contact_at_boot_us
    air, copies = begun(case), Copies()
    for kill_s in case.kills_s:
        air.run_for(touch_s + kill_s - air.time_s)
        if copies.fork(str(kill_s)):
            copies.leave(lambda: killed(air, touch_s))
    return {"program": case.program, "loss_s": case.loss_s, "kills": [*copies.found.values()]}


def killed(air: BetweenFlight, touch_s: float) -> Json:
    """What becomes of it: the guard dies now."""
    vehicle, since_s, killed_us = air.vehicle, air.time_s - touch_s, air.vehicle.time_boot_us
    air.be_restarted(RESTARTED_S)
    air.run_for(MET_S)
    mode, until_s = air.mode, air.time_s + WATCHED_S
    down_m = -load_built_in(AIRFRAMES[0]).geometry.foot_depth_m - STANDS_M
    while float(vehicle.state.body[2]) <= down_m and air.time_s < until_s:
        air.step()
    # A hit is in the truth when it is over.
    later = [hit.closing_speed_m_s for hit in vehicle.truth.hits if hit.contact_at_boot_us >= killed_us]
    is_down = float(vehicle.state.body[2]) > down_m
    ground_m_s = math.hypot(*vehicle.truth.series()["velocity_ned_m_s"][-1]) if is_down else None
    # The touch itself is no second one.
    return {
        "kill_s": since_s,
        "again_m_s": max(later[1:] if since_s < 0.0 else later, default=0.0),
        "mode": mode,
        "ground_m_s": ground_m_s,
    }


def run_kills_between(options: Namespace) -> int:
    """0 when the table is written, whatever it says; 1 when a flight failed to be flown."""
    page, parameters = Page(options.out, "kills-between"), {"kills": options.kills, "first_seed": options.first_seed}
    campaign = Campaign("kills-between", parameters, cases(**parameters), work_out)
    results = run_campaign(campaign, Workers(options.jobs, options.scheduler))
    kills = pd.json_normalize(list(results.results.values()), "kills", ["program", "loss_s"])
    lead = (
        f"The guard is the link. It dies, and another one begins {RESTARTED_S:g} s later; {WATCHED_S:g} s are watched. "
        f"Touched again: the centre closes with the wall at over {SECOND_M_S:g} m/s after the kill, the hit apart."
    )
    parts = {"": f"{lead}\n\n{kills_table(kills)}", "Not flown": results.text(campaign) or "None.\n"}
    page.write("A guard in between that is killed around a hit", options.typed, parts, rows=kills)
    return 1 if results.failures else 0


def kills_table(kills: pd.DataFrame) -> str:
    """By who flies, and for how long PX4 waits; before the touch, and after it."""
    rows: list[dict[str, Any]] = []
    for (program, loss_s), group in kills.groupby(["program", "loss_s"], sort=False):
        for when, some in (("before", group[group["kill_s"] < 0.0]), ("after", group[group["kill_s"] >= 0.0])):
            modes = ", ".join(f"{mode} {count}" for mode, count in some["mode"].value_counts().items())
            ground_m_s = some["ground_m_s"].dropna()
            rows.append(
                {
                    "who flies": program,
                    "COM_OF_LOSS_T [s]": f"{loss_s:g}",
                    "killed": f"{when} the touch",
                    "kills": len(some),
                    "touched again": int((some["again_m_s"] > SECOND_M_S).sum()),
                    "mode then": modes or "–",
                    "came down": len(ground_m_s),
                    "at the ground, most [m/s]": f"{ground_m_s.max():.2f}" if len(ground_m_s) else "–",
                }
            )
    return table(rows)
