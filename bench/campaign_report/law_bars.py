"""What the laws must show side by side: the same hits flown with each."""

import statistics
from collections.abc import Iterator, Mapping, Sequence

from bench.campaign.plan import Json
from bench.campaign_report.mission_bars import (
    CLEAN_WANTED,
    CLEAR_LEAST_M,
    LOST_MOST_M,
    LOST_UP_TO_M_S,
    OVERSHOOT_MOST_M,
    RISEN_MOST_M,
)
from bench.detectors_report.bars import Bar
from bench.detectors_report.numbers import per_cent, share
from bench.recoveries.hits import AIRFRAMES, RecoveryCase

SOONER_WANTED = 0.25
# A millimetre beside the distance that is wanted is that distance.
CLEAR_SLACK_M = 0.001

Pair = tuple[RecoveryCase, Json, Json]


def pairs(cases: Sequence[RecoveryCase], results: Mapping[int, Json], airframe: str) -> list[Pair]:
    """The same hit with `paper` and with `adaptive`, of those in which something was hit."""
    by_law: dict[str, dict[object, tuple[RecoveryCase, Json]]] = {"paper": {}, "adaptive": {}}
    for number, result in results.items():
        case = cases[number]
        if case.airframe == airframe and case.law in by_law and "past_m" in result:
            by_law[case.law][(case.slant_deg, case.speed_m_s, case.seed)] = (case, result)
    both = [key for key in by_law["adaptive"] if key in by_law["paper"]]
    return [(by_law["adaptive"][key][0], by_law["paper"][key][1], by_law["adaptive"][key][1]) for key in both]


def law_bars(cases: Sequence[RecoveryCase], results: Mapping[int, Json]) -> list[Bar]:
    return [bar for airframe in AIRFRAMES for bar in _of_airframe(airframe, pairs(cases, results, airframe))]


def _of_airframe(airframe: str, found: list[Pair]) -> Iterator[Bar]:
    if not found:
        return
    adaptive = [new for _, _, new in found]
    of = f"{len(found)} hits"
    ratios = [new["settled_s"] / old["settled_s"] for _, old, new in found if new["settled_s"] and old["settled_s"]]
    sooner = 1.0 - statistics.median(ratios) if ratios else 0.0
    yield Bar(
        f"{airframe}, square and slanted, 1 to 5 m/s: settles sooner than with `paper`, median",
        f"≥ {100 * SOONER_WANTED:g} %",
        f"{100 * sooner:.0f} %",
        sooner >= SOONER_WANTED,
        f"{len(ratios)} hits",
    )
    worst_old, worst_new = (
        max(result["past_m"] for result in law) for law in zip(*[p[1:] for p in found], strict=True)
    )
    yield Bar(
        f"{airframe}: overshoot, worst, not above that of `paper` or 5 cm",
        f"≤ {100 * max(worst_old, OVERSHOOT_MOST_M):.1f} cm",
        f"{100 * worst_new:.1f} cm",
        worst_new <= max(worst_old, OVERSHOOT_MOST_M),
        of,
    )
    clean = share(new["past_m"] <= OVERSHOOT_MOST_M and not new["recontacts"] for new in adaptive)
    judged = airframe == "foldable"
    yield Bar(
        f"{airframe}: neither 5 cm of overshoot nor the wall again",
        f"≥ {100 * CLEAN_WANTED:g} %" if judged else "",
        f"{per_cent(clean)} %",
        clean >= CLEAN_WANTED if judged else None,
        of,
    )
    back = share(new["past_m"] <= OVERSHOOT_MOST_M and not new["returned"] for new in adaptive)
    yield Bar(
        f"{airframe}: the same, but for other guards that swing in while the vehicle leaves",
        "",
        f"{per_cent(back)} %",
        None,
        of,
    )
    clear = [_is_clear(old, new) for _, old, new in found if new["clear_m"] is not None]
    yield Bar(
        f"{airframe}: guards at rest clear by 0.3 m, or by half of `paper`'s distance if that is more",
        "100 %",
        f"{per_cent(share(clear))} %",
        all(clear),
        f"{len(clear)} hits, {clear.count(False)} nearer",
    )
    slow = [new["lost_m"] for case, _, new in found if case.speed_m_s <= LOST_UP_TO_M_S]
    yield _metres(f"{airframe}, up to 2.5 m/s: height lost", slow, LOST_MOST_M)
    yield _metres(f"{airframe}, 1 to 5 m/s: height gained", [new["risen_m"] for new in adaptive], RISEN_MOST_M)


def _is_clear(paper: Json, adaptive: Json) -> bool:
    wanted_m = max(CLEAR_LEAST_M, 0.5 * (paper["clear_m"] or 0.0))
    return bool(adaptive["clear_m"] >= wanted_m - CLEAR_SLACK_M)


def _metres(what: str, values: list[float], most_m: float) -> Bar:
    over = sum(value > most_m for value in values)
    measured = f"{100 * max(values):.1f} cm at most" if values else "-"
    return Bar(what, f"≤ {100 * most_m:g} cm", measured, over == 0, f"{len(values)} hits, {over} beyond")
