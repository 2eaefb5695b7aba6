"""`bench landings`: drawn vehicles land in every way and fall at any tilt; what is reported of the ground."""

from argparse import Namespace
from collections import Counter
from collections.abc import Sequence

import numpy as np
import pandas as pd

from bench.cases.vehicles import AIRFRAMES, vehicle_of
from bench.fly.by_hand.watched import IMU_HZ, Row
from bench.fly.by_hand.ways_down import (
    BY_STICKS,
    FALLS,
    GROUNDS,
    LAND_M_S,
    LANDINGS,
    STICKS_M_S,
    GroundCase,
    begun,
    land,
    on_ground,
    to_the_end,
)
from bench.fly.campaign import Results
from bench.rows.tables import by_each
from bench.studies.study import Shown, run_study, seeds_of

CRASH, NO_COLLISION = "crash", ("landing", "contact")
# A crash is reported within this time of its greatest deceleration.
CRASH_WITHIN_S = 0.2


def run_landings(options: Namespace) -> int:
    """0 when every landing and every fall was reported for what it was, else 1."""
    cases = [draw_case(seed, LANDINGS) for seed in seeds_of(options, options.landings)]
    cases += [draw_case(seed, FALLS) for seed in seeds_of(options, options.falls)]
    return run_study(options, "landings", "Landings and falls", cases, fly_to_the_ground, shown)


def shown(results: Results) -> Shown:
    rows = results.rows()
    text = text_of(rows)
    return Shown({"": text}, text, pd.DataFrame(rows), is_met=not any(row["wrong"] for row in rows))


def draw_case(seed: int, ways: Sequence[str]) -> GroundCase:
    """Ways, rates and grounds in turn."""
    turn = seed // len(ways)
    ground = tuple(GROUNDS)[turn // len(IMU_HZ) % len(GROUNDS)]
    return GroundCase(seed, IMU_HZ[turn % len(IMU_HZ)], ways[seed % len(ways)], ground)


def fly_to_the_ground(case: GroundCase) -> Row:
    """What was reported until a while after the touch, and what it should have been."""
    rng = np.random.default_rng([case.seed, 12 + case.is_fall])
    built = vehicle_of(AIRFRAMES[case.seed // 2 % 2], case.seed)
    sink_m_s = float(rng.uniform(*(STICKS_M_S if case.way in BY_STICKS else LAND_M_S)))
    airframe = on_ground(case.ground, built.airframe, rng)
    flight, height_error_m = begun(case, built, airframe, sink_m_s, rng)
    if case.way == "mission" or case.is_fall:
        to_the_end(flight)
    else:
        land(flight, case.way, airframe, sink_m_s, rng)
    reported, touched_us, hardest_us = flight.watchers[0].reported, flight.touched_us, flight.hardest_us
    outcome, wrong = judged(case.is_fall, touched_us, hardest_us, reported)
    return {
        "seed": case.seed,
        "imu_hz": case.imu_hz,
        "airframe": airframe.name,
        "way": case.way,
        "ground": case.ground,
        "height_error_m": round(height_error_m, 2),
        "asked_m_s": round(sink_m_s, 2),
        "touched_s": None if touched_us is None else round(1e-6 * touched_us, 3),
        "sink_m_s": round(flight.sink_at_touch_m_s, 2),
        "tilt_deg": round(flight.tilt_at_touch_deg, 1),
        "hardest_m_s2": round(flight.hardest_m_s2, 1),
        "hardest_s": None if hardest_us is None else round(1e-6 * hardest_us, 3),
        "outcome": outcome,
        "wrong": wrong,
        "reported": reported,
    }


def judged(is_fall: bool, touched_us: int | None, hardest_us: int | None, reported: Sequence[Row]) -> tuple[str, str]:
    """What the ground was reported as, first; and what is wrong with all that was reported, "" where nothing is."""
    if touched_us is None or hardest_us is None:
        return "not there", "the ground was not reached"
    touched_s, hardest_s = 1e-6 * touched_us, 1e-6 * hardest_us
    before = [one["kind"] for one in reported if one["sample_s"] < touched_s - 1e-3]
    after = [one for one in reported if one["sample_s"] >= touched_s - 1e-3]
    first = after[0]["kind"] if after else "nothing"
    if before:
        return first, f"{before[0]} before the touch"
    allowed = (*NO_COLLISION, CRASH) if is_fall and first == CRASH else NO_COLLISION
    false = [one["kind"] for one in after if one["kind"] not in allowed]
    if not is_fall:
        return first, f"{false[0]} in a landing" if false else ""
    if first != CRASH:
        return first, f"{first} in a crash"
    if false:
        return first, f"{false[0]} after the crash"
    late_s = after[0]["sample_s"] - hardest_s
    return first, f"{late_s:.2f} s late" if late_s > CRASH_WITHIN_S else ""


def text_of(rows: Sequence[Row]) -> str:
    """By way and by rate how the ground was reported, then every flight of which something is wrong."""
    frame = pd.DataFrame(rows)
    is_fall, text = frame["way"].isin(FALLS), ""
    for name, some in (("landings", frame[~is_fall]), ("falls", frame[is_fall])):
        text += by_each(some.assign(all=name), ("all", "way", "imu_hz", "ground"), _figures) + "\n"
    text += "Bars: no landing reported as a collision; every fall as a crash within 0.2 s of the hardest moment.\n"
    return text + "\n".join(str(row) for row in rows if row["wrong"])


def _figures(flights: pd.DataFrame) -> Row:
    outcomes = Counter(flights["outcome"]).most_common()
    said = ", ".join(f"{outcome} {number}" for outcome, number in outcomes)
    return {"flights": len(flights), "wrong": flights["wrong"].astype(bool).sum(), "the ground reported first as": said}
