"""The worked-out missions, and which of their hits a table is about."""

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass

from bench.campaign.plan import Json
from bench.random_missions.generator import MissionCase
from bench.random_missions.judge import NOTICED_M_S

# The hits that the bars are about: 1 to 5 m/s; heights of vehicles that fly level past something upright.
HIT_SPEEDS_M_S = (1.0, 5.0)
LEVEL_M_S = 0.3
UPRIGHT = 0.7


@dataclass(frozen=True, slots=True)
class FlownCase:
    """A mission with its result."""

    case: MissionCase
    result: Json

    @property
    def is_good(self) -> bool:
        return not self.result["failures"]


@dataclass(frozen=True, slots=True)
class Missions:
    """All of a campaign, in the order of seeds."""

    cases: Sequence[MissionCase]
    results: Mapping[int, Json]

    def of(self, airframe: str, which: Callable[[Json], bool] = lambda _: True) -> list[FlownCase]:
        return [
            FlownCase(self.cases[number], result)
            for number, result in sorted(self.results.items())
            if self.cases[number].airframe == airframe and self.cases[number].feed_forward and which(result)
        ]

    def first_hits_compared(self, airframe: str) -> list[tuple[Json, Json]]:
        """The first hit without the feed-forward of the height, and the same with it; level ones."""
        with_it = {one.case.seed: one.result["hits"] for one in self.of(airframe)}
        pairs = [
            (result["hits"][0], with_it[self.cases[number].seed][0])
            for number, result in sorted(self.results.items())
            if self.cases[number].airframe == airframe
            and not self.cases[number].feed_forward
            and result["hits"]
            and with_it.get(self.cases[number].seed)
        ]
        return [(without, with_it) for without, with_it in pairs if len(level([without, with_it])) == 2]

    def hits(self, airframe: str, low_m_s: float, high_m_s: float) -> list[Json]:
        """First contacts by the speed against the obstacle."""
        return [
            hit for flown in self.of(airframe) for hit in flown.result["hits"] if low_m_s <= hit["speed_m_s"] < high_m_s
        ]

    def failed(self) -> Iterator[FlownCase]:
        for number, result in sorted(self.results.items()):
            if result["failures"] and self.cases[number].feed_forward:
                yield FlownCase(self.cases[number], result)


def answered(hits: Sequence[Json]) -> list[Json]:
    """Those that were noticed, so that there was a recovery."""
    return [hit for hit in hits if "past_m" in hit]


def square(hits: Sequence[Json]) -> list[Json]:
    """Those that go into the surface, not along it, as fast as a detector must notice."""
    return [hit for hit in hits if hit["closing_m_s"] >= NOTICED_M_S]


def level(hits: Sequence[Json]) -> list[Json]:
    """Answered hits on something upright in level flight that met nothing else: their height is the hit's doing."""
    return [
        hit
        for hit in answered(hits)
        if abs(hit["climbing_m_s"]) < LEVEL_M_S and abs(hit["steepness"]) < UPRIGHT and not hit["others"]
    ]
