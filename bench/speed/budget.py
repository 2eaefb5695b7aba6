"""What each part of an interval costs.

The same flight is flown again and again: its intervals are the same each time, so that of every part of every interval
the least time of all flights is taken. What the machine does besides falls out.
"""

from collections.abc import Callable
from dataclasses import dataclass
from time import perf_counter_ns, thread_time_ns
from typing import Any

import numpy as np
import numpy.typing as npt

from bench.speed.flight import fly
from bench.speed.parts import KERNEL, LOG, PARTS, Function, Part, wrapped

Ints = npt.NDArray[np.int64]


@dataclass(frozen=True, slots=True)
class Budget:
    """Microseconds of an interval."""

    mean_us: dict[str, float]
    """By part, without the parts that it calls; the timers, some 0.1 us each, count to whoever calls."""
    least_kernel_us: float
    """Of all intervals: the vehicle in the air, near nothing."""

    @property
    def total_us(self) -> float:
        return sum(self.mean_us.values())


def measured_budget(flights: int) -> Budget:
    least = 1e-3 * np.min([_timed_flight() for _ in range(flights)], axis=0)
    spent = dict(zip((part.name for part in PARTS), map(float, least.mean(axis=0)), strict=True))
    return Budget(_own(spent), float(least[:, [part.name for part in PARTS].index(KERNEL)].min()))


def spent_ms(run: Callable[[], object]) -> dict[str, float]:
    """Of the processor, by part without the parts that it calls, in a run of any kind; the timers count, too."""
    spent = _timed(run, lambda spent: None, thread_time_ns)
    return _own({name: 1e-6 * ns for name, ns in spent.items()})


def _own(spent: dict[str, float]) -> dict[str, float]:
    return {name: one - sum(spent[part.name] for part in PARTS if part.caller == name) for name, one in spent.items()}


def _timed_flight() -> Ints:
    """Nanoseconds of each part in each interval, with the parts that it calls (intervals, parts)."""
    rows: list[tuple[int, ...]] = []

    def end_interval(spent: dict[str, int]) -> None:
        rows.append(tuple(spent.values()))
        spent.update(dict.fromkeys(spent, 0))

    _timed(fly, end_interval)
    return np.array(rows)


def _timed(
    run: Callable[[], object],
    when_logged: Callable[[dict[str, int]], None],
    clock_ns: Callable[[], int] = perf_counter_ns,
) -> dict[str, int]:
    """Nanoseconds of each part, with the parts that it calls; `when_logged` is told after each interval's log."""
    spent = {part.name: 0 for part in PARTS}

    def timed(part: Part, function: Function) -> Function:
        name, is_last = part.name, part.name == LOG

        def call(*arguments: Any, **named: Any) -> Any:
            begun = clock_ns()
            result = function(*arguments, **named)
            spent[name] += clock_ns() - begun
            if is_last:
                when_logged(spent)
            return result

        return call

    with wrapped(timed):
        run()
    return spent
