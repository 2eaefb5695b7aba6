"""`bench ablation`: what each special rule of the companion is worth, in drawn flights.

A rule is a function whose answer can be left out. Where it first matters in a flight, a copy of the whole process flies
on without it. The copy costs the rest of the flight alone, and up to that moment both flights are the same to the bit.
"""

import functools
import importlib
import math
import statistics
import sys
import tempfile
from argparse import Namespace
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np
import yaml

from bench.cases.missions import MissionCase, flyable, random_mission
from bench.cases.vehicles import AIRFRAMES
from bench.fly.campaign import Json, Results
from bench.fly.copies import Copies
from bench.fly.lockstep import JudgedFlight, fly
from bench.rows.contacts import JudgedContact, Role, angle_deg, contacts_of
from bench.rows.judge import failures
from bench.rows.recovered import recoveries
from bench.rows.tables import table
from bench.studies.study import Shown, run_study, seeds_of
from sim_vehicle.truth import Hit

# At rest: slower than what a hover drifts, for longer than a vehicle turns round.
RESTS_M_S, RESTS_S = 0.2, 0.4
# How long a vehicle is waited for.
LONGEST_S = 8.0
# What a recovery must show: past its setpoint, height lost, time to rest.
PAST_M, LOST_M, REST_S = 0.05, 0.10, 3.5
# What is compared of each hit, in which unit, to how many digits.
FIGURES: dict[str, tuple[str, float, int]] = {
    "rest_s": ("rest [s]", 1.0, 2),
    "past_m": ("past [cm]", 100.0, 1),
    "lost_m": ("lost [cm]", 100.0, 1),
    "normal_deg": ("normal [°]", 1.0, 1),
    "v_c_m_s": ("v_c [cm/s]", 100.0, 1),
}


@dataclass(frozen=True, slots=True)
class Rule:
    """A function of the companion, and what it would answer if the rule did not exist (see `rules.yaml`)."""

    name: str
    does: str
    place: str
    says: Any = None
    argument: int | None = None
    attribute: str = ""
    forget: Mapping[str, float] = field(default_factory=dict)

    def without(self, arguments: tuple[Any, ...]) -> Any:
        """What is answered without it."""
        if self.argument is not None:
            return arguments[self.argument]
        if self.attribute:
            return getattr(arguments[0], self.attribute)
        # A vector is a tuple.
        return tuple(self.says) or [] if isinstance(self.says, list) else self.says

    def take_back(self, arguments: tuple[Any, ...]) -> None:
        """What the true call has remembered."""
        for name, value in self.forget.items():
            getattr(arguments[0], name).fill(value)


_FILE = Path(__file__).with_name("rules.yaml")
RULES = tuple(Rule(name, **rule) for name, rule in yaml.safe_load(_FILE.read_text("utf-8")).items())


@contextmanager
def switched(rules: Sequence[Rule]) -> Iterator[Copies]:
    """The companion with every rule watched, while this lasts."""
    copies, undo = Copies(), list[tuple[Any, str, Any]]()
    try:
        for rule in rules:
            for owner, name in _places(rule):
                undo.append((owner, name, vars(owner)[name]))
                setattr(owner, name, _watched(rule, copies, vars(owner)[name]))
        yield copies
    finally:
        for owner, name, original in reversed(undo):
            setattr(owner, name, original)


def _places(rule: Rule) -> list[tuple[Any, str]]:
    """The class of a method; of a function every module of the companion that calls it."""
    module_name, _, path = rule.place.partition(":")
    module = importlib.import_module(f"companion.{module_name}")
    owner_name, _, name = path.rpartition(".")
    if owner_name:
        return [(getattr(module, owner_name), name)]
    function = getattr(module, name)
    modules = [each for key, each in sys.modules.items() if key.split(".")[0] == "companion"]
    return [(each, name) for each in modules if vars(each).get(name) is function]


def _watched(rule: Rule, copies: Copies, original: Any) -> Any:
    if isinstance(original, property):
        assert original.fget is not None
        return property(_watched(rule, copies, original.fget))

    @functools.wraps(original)
    def watched(*arguments: Any) -> Any:
        found = original(*arguments)
        if copies.me == rule.name:
            rule.take_back(arguments)
            return rule.without(arguments)
        if copies.me is not None or rule.name in copies.found:
            return found
        other = rule.without(arguments)
        # What is remembered makes a difference whatever is answered.
        if (other == found and not rule.forget) or not copies.fork(rule.name):
            return found
        rule.take_back(arguments)
        return other

    return watched


# --- the flights


def run_ablation(options: Namespace) -> int:
    """0 when the table is written, whatever it says; 1 when a flight failed to be flown."""
    seeds = seeds_of(options, options.missions)
    cases = [MissionCase(seed, kind, is_drawn=True) for seed in seeds for kind in AIRFRAMES]
    title = "What each special rule is worth: with it, less without"
    return run_study(options, "ablation", title, cases, work_out, shown)


def shown(results: Results) -> Shown:
    return Shown({"Flights": flights_table([flight for _, flight in results.found])})


def work_out(case: MissionCase) -> Json:
    """What became of the flight, and of its copies by rule."""
    drawn = random_mission(case)
    with tempfile.TemporaryDirectory() as folder, switched(RULES) as copies:
        flight: JudgedFlight | None = None
        try:
            flight = fly(*flyable(case, drawn), Path(folder))
        finally:
            copies.leave(lambda: {"error": "the companion failed"} if flight is None else verdict(flight))
        return {"with": verdict(flight), "without": copies.found}


def verdict(flight: JudgedFlight) -> Json:
    """Of a flight as a whole, and of each recovery in it."""
    contacts = contacts_of(flight)
    hits = [contact for contact in contacts if contact.role is Role.HIT]
    found = zip(recoveries(flight, contacts), hits, strict=True)
    return {"ends": not failures(flight), "hits": [_of_one(flight, figures, contact) for figures, contact in found]}


def _of_one(flight: JudgedFlight, figures: Json, contact: JudgedContact) -> Json:
    found = {name: figures[name] for name in ("past_m", "lost_m", "returned", "closing_m_s")}
    rest_s = found["rest_s"] = _rests_after_s(flight, contact.hit)
    found["recovered"] = False
    # Of a hit that nobody answered there is no setpoint to be past.
    if rest_s is not None and figures["past_m"] is not None:
        is_near = figures["past_m"] <= PAST_M and figures["lost_m"] <= LOST_M
        found["recovered"] = is_near and rest_s <= REST_S and not figures["returned"]
    if contact.collision is not None:
        told, hit = flight.report.collisions[contact.collision], contact.hit
        found["normal_deg"] = round(angle_deg(told.normal_ned, hit.normal_ned), 1)
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


def flights_table(flights: Sequence[Json]) -> str:
    """Of each rule the flights in which it changed an answer: how they end, how hits recover, medians of changes."""
    rows: list[dict[str, object]] = []
    for rule in RULES:
        known = [(one["with"], one["without"][rule.name]) for one in flights if rule.name in one["without"]]
        flown = [(kept, left) for kept, left in known if "hits" in left]
        # A copy that died says nothing of its end.
        ends = sum(kept.get("ends", False) - left.get("ends", False) for kept, left in known)
        recovers = sum(hit["recovered"] for kept, _ in flown for hit in kept["hits"])
        recovers -= sum(hit["recovered"] for _, left in flown for hit in left["hits"])
        changes = {label: _change(flown, key, times, digits) for key, (label, times, digits) in FIGURES.items()}
        counts = {"mattered": len(known), "ends": f"{ends:+d}", "recovers": f"{recovers:+d}"}
        rows.append({"rule": rule.name, "what it does": rule.does, **counts, **changes})
    return table(rows)


def _change(pairs: Sequence[tuple[Json, Json]], name: str, times: float, digits: int) -> str:
    same = [(kept["hits"], left["hits"]) for kept, left in pairs if len(kept["hits"]) == len(left["hits"])]
    figures = [(a.get(name), b.get(name)) for kept, left in same for a, b in zip(kept, left, strict=True)]
    changes = [times * (a - b) for a, b in figures if a is not None and b is not None]
    return f"{statistics.median(changes):+.{digits}f}" if changes else "–"
