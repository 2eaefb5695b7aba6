"""`bench kills-between`: the link dies with the guard in between, and another guard begins. By the truth."""

from argparse import Namespace
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import pandas as pd

from bench.fly.campaign import Json, Results
from bench.fly.commanded import BetweenFlight, by_places, by_sticks, fly_a_mission
from bench.rows.killed import became, is_down, killed_copies
from bench.rows.tables import table
from bench.studies.kills import SECOND_M_S, cells, drawn_instants, instants
from bench.studies.study import Shown, run_study

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


def run_kills_between(options: Namespace) -> int:
    """0 when the table is written, whatever it says; 1 when a flight failed to be flown."""
    flights, title = cases(options.kills, options.first_seed), "A guard in between that is killed around a hit"
    return run_study(options, "kills-between", title, flights, work_out, shown)


def cases(kills: int, first_seed: int) -> list[Case]:
    """Programs and time-outs in turn; instants as the seed draws them."""
    return [
        Case(list(PROGRAMS)[number % 3], LOSS_S[number // 3 % 2], first_seed + number, drawn_instants(draw, count))
        for number, draw, count in instants(kills, first_seed)
    ]


def begun(case: Case) -> BetweenFlight:
    """On its way to the wall."""
    air = BetweenFlight(None, {"COM_OF_LOSS_T": case.loss_s}, seed=case.seed)
    air.take_off()
    PROGRAMS[case.program](air)
    return air


def work_out(case: Case) -> Json:
    """Every kill of a flight."""
    first = begun(case)
    first.run_until(lambda: bool(first.vehicle.truth.hits), TOUCHED_WITHIN_S)
    touch_s, air = 1e-6 * first.vehicle.truth.hits[0].contact_at_boot_us, begun(case)
    kills = killed_copies(
        case.kills_s,
        lambda kill_s: air.run_for(touch_s + kill_s - air.time_s),
        lambda: killed(air, air.time_s - touch_s),
    )
    return {"program": case.program, "loss_s": case.loss_s, "kills": kills}


def killed(air: BetweenFlight, since_s: float) -> Json:
    """The guard dies now, and the link with it; another one begins."""
    killed_us = air.vehicle.time_boot_us
    air.be_restarted(RESTARTED_S)
    air.run_for(MET_S)
    mode, until_s = air.mode, air.time_s + WATCHED_S
    while not is_down(air.vehicle) and air.time_s < until_s:
        air.step()
    return {**became(air.vehicle, since_s, killed_us), "mode": mode}


def shown(results: Results) -> Shown:
    flights = [flight for _, flight in results.found]
    kills = pd.json_normalize(flights, "kills", ["program", "loss_s"])
    lead = (
        f"The guard is the link. It dies, and another one begins {RESTARTED_S:g} s later; {WATCHED_S:g} s are watched. "
        f"Second contact: the centre closes with the wall at over {SECOND_M_S:g} m/s after the kill, the hit apart."
    )
    return Shown({"": f"{lead}\n\n{kills_table(kills)}"}, rows=kills)


def kills_table(kills: pd.DataFrame) -> str:
    """By who flies, and for how long PX4 waits; before the touch, and after it."""
    rows: list[dict[str, Any]] = []
    for (program, loss_s), group in kills.groupby(["program", "loss_s"], sort=False):
        for when, some in (("before", group[group["kill_s"] < 0.0]), ("after", group[group["kill_s"] >= 0.0])):
            modes = ", ".join(f"{mode} {count}" for mode, count in some["mode"].value_counts().items()) or "–"
            who = {"who flies": program, "COM_OF_LOSS_T [s]": f"{loss_s:g}", "killed": f"{when} the touch"}
            rows.append({**who, **cells(some), "mode then": modes})
    return table(rows)
