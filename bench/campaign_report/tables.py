"""Tables of the random missions."""

import itertools
import statistics
from collections import Counter
from collections.abc import Callable, Sequence
from functools import partial

from bench.campaign.plan import Json
from bench.campaign_report.flown import FlownCase, Missions, answered, level, square
from bench.campaign_report.mission_bars import OVERSHOOT_MOST_M
from bench.detectors_report.numbers import per_cent, share
from bench.paper.table import markdown
from bench.random_missions.generator import AIRFRAMES, STREAMS_HZ, MissionCase

SPEED_BINS_M_S = (0.0, 0.5, 1.0, 1.5, 2.0, 2.5, 3.0, 4.0, 5.5)
WIND_BINS_M_S = (0.0, 1.0, 2.0, 3.0, 4.0, 5.01)


def kinds_text(missions: Missions) -> str:
    """How many ended as they say, by what was drawn."""
    rooms = sorted({result["room"] for result in missions.results.values()})
    extras = sorted({extra for result in missions.results.values() for extra in result["extras"]})
    winds = itertools.pairwise(WIND_BINS_M_S)
    kinds: list[tuple[str, Callable[[Json], bool]]] = [
        *((room, partial(_is, "room", room)) for room in rooms),
        *((f"with a {extra}", partial(_has, extra)) for extra in extras),
        *((f"{hz} Hz", partial(_is, "stream_hz", hz)) for hz in sorted(STREAMS_HZ, reverse=True)),
        *((f"wind {low:g} to {high:.0f} m/s", partial(_blows, low, high)) for low, high in winds),
    ]
    rows = [_kind_row(missions, name, which) for name, which in kinds]
    return markdown(("", "missions", "foldable", "rigid", "hits, foldable", "hits, rigid"), rows)


def _is(key: str, value: object, result: Json) -> bool:
    return bool(result[key] == value)


def _has(extra: str, result: Json) -> bool:
    return extra in result["extras"]


def _blows(low_m_s: float, high_m_s: float, result: Json) -> bool:
    return bool(low_m_s <= result["wind_m_s"] < high_m_s)


def _kind_row(missions: Missions, name: str, which: Callable[[Json], bool]) -> Sequence[str]:
    flown = [missions.of(airframe, which) for airframe in AIRFRAMES]
    good = [f"{sum(one.is_good for one in some)} of {len(some)}" for some in flown]
    hits = [str(sum(len(one.result["hits"]) for one in some)) for some in flown]
    return name, str(max(map(len, flown))), *good, *hits


def speeds_text(missions: Missions) -> str:
    """Recoveries of both airframes by the speed of the hit."""
    head = ("airframe", "speed", "hits", "noticed", "settled", "past 5 cm", "past, worst", "again", "other surface")
    rows = []
    for airframe in AIRFRAMES:
        for low, high in itertools.pairwise(SPEED_BINS_M_S):
            hits = missions.hits(airframe, low, high)
            if hits:
                rows.append((airframe, f"{low:g} to {high:g} m/s", *_speed_cells(hits)))
    return markdown((*head, "lost, worst", "gained, worst"), rows, left=2)


def _speed_cells(hits: list[Json]) -> Sequence[str]:
    seen = answered(hits)
    settled = [hit["settled_s"] for hit in seen if hit["settled_s"] is not None]
    flat = level(hits)
    return (
        str(len(hits)),
        f"{per_cent(share(hit['seen'] for hit in square(hits)))} %",
        f"{statistics.median(settled):.2f} s" if settled else "-",
        str(sum(hit["past_m"] > OVERSHOOT_MOST_M for hit in seen)),
        _metres([hit["past_m"] for hit in seen]),
        str(sum(hit["again"] > 0 for hit in hits)),
        str(sum(hit["others"] > 0 for hit in hits)),
        _metres([hit["lost_m"] for hit in flat]),
        _metres([hit["risen_m"] for hit in flat]),
    )


def _metres(values: list[float]) -> str:
    return f"{max(values):.2f} m" if values else "-"


def causes_text(missions: Missions) -> str:
    counts = {
        airframe: Counter(_cause(one) for one in missions.of(airframe) if not one.is_good) for airframe in AIRFRAMES
    }
    causes = sorted({cause for count in counts.values() for cause in count})
    rows = [(cause, *(str(counts[airframe][cause]) for airframe in AIRFRAMES)) for cause in causes]
    return markdown(("first cause", *AIRFRAMES), rows) if rows else "None.\n"


def _cause(flown: FlownCase) -> str:
    return str(flown.result["failures"][0][0])


def failures_text(missions: Missions) -> str:
    """Every mission that did not end as it says; the command flies it again into a run folder."""
    rows = [
        (
            str(one.case.seed),
            one.case.airframe,
            one.result["room"],
            f"{one.result['stream_hz']} Hz",
            f"{one.result['wind_m_s']:.1f} m/s",
            "; ".join(f"{cause}: {details}" for cause, details in one.result["failures"]).replace("|", "/"),
            f"`{command_again(one.case)}`",
        )
        for one in missions.failed()
    ]
    return markdown(("seed", "airframe", "room", "stream", "wind", "cause", "again"), rows, left=7) if rows else ""


def command_again(case: MissionCase) -> str:
    """What flies a mission of the campaign again, into a run folder."""
    airframe = "" if case.airframe == AIRFRAMES[0] else f" --airframe {case.airframe}"
    drawn = " --vehicles drawn" if case.is_drawn else ""
    return f"python -m bench campaign --only {case.seed}{airframe}{drawn}"
