"""What the random missions must show."""

import statistics
from collections.abc import Iterator, Mapping

from bench.campaign.plan import Json
from bench.campaign_report.flown import HIT_SPEEDS_M_S, Missions, answered, level, square
from bench.detectors_report.bars import Bar
from bench.detectors_report.numbers import per_cent, share

MISSIONS_WANTED = {"foldable": 0.995, "rigid": 0.95}
# What is wanted of vehicles drawn at random; the two named ones have other bars.
DRAWN_WANTED = {"foldable": 0.995, "rigid": 0.99}
CLEAN_WANTED = 0.99
OVERSHOOT_MOST_M = 0.05
LOST_MOST_M, LOST_UP_TO_M_S = 0.10, 2.5
RISEN_MOST_M = 0.05
# A vehicle that leant by more hangs on the obstacle by its own thrust (bench/notes/decisions.md).
PINNED_DEG = 60.0
LOSING_M, LEFT_MOST = 0.05, 0.5
CLEAR_LEAST_M = 0.3


def mission_bars(missions: Missions, wanted: Mapping[str, float] = MISSIONS_WANTED) -> list[Bar]:
    """`wanted`: the share of missions that must end as they say, by airframe."""
    return [*_endings(missions, wanted), *_hits(missions)]


def _endings(missions: Missions, shares: Mapping[str, float]) -> Iterator[Bar]:
    for airframe, wanted in shares.items():
        flown = missions.of(airframe)
        good = share(one.is_good for one in flown)
        failed = sum(not one.is_good for one in flown)
        yield Bar(
            f"{airframe}: missions that end as they say, without a crash",
            f"≥ {100 * wanted:g} %",
            f"{per_cent(good, 2)} %",
            good >= wanted,
            f"{len(flown)} missions, {failed} not",
        )
        detours, given_up = (sum(one.result[key] for one in flown) for key in ("detours", "unreachable"))
        yield Bar(f"{airframe}: ways flown round what was known", "", str(detours), None)
        yield Bar(f"{airframe}: goals reported as out of reach", "", str(given_up), None)


def _hits(missions: Missions) -> Iterator[Bar]:
    for airframe in MISSIONS_WANTED:
        hits = missions.hits(airframe, *HIT_SPEEDS_M_S)
        clean = share(is_clean(hit) for hit in answered(hits))
        judged = airframe == "foldable"
        yield Bar(
            f"{airframe}, 1 to 5 m/s: hits without 5 cm of overshoot and without touching the surface again",
            f"≥ {100 * CLEAN_WANTED:g} %" if judged else "",
            f"{per_cent(clean)} %",
            clean >= CLEAN_WANTED if judged else None,
            f"{len(answered(hits))} hits, {_reasons(answered(hits))}",
        )
        swung = share(is_clean(hit, "returned") for hit in answered(hits))
        apart = f"{airframe}, 1 to 5 m/s: the same, but for other guards that swing in while the vehicle leaves"
        came_back = sum(hit["returned"] > 0 for hit in answered(hits))
        yield Bar(apart, "", f"{per_cent(swung)} %", None, f"{came_back} had come back")
        clear = [hit["clear_m"] for hit in hits if hit.get("clear_m") is not None]
        yield Bar(
            f"{airframe}, 1 to 5 m/s: guards at rest {CLEAR_LEAST_M} m clear of what was hit",
            "",
            f"{per_cent(share(clear_m >= CLEAR_LEAST_M for clear_m in clear))} %",
            None,
            f"{len(clear)} hits" + (f", the nearest {100 * min(clear):.0f} cm" if clear else ""),
        )
        slow = level(missions.hits(airframe, 0.0, LOST_UP_TO_M_S))
        yield _worst(f"{airframe}, level, up to 2.5 m/s: height lost", slow, "lost_m", LOST_MOST_M)
        upright = [hit for hit in slow if hit["leant_deg"] < PINNED_DEG]
        yield _worst(f"{airframe}: the same, but for hits that tip it by {PINNED_DEG:g} deg", upright, "lost_m")
        every = level(missions.hits(airframe, 0.0, 99.0))
        yield _worst(f"{airframe}, level: height gained", every, "risen_m", RISEN_MOST_M)
        yield _halved(airframe, missions.first_hits_compared(airframe))
        into = square(missions.hits(airframe, 0.0, 99.0))
        noticed = f"{per_cent(share(hit['seen'] for hit in into))} %"
        yield Bar(f"{airframe}: hits noticed, of those with 0.5 m/s into the surface", "", noticed, None, _of(into))


def is_clean(hit: Json, touches: str = "again") -> bool:
    return bool(hit["past_m"] <= OVERSHOOT_MOST_M and not hit[touches])


def _reasons(hits: list[Json]) -> str:
    past = sum(hit["past_m"] > OVERSHOOT_MOST_M for hit in hits)
    return f"{past} past by more, {sum(hit['again'] > 0 for hit in hits)} touched again"


def _worst(what: str, hits: list[Json], key: str, most_m: float | None = None) -> Bar:
    """The largest; reported only, without a limit."""
    bar = "" if most_m is None else f"≤ {100 * most_m:g} cm"
    if not hits:
        return Bar(what, bar, "-", None, "no hit")
    values = [hit[key] for hit in hits]
    measured = f"{100 * max(values):.1f} cm at most, {100 * statistics.median(values):.1f} in the median"
    if most_m is None:
        return Bar(what, bar, measured, None, _of(hits))
    over = sum(value > most_m for value in values)
    return Bar(what, bar, measured, over == 0, f"{len(hits)} hits, {over} beyond")


def _halved(airframe: str, pairs: list[tuple[Json, Json]]) -> Bar:
    """Over the hits that lose much without the feed-forward: what is left of it with it."""
    losing = [(without["lost_m"], with_it["lost_m"]) for without, with_it in pairs if without["lost_m"] > LOSING_M]
    left = sum(after for _, after in losing) / sum(before for before, _ in losing) if losing else None
    return Bar(
        f"{airframe}, level, hits that lose 5 cm and more without the feed-forward: what is left of it with it",
        f"≤ {100 * LEFT_MOST:g} %",
        "-" if left is None else f"{100 * left:.0f} %",
        None if left is None else left <= LEFT_MOST,
        f"{len(losing)} of {len(pairs)} hits",
    )


def _of(hits: list[Json]) -> str:
    return f"{len(hits)} hits"
