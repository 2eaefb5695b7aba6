"""Which of many hits a vehicle were missed, by airframe, rate of the IMU and speed."""

import math
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass

from scipy.stats import chi2

from bench.campaign.plan import Json
from bench.detectors.vehicles import AIRFRAMES
from bench.detectors_report.numbers import per_cent, percentile, text_of
from bench.hits.flight import APPROACHES, IMU_HZ, FlownHit
from bench.hits.verdicts import FREE_S, HITS_AN_APPROACH, approach_of
from bench.hits_report.cells import BANDS_M_S, BOUND, CONFIDENCE, NAMED_SEEDS, at_most, head
from bench.hits_report.cost import TWO_CORES_MS, costs

WANTED = 1_000_000
_COLUMNS = ("hits", "vehicles", "missed", "share", "at most", "vehicles with a miss", "found after", "95 % within")


@dataclass(frozen=True, slots=True)
class Judged:
    """One hit: whose it is, what was met, the speed into the surface, after how long it was found."""

    case: FlownHit
    number: int
    closing_m_s: float
    late_ms: float | None

    @property
    def is_noticed(self) -> bool:
        """Whether it is as fast as the detectors' bars want it."""
        return self.closing_m_s >= BANDS_M_S[1][0]


def judged(cases: Sequence[FlownHit], results: Mapping[int, Json]) -> list[Judged]:
    return [Judged(cases[at], *entry) for at, result in results.items() for entry in result["hits"]]


def at_most_of_groups(groups: Sequence[tuple[int, int]]) -> float:
    """The same share of groups of hits (missed, flown), each by one vehicle, by Korn and Graubard.

    Hits by one vehicle are no independent ones. They count as fewer, by how much more vehicles differ than independent
    hits would; where none is missed, as one a vehicle.
    """
    flown, missed = sum(of for _, of in groups), sum(events for events, _ in groups)
    if missed in (0, flown) or len(groups) < 2:
        return at_most(len(groups) if missed else 0, len(groups))
    share = missed / flown
    squares = sum((events - share * of) ** 2 for events, of in groups)
    variance = squares / flown**2 * len(groups) / (len(groups) - 1)
    effective = min(flown, share * (1.0 - share) / variance)
    return at_most(share * effective, effective)


def lead(results: Mapping[int, Json], hits: Sequence[Judged]) -> Iterator[str]:
    everyone, missed = results.values(), sum(one.late_ms is None for one in hits)
    again = [one for one in everyone if "agrees" in one]
    agree, lost = sum(one["agrees"] for one in again), sum(not one["kept"] for one in again)
    yield f"{len(everyone):,} approaches with {len(hits):,} hits, {HITS_AN_APPROACH} at most by a vehicle. {missed:,}"
    yield f"hits were missed. Each approach begins in flight. Its hits begin {FREE_S} s later, several from the same"
    yield "moment, and end when the guard tells of them. All bytes go both ways."
    yield ""
    yield f"One hit of each approach was flown again from the beginning, {len(again):,} in all. Its obstacle stood"
    yield f"there from the first, and nothing was put back. {agree:,} have the same verdict: the touch, its speed and"
    yield f"the sample that showed it are the same to the last digit. The guard later took back {lost} of them."
    yield ""
    false, hours = sum(one["false"] for one in everyone), sum(one["watched_s"] for one in everyone) / 3600.0
    most = float(chi2.ppf(CONFIDENCE, 2 * (false + 1))) / 2.0 / hours
    yield f"False alarms: {false}, in {hours:.2f} h of free flight from then on; at most {most:.2f} an hour."
    yield ""


def cells(hits: Sequence[Judged]) -> Iterator[str]:
    yield from head("airframe, IMU", "speed, m/s", *_COLUMNS)
    open_cells = []
    for airframe in AIRFRAMES:
        for imu_hz in IMU_HZ:
            name = f"{airframe}, {imu_hz} Hz"
            of_cell = [one for one in hits if (one.case.hit.airframe, one.case.imu_hz) == (airframe, imu_hz)]
            for low, high in BANDS_M_S:
                row, most = _cell([one for one in of_cell if low <= one.closing_m_s < high])
                yield f"| {name} | {low:g} to {high:g} | {row} |"
                open_cells += [] if most < BOUND else [f"{name}, {low:g} to {high:g} m/s"]
    noticed = [one for one in hits if one.is_noticed]
    yield f"| all | from {BANDS_M_S[1][0]:g} on | {_cell(noticed)[0]} |"
    yield ""
    yield f"At most: with a confidence of {100 * CONFIDENCE:g} %, by Korn and Graubard, which is Clopper and Pearson's"
    yield "for hits of which several are one vehicle's. Where none is missed, each vehicle counts once. Found after:"
    yield "median."
    yield ""
    yield f"Not shown to miss fewer than {100 * BOUND:g} %: {'; '.join(open_cells) or 'none'}."
    yield ""
    yield from head("what was met, from 0.5 m/s on", *_COLUMNS)
    for met in APPROACHES:
        yield f"| {met} | {_cell([one for one in noticed if approach_of(one.number) == met])[0]} |"
    yield ""


def _cell(hits: Sequence[Judged]) -> tuple[str, float]:
    """The rest of its row, and the share that is not exceeded."""
    groups: dict[int, tuple[int, int]] = {}
    for one in hits:
        missed, flown = groups.get(one.case.hit.seed, (0, 0))
        groups[one.case.hit.seed] = (missed + (one.late_ms is None), flown + 1)
    missed, most = sum(one.late_ms is None for one in hits), at_most_of_groups(list(groups.values()))
    late_ms = [one.late_ms for one in hits if one.late_ms is not None]
    share = missed / len(hits) if hits else math.nan
    texts = [f"{len(hits):,}", f"{len(groups):,}", f"{missed:,}", f"{per_cent(share, 3)} %", f"{per_cent(most, 3)} %"]
    texts.append(f"{sum(some > 0 for some, _ in groups.values()):,}")
    return " | ".join([*texts, *(f"{text_of(percentile(late_ms, part), 1)} ms" for part in (50, 95))]), most


def seeds(results: Mapping[int, Json], cases: Sequence[FlownHit], hits: Sequence[Judged]) -> Iterator[str]:
    """Of hits and approaches to look at again."""
    missed = [one for one in hits if one.is_noticed and one.late_ms is None]
    of = {at: str(cases[at].hit.seed) for at in results}
    for what, named in (
        ("Missed at 0.5 m/s and more, by seed/number", [f"{one.case.hit.seed}/{one.number}" for one in missed]),
        ("With a false alarm, by seed", [of[at] for at, one in results.items() if one["false"]]),
        ("With another verdict when flown again, by seed", [of[at] for at, one in results.items() if not _agrees(one)]),
    ):
        if named:
            yield f"- {what}: {', '.join(named[:NAMED_SEEDS])}{', ...' if len(named) > NAMED_SEEDS else ''}."
    yield ""


def _agrees(one: Json) -> bool:
    return bool(one.get("agrees", True))


def cost(results: Mapping[int, Json]) -> Iterator[str]:
    flown = [one for one in results.values() if one["hits"]]
    yield f"{WANTED:,} hits an hour on two cores are {TWO_CORES_MS / WANTED:.1f} ms a hit. A hit's time contains its"
    yield "share of the approach, and not what was flown again. Each process also times pymavlink's parse of a"
    yield "HIGHRES_IMU."
    yield ""
    hit_ms = [1e3 * one["cost"]["processor_s"] / len(one["hits"]) for one in flown]
    yield from costs("a hit", hit_ms, 1.0, [one["cost"]["parse_us"] for one in flown])
