"""What the random missions must show."""

from collections.abc import Iterator, Mapping

import pandas as pd

from bench.cases.vehicles import AIRFRAMES
from bench.rows.judge import NOTICED_M_S
from bench.rows.tables import Bar, per_cent, share

MISSIONS_WANTED = {"foldable": 0.995, "rigid": 0.95}
# What is wanted of vehicles drawn at random; the two named ones have other bars.
DRAWN_WANTED = {"foldable": 0.995, "rigid": 0.99}
CLEAN_WANTED = 0.99
OVERSHOOT_MOST_M = 0.05
LOST_MOST_M, LOST_UP_TO_M_S = 0.10, 2.5
RISEN_MOST_M = 0.05
# A vehicle that leant by more hangs on the obstacle by its own thrust.
PINNED_DEG = 60.0
LOSING_M, LEFT_MOST = 0.05, 0.5
CLEAR_LEAST_M = 0.3
# The hits that the bars are about: 1 to 5 m/s; heights of vehicles that fly level past something upright.
HIT_SPEEDS_M_S = (1.0, 5.0)
LEVEL_M_S = 0.3
UPRIGHT = 0.7


def noticeable(hits: pd.DataFrame) -> "pd.Series[bool]":
    """Those that go into the surface, not along it, as fast as a detector must notice."""
    return hits["closing_m_s"] >= NOTICED_M_S


def level(hits: pd.DataFrame) -> pd.DataFrame:
    """Answered hits on something upright in level flight that met nothing else: their height is the hit's doing."""
    is_level = (hits["climbing_m_s"].abs() < LEVEL_M_S) & (hits["steepness"].abs() < UPRIGHT) & (hits["others"] == 0)
    return hits[is_level & hits["past_m"].notna()]


def mission_bars(flights: pd.DataFrame, hits: pd.DataFrame, wanted: Mapping[str, float] = MISSIONS_WANTED) -> list[Bar]:
    """`wanted`: the share of missions that must end as they say, by airframe."""
    bars = [bar for airframe in AIRFRAMES for bar in _endings(airframe, flights, wanted[airframe])]
    return bars + [bar for airframe in AIRFRAMES for bar in _hits(airframe, hits[hits["airframe"] == airframe])]


def _endings(airframe: str, flights: pd.DataFrame, wanted: float) -> Iterator[Bar]:
    flown = flights[(flights["airframe"] == airframe) & flights["feed_forward"]]
    good = share(flown["is_good"])
    yield Bar(
        f"{airframe}: missions that end as they say, without a crash",
        f"≥ {100 * wanted:g} %",
        f"{per_cent(good, 2)} %",
        good >= wanted,
        f"{len(flown)} missions, {(~flown['is_good']).sum()} not",
    )
    yield Bar(f"{airframe}: ways flown round what was known", "", str(flown["detours"].sum()), None)
    yield Bar(f"{airframe}: goals reported as out of reach", "", str(flown["unreachable"].sum()), None)


def _hits(airframe: str, every: pd.DataFrame) -> Iterator[Bar]:
    hits = every[every["feed_forward"]]
    fast = hits[hits["speed_m_s"].between(*HIT_SPEEDS_M_S, inclusive="left")]
    answered, clear_m = fast[fast["past_m"].notna()], fast["clear_m"].dropna()
    is_near, judged = answered["past_m"] <= OVERSHOOT_MOST_M, airframe == "foldable"
    clean = share(is_near & (answered["again"] == 0))
    reasons = f"{(~is_near).sum()} past by more, {(answered['again'] > 0).sum()} touched again"
    yield Bar(
        f"{airframe}, 1 to 5 m/s: hits without 5 cm of overshoot and without touching the surface again",
        f"≥ {100 * CLEAN_WANTED:g} %" if judged else "",
        f"{per_cent(clean)} %",
        clean >= CLEAN_WANTED if judged else None,
        f"{len(answered)} hits, {reasons}",
    )
    apart = f"{airframe}, 1 to 5 m/s: the same, but for other guards that swing in while the vehicle leaves"
    came_back = f"{(answered['returned'] > 0).sum()} had come back"
    yield Bar(apart, "", f"{per_cent(share(is_near & (answered['returned'] == 0)))} %", None, came_back)
    yield Bar(
        f"{airframe}, 1 to 5 m/s: guards at rest {CLEAR_LEAST_M} m clear of what was hit",
        "",
        f"{per_cent(share(clear_m >= CLEAR_LEAST_M))} %",
        None,
        f"{len(clear_m)} hits, the nearest {100 * clear_m.min():.0f} cm",
    )
    slow = level(hits[hits["speed_m_s"] < LOST_UP_TO_M_S])
    yield _worst(f"{airframe}, level, up to 2.5 m/s: height lost", slow["lost_m"], LOST_MOST_M)
    upright = slow[slow["leant_deg"] < PINNED_DEG]
    yield _worst(f"{airframe}: the same, but for hits that tip it by {PINNED_DEG:g} deg", upright["lost_m"])
    yield _worst(f"{airframe}, level: height gained", level(hits)["risen_m"], RISEN_MOST_M)
    yield _halved(airframe, every)
    into = hits[noticeable(hits)]
    noticed = f"{per_cent(share(into['seen']))} %"
    yield Bar(
        f"{airframe}: hits noticed, of those with 0.5 m/s into the surface", "", noticed, None, f"{len(into)} hits"
    )


def _worst(what: str, values: "pd.Series[float]", most_m: float | None = None) -> Bar:
    """The largest; reported only, without a limit."""
    wanted = "" if most_m is None else f"≤ {100 * most_m:g} cm"
    if not len(values):
        return Bar(what, wanted, "-", None, "no hit")
    measured = f"{100 * values.max():.1f} cm at most, {100 * values.median():.1f} in the median"
    over = 0 if most_m is None else int((values > most_m).sum())
    return Bar(what, wanted, measured, None if most_m is None else over == 0, f"{len(values)} hits, {over} beyond")


def _halved(airframe: str, hits: pd.DataFrame) -> Bar:
    """Over first hits that lose much without the feed-forward: what is left of it with it, of the same missions."""
    first = level(hits[hits["hit"] == 0])
    pairs = first[~first["feed_forward"]].merge(first[first["feed_forward"]], on="seed", suffixes=("", "_with"))
    losing = pairs[pairs["lost_m"] > LOSING_M]
    left = losing["lost_m_with"].sum() / losing["lost_m"].sum() if len(losing) else None
    return Bar(
        f"{airframe}, level, hits that lose 5 cm and more without the feed-forward: what is left of it with it",
        f"≤ {100 * LEFT_MOST:g} %",
        "-" if left is None else f"{100 * left:.0f} %",
        None if left is None else bool(left <= LEFT_MOST),
        f"{len(losing)} of {len(pairs)} hits",
    )
