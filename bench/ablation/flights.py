"""One drawn vehicle's flight, and the same flight without each rule that mattered in it. By the truth."""

import math
import tempfile
from pathlib import Path

import numpy as np

from bench.ablation.rules import RULES
from bench.ablation.switching import switched
from bench.campaign.plan import Campaign, Json
from bench.random_missions.contacts import JudgedContact, Role, contacts_of
from bench.random_missions.flight import JudgedFlight, fly_in
from bench.random_missions.generator import AIRFRAMES, MissionCase, random_mission
from bench.random_missions.judge import failures
from bench.random_missions.recovered import recoveries
from sim_vehicle.truth import Hit

# At rest: slower than what a hover wavers by, for longer than a vehicle turns round.
RESTS_M_S, RESTS_S = 0.2, 0.4
# How long a vehicle is waited for.
LONGEST_S = 8.0


def ablation_campaign(missions: int, first_seed: int, names: tuple[str, ...]) -> Campaign:
    """`names`: of the rules that are looked at."""
    seeds = range(first_seed, first_seed + missions)
    cases = [(MissionCase(seed, kind, is_drawn=True), names) for seed in seeds for kind in AIRFRAMES]
    parameters = {"missions": missions, "first_seed": first_seed, "rules": list(names)}
    return Campaign("ablation", parameters, cases, work_out, uses=("bench.random_missions",))


def work_out(case: tuple[MissionCase, tuple[str, ...]]) -> Json:
    """What became of the flight, and of its copies by rule."""
    mission, names = case
    drawn = random_mission(mission)
    rules = [rule for rule in RULES if rule.name in names]
    with tempfile.TemporaryDirectory() as folder, switched(rules) as copies:
        flight: JudgedFlight | None = None
        try:
            flight = fly_in(Path(folder), mission, drawn)
        finally:
            copies.leave(lambda: {"failure": "the companion failed"} if flight is None else verdict(flight))
        return {"with": verdict(flight), "without": copies.found}


def verdict(flight: JudgedFlight) -> Json:
    """Of a flight as a whole, and of each recovery in it."""
    contacts = contacts_of(flight)
    hits = [contact for contact in contacts if contact.role is Role.HIT]
    found = zip(recoveries(flight, contacts), hits, strict=True)
    return {
        "failures": [failure.cause for failure in failures(flight)],
        "hits": [_of_one(flight, figures, contact) for figures, contact in found],
    }


def _of_one(flight: JudgedFlight, figures: Json, contact: JudgedContact) -> Json:
    found = {name: figures.get(name) for name in ("past_m", "lost_m", "risen_m", "returned", "closing_m_s")}
    found["rest_s"] = _rests_after_s(flight, contact.hit)
    if contact.collision is not None:
        told, hit = flight.report.collisions[contact.collision], contact.hit
        cosine = float(np.dot(told.normal_ned, hit.normal_ned))
        found["normal_deg"] = round(math.degrees(math.acos(min(1.0, max(-1.0, cosine)))), 1)
        found["v_c_m_s"] = round(math.dist(told.impact_velocity_ned_m_s, hit.impact_velocity_ned_m_s), 3)
    return found


def _rests_after_s(flight: JudgedFlight, hit: Hit) -> float | None:
    """From the touch to the beginning of the first rest; None where there was none."""
    series = flight.truth.series
    since_s = 1e-6 * (series["time_boot_us"] - hit.contact_at_boot_us)
    looked_at = (since_s >= 0.0) & (since_s <= LONGEST_S)
    since_s = since_s[looked_at]
    moves = np.linalg.norm(series["velocity_ned_m_s"][looked_at], axis=1) > RESTS_M_S
    began_s = np.concatenate([[0.0], since_s[moves], since_s[-1:]])
    long = np.flatnonzero(np.diff(began_s) >= RESTS_S)
    return round(float(began_s[long[0]]), 3) if long.size else None
