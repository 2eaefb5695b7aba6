"""What each part of an interval costs.

The same flight is flown again and again: its intervals are the same each time, so that of every part of every interval
the least time of all flights is taken. What the machine does besides falls out.
"""

from collections.abc import Callable
from dataclasses import dataclass
from time import perf_counter_ns
from typing import Any

import numpy as np
import numpy.typing as npt

from bench.studies.speed.flight import fly
from bench.studies.speed.parts import LOG, PARTS, Function, Part, wrapped

Ints = npt.NDArray[np.int64]


@dataclass(frozen=True, slots=True)
class Budget:
    """Microseconds of an interval."""

    mean_us: dict[str, float]
    """By part, without the parts that it calls; the timers, some 0.1 us each, count to whoever calls."""
    intervals: int

    @property
    def total_us(self) -> float:
        return sum(self.mean_us.values())


def measured_budget(flights: int, run: Callable[[], object] = fly, last: str = LOG) -> Budget:
    """Of what is flown, so many times. With the ``last`` part an interval ends."""
    least = 1e-3 * np.min([_timed_flight(run, last) for _ in range(flights)], axis=0)
    names = [part.name for part in PARTS]
    spent = dict(zip(names, map(float, least.mean(axis=0)), strict=True))
    mean = {name: us - sum(spent[part.name] for part in PARTS if part.caller == name) for name, us in spent.items()}
    return Budget(mean, len(least))


def _timed_flight(run: Callable[[], object], last: str) -> Ints:
    """Nanoseconds of each part in each interval, with the parts that it calls (intervals, parts)."""
    rows: list[tuple[int, ...]] = []
    spent = {part.name: 0 for part in PARTS}

    def timed(part: Part, function: Function) -> Function:
        name, is_last = part.name, part.name == last

        def call(*arguments: Any, **named: Any) -> Any:
            begun = perf_counter_ns()
            result = function(*arguments, **named)
            spent[name] += perf_counter_ns() - begun
            if is_last:
                rows.append(tuple(spent.values()))
                spent.update(dict.fromkeys(spent, 0))
            return result

        return call

    with wrapped(timed):
        run()
    return np.array(rows)
