"""`bench campaign recoveries`: the same hits on a wall with the laws `paper` and `adaptive`, side by side."""

import statistics
from argparse import Namespace
from collections.abc import Sequence
from dataclasses import asdict, dataclass
from typing import Any

import numpy as np
import pandas as pd

from bench.cases.vehicles import AIRFRAMES
from bench.cases.walls import into_a_wall
from bench.fly.campaign import Campaign, Json, Results, Workers, run_campaign
from bench.fly.lockstep import fly
from bench.rows.hits import returns
from bench.rows.tables import Bar, Page, per_cent, share, table
from companion.mission.model import Mission
from companion.report import FlightReport
from rebound_cli.inputs import with_guards
from rebound_cli.results.summary import LONGEST_RECOVERY_S
from rebound_cli.results.truth_match import FlightTruth, match_contacts
from sim_vehicle.airframe import load_built_in
from sim_vehicle.scene import Scene

LAWS = ("paper", "adaptive")
SPEEDS_M_S = (1.0, 2.0, 3.0, 4.0, 5.0)
SLANTS_DEG = (0, 30)
HEIGHT_M = 2.5
# How long the vehicle is watched at its recovery setpoint.
HOLD_S = 2.0
# What must be shown of `adaptive` beside `paper`.
SOONER_WANTED, CLEAN_WANTED = 0.25, 0.99
OVERSHOOT_MOST_M, CLEAR_LEAST_M, RISEN_MOST_M = 0.05, 0.3, 0.05
LOST_MOST_M, LOST_UP_TO_M_S = 0.10, 2.5
# A millimetre beside the distance that is wanted is that distance.
CLEAR_SLACK_M = 0.001


@dataclass(frozen=True, slots=True)
class RecoveryCase:
    """A hit at a speed on a wall that stands square to the way or slanted."""

    law: str
    airframe: str
    slant_deg: int
    speed_m_s: float
    seed: int


def laws_campaign(seeds: int) -> Campaign:
    cases = [
        RecoveryCase(law, airframe, slant, speed, seed)
        for airframe in AIRFRAMES
        for slant in SLANTS_DEG
        for speed in SPEEDS_M_S
        for seed in range(1, seeds + 1)
        for law in LAWS
    ]
    return Campaign("recoveries", {"seeds": seeds}, cases, work_out)


def mission_data(case: RecoveryCase) -> dict[str, Any]:
    """The mission: up, into the wall, hold, down."""
    data = into_a_wall("recovery", case.speed_m_s, case.slant_deg, HEIGHT_M)
    return data | {"on_collision": {"then": "hold", "hold_s": HOLD_S}, "recovery": {"law": case.law}}


def work_out(case: RecoveryCase) -> Json:
    """What happened after the first hit, by the simulator's truth. SI units."""
    airframe = load_built_in(case.airframe)
    mission = Mission.model_validate(with_guards(mission_data(case), airframe))
    scene = Scene.model_validate({**(mission.sim or {}), "airframe": case.airframe, "seed": case.seed})
    flown = fly(mission, scene, airframe)
    report, truth = flown.report, flown.truth
    matches = match_contacts(report.collisions, truth.hits, mission.companion.settled.duration_s)
    figures = _figures(report, truth, mission) if report.collisions and truth.hits else {}
    return {"outcome": report.outcome, "recontacts": matches.recontacts, **figures}


def _figures(report: FlightReport, truth: FlightTruth, mission: Mission) -> Json:
    hit, last = truth.hits[0], report.collisions[-1]
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


def rows(campaign: Campaign, results: Results) -> pd.DataFrame:
    """One a flight in which something was hit."""
    found = ({**asdict(campaign.cases[at]), **result} for at, result in results.results.items())
    return pd.DataFrame([row for row in found if "past_m" in row])


def law_table(flights: pd.DataFrame) -> str:
    """Each cell `paper` → `adaptive`. Settled: median; the others: the worst."""
    lines = []
    for (airframe, slant, speed), group in flights.groupby(["airframe", "slant_deg", "speed_m_s"]):
        sides = [group[group["law"] == law] for law in LAWS]
        again = [f"{(side['recontacts'] > 0).sum()} ({(side['returned'] > 0).sum()})" for side in sides]
        settled = [f"{side['settled_s'].median():.2f} s ({side['settled_s'].isna().sum()} not)" for side in sides]
        worst = {
            f"{name}, worst [m]": " → ".join(f"{getattr(side[key], how)():.2f}" for side in sides)
            for name, key, how in (
                ("past the setpoint", "past_m", "max"),
                ("clear", "clear_m", "min"),
                ("height lost", "lost_m", "max"),
                ("risen", "risen_m", "max"),
            )
        }
        cells = {"settled": " → ".join(settled), **worst, "touched again (came back)": " → ".join(again)}
        lines.append({"airframe, slant": f"{airframe}, {slant}°", "speed": f"{speed:g} m/s", **cells})
    return table(lines)


def pairs(flights: pd.DataFrame, airframe: str) -> list[tuple[Any, Any]]:
    """The same hit with `paper` and with `adaptive`."""
    by_law = [flights[(flights["law"] == law) & (flights["airframe"] == airframe)] for law in LAWS]
    paper, adaptive = ({(r.slant_deg, r.speed_m_s, r.seed): r for r in side.itertuples()} for side in by_law)
    return [(paper[key], adaptive[key]) for key in adaptive if key in paper]


def law_bars(flights: pd.DataFrame) -> list[Bar]:
    return [bar for airframe in AIRFRAMES for bar in _bars(airframe, pairs(flights, airframe))]


def _bars(airframe: str, found: Sequence[tuple[Any, Any]]) -> list[Bar]:
    if not found:
        return []
    adaptive, of = [new for _, new in found], f"{len(found)} hits"
    ratios = [new.settled_s / old.settled_s for old, new in found if new.settled_s > 0.0 and old.settled_s > 0.0]
    sooner = 1.0 - statistics.median(ratios) if ratios else 0.0
    old_m, new_m = (max(one.past_m for one in side) for side in zip(*found, strict=True))
    most_m = max(old_m, OVERSHOOT_MOST_M)
    clean = share(new.past_m <= OVERSHOOT_MOST_M and not new.recontacts for new in adaptive)
    back = share(new.past_m <= OVERSHOOT_MOST_M and not new.returned for new in adaptive)
    judged = airframe == "foldable"
    clear = [new.clear_m >= CLEAR_LEAST_M - CLEAR_SLACK_M for new in adaptive if not np.isnan(new.clear_m)]
    slow = [new.lost_m for new in adaptive if new.speed_m_s <= LOST_UP_TO_M_S]
    return [
        Bar(
            f"{airframe}, square and slanted, 1 to 5 m/s: settles sooner than with `paper`, median",
            f"≥ {100 * SOONER_WANTED:g} %",
            f"{100 * sooner:.0f} %",
            sooner >= SOONER_WANTED,
            f"{len(ratios)} hits",
        ),
        Bar(
            f"{airframe}: overshoot, worst, not above that of `paper` or 5 cm",
            f"≤ {100 * most_m:.1f} cm",
            f"{100 * new_m:.1f} cm",
            bool(new_m <= most_m),
            of,
        ),
        Bar(
            f"{airframe}: neither 5 cm of overshoot nor the wall again",
            f"≥ {100 * CLEAN_WANTED:g} %" if judged else "",
            f"{per_cent(clean)} %",
            clean >= CLEAN_WANTED if judged else None,
            of,
        ),
        Bar(f"{airframe}: the same, but for other guards that swing in", "", f"{per_cent(back)} %", None, of),
        Bar(
            f"{airframe}: guards at rest clear by {CLEAR_LEAST_M:g} m",
            "100 %",
            f"{per_cent(share(clear))} %",
            all(clear),
            f"{len(clear)} hits, {clear.count(False)} nearer",
        ),
        _metres(f"{airframe}, up to 2.5 m/s: height lost", slow, LOST_MOST_M),
        _metres(f"{airframe}, 1 to 5 m/s: height gained", [new.risen_m for new in adaptive], RISEN_MOST_M),
    ]


def _metres(what: str, values: Sequence[float], most_m: float) -> Bar:
    over = sum(value > most_m for value in values)
    measured = f"{100 * max(values):.1f} cm at most" if values else "-"
    return Bar(what, f"≤ {100 * most_m:g} cm", measured, over == 0, f"{len(values)} hits, {over} beyond")


def run_laws(options: Namespace) -> int:
    """0 when the table is written, whatever it says; 1 when a flight failed to be flown."""
    page, campaign = Page(options.out, "recovery"), laws_campaign(options.seeds)
    results = run_campaign(campaign, Workers(options.jobs))
    flights = rows(campaign, results)
    page.write("Recovery laws", options.typed, {"": results.text(campaign) + law_table(flights)}, rows=flights)
    return 1 if results.failures else 0
