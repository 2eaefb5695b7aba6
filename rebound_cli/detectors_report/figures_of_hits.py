"""Numbers out of the results of many hits."""

import math
from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

Entry = dict[str, Any]


@dataclass(frozen=True, slots=True)
class Scored:
    """One hit as one detector saw it at one rate: the case, the hit's own facts, the detector's entry."""

    case: Any
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


def scored(
    cases: Sequence[Any], results: dict[int, Entry], detector: str, rate: int, which: Callable[[Any, Entry], bool]
) -> list[Scored]:
    """The hits that `which` (case, hit) picks, in the order of the cases."""
    picked = []
    for number, hit in results.items():
        if which(cases[number], hit):
            at_rate = hit["rates"][str(rate)]
            picked.append(Scored(cases[number], hit, at_rate["possible_ms"], at_rate["detectors"][detector]))
    return picked


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


def latencies_ms(hits: Sequence[Scored]) -> list[float]:
    """Of the hits found whose force a received sample showed."""
    return [hit.entry["latency_ms"] for hit in hits if hit.is_found and not hit.fell_between]


def late_share(hits: Sequence[Scored], samples: int) -> float:
    """Of the hits that a received sample showed: share found later than `samples` after the first possible one."""
    seen = [hit for hit in hits if not hit.fell_between and hit.is_found]
    return share(hit.entry["samples_late"] > samples for hit in seen)
