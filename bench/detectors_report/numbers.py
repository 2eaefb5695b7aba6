"""Numbers out of the results of many cases."""

import math
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from bench.detectors.hits import HitCase

Entry = dict[str, Any]


@dataclass(frozen=True, slots=True)
class Scored:
    """One hit as one detector saw it at one rate: the case, the hit's own facts, the detector's entry."""

    case: HitCase
    hit: Entry
    possible_ms: float | None
    entry: Entry

    @property
    def is_found(self) -> bool:
        return "latency_ms" in self.entry

    @property
    def fell_between(self) -> bool:
        """No received sample's window held the contact's force above the noise floor."""
        return self.possible_ms is None


@dataclass(frozen=True, slots=True)
class Hits:
    """All worked-out hits of a campaign."""

    cases: Sequence[HitCase]
    results: Mapping[int, Entry]

    def scored(self, detector: str, rate: int, which: Callable[[HitCase], bool]) -> list[Scored]:
        """Those of the cases that `which` picks, as far as the detector was let loose on them, in their order."""
        picked = []
        for number, hit in self.results.items():
            case = self.cases[number]
            if detector in case.detectors and which(case):
                at_rate = hit["rates"][str(rate)]
                picked.append(Scored(case, hit, at_rate["possible_ms"], at_rate["detectors"][detector]))
        return picked

    @property
    def detectors(self) -> tuple[str, ...]:
        """Those that were tried on anything, in their usual order."""
        return max((case.detectors for case in self.cases), key=len)


def share(part: Iterable[bool]) -> float:
    """NaN of nothing."""
    values = list(part)
    return sum(values) / len(values) if values else math.nan


def detection_rate(hits: Sequence[Scored]) -> float:
    return share(hit.is_found for hit in hits)


def rms(values: Iterable[float]) -> float:
    numbers = np.array(list(values))
    return float(np.sqrt(np.mean(numbers**2))) if len(numbers) else math.nan


def percentile(values: Iterable[float], percent: float) -> float:
    numbers = list(values)
    return float(np.percentile(numbers, percent)) if numbers else math.nan


def shown(hits: Sequence[Scored]) -> list[Scored]:
    """Of the hits found, those whose force a received sample showed."""
    return [hit for hit in hits if hit.is_found and not hit.fell_between]


def latencies_ms(hits: Sequence[Scored]) -> list[float]:
    return [hit.entry["latency_ms"] for hit in hits if hit.is_found]


def late_share(hits: Sequence[Scored], samples: int) -> float:
    """Of the hits that a received sample showed: share found later than `samples` after the first possible one."""
    return share(hit.entry["samples_late"] > samples for hit in shown(hits))


def per_cent(value: float, digits: int = 1) -> str:
    """A share for people; 100 only if it is all."""
    if math.isnan(value):
        return "-"
    text = f"{100 * value:.{digits}f}"
    return text if value == 1.0 or float(text) < 100.0 else f"{100 - 10.0**-digits:.{digits}f}"


def text_of(value: float, digits: int = 1) -> str:
    return "-" if math.isnan(value) else f"{value:.{digits}f}"
