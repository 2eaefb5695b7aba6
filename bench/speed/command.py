"""`bench speed`: how many times real time, and the budget of an interval; or the calls, or the latency, alone."""

import os
from argparse import Namespace
from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import numpy as np

from bench.marked import checked_text, write_part
from bench.speed.budget import Budget, measured_budget
from bench.speed.calls import calls_an_interval, hold_to
from bench.speed.flight import fly
from bench.speed.latency import compared, table
from bench.speed.parse import median_us, parse_us
from bench.speed.parts import KERNEL, PARTS, PLANT
from bench.speed.px4 import lockstep_table
from bench.stamps import FLOWN, stamp_text

PART, LATENCY_PART = "speed", "latency"
# The standard normal values that an interval draws: six for each of 32 raw samples, nine for the estimate.
_DRAWS = 201
_REPEATS = 5000


@dataclass(frozen=True, slots=True)
class FlownSpeed:
    """One flight, and the parser's time around it."""

    factor: float
    processor_factor: float
    """Of the time that this process had of a processor: on a busy machine that is less than the clock's."""
    parse_us: float

    @property
    def machine_free(self) -> float:
        """Times real time, times the microseconds of a parse: the same on a fast machine and on a slow one."""
        return self.factor * self.parse_us


def run_speed(options: Namespace) -> int:
    """0 when it is measured, whatever it says."""
    if options.calls:
        fly()  # what is imported or compiled at first counts for nothing
        calls = calls_an_interval()
        hold_to(calls)
        print(f"{sum(calls.values()):.1f} calls an interval: {calls}")
        return 0
    if options.latency:
        return _run_latency(options)
    if options.px4:
        print("\n".join(lockstep_table(options.px4, options.sensor_rate)))
        return 0
    checked_text(options.out, PART)
    os.sched_setaffinity(0, {min(os.sched_getaffinity(0))})
    fly()
    flights = [_flown() for _ in range(options.flights)]
    text = "\n".join([*_lines(flights), *_budget(measured_budget(options.flights), calls_an_interval()), ""])
    write_part(options.out, PART, text)
    print(f"{text}\nWritten to {options.out}.")
    return 0


def _run_latency(options: Namespace) -> int:
    checked_text(options.out, LATENCY_PART)
    stamp = stamp_text(f"python -m bench speed --latency {options.latency}", (*FLOWN, "rebound_cli"))
    text = "\n".join([f"{stamp}:", "", *table(compared(options.latency))])
    write_part(options.out, LATENCY_PART, text)
    print(f"{text}\nWritten to {options.out}.")
    return 0


def _flown() -> FlownSpeed:
    before_us, factors = parse_us(), fly()
    return FlownSpeed(*factors, (before_us + parse_us()) / 2)


def _lines(flights: Sequence[FlownSpeed]) -> Iterator[str]:
    ordered = sorted(flights, key=lambda flown: flown.machine_free)
    yield f"{stamp_text('python -m bench speed', (*FLOWN, 'rebound_cli'))}:"
    yield f"{len(flights)} flights of `missions/wall.yaml` in one run on one core, best and worst."
    yield ""
    yield "| | best | worst |"
    yield "|---|---|---|"
    for name, digits, values in (
        ("times real time", 1, [flown.factor for flown in ordered]),
        ("the same by the processor's time", 1, [flown.processor_factor for flown in ordered]),
        ("a parse of HIGHRES_IMU by pymavlink with fastcrc, µs", 2, [flown.parse_us for flown in ordered]),
        ("their product", 0, [flown.machine_free for flown in ordered]),
    ):
        yield f"| {name} | {values[-1]:.{digits}f} | {values[0]:.{digits}f} |"
    yield ""


def _budget(budget: Budget, calls: dict[str, float]) -> Iterator[str]:
    """The parts, and what they cannot cost less than: as many calls that do nothing, draws and the kernel apart."""
    call_us, draws_us = _empty_call_us(), _draws_us()
    yield "| part of an interval of 4 ms | µs | share | calls | not below, µs |"
    yield "|---|---|---|---|---|"
    for part in PARTS:
        name, us = part.name, budget.mean_us[part.name]
        floor_us = {KERNEL: budget.least_kernel_us, PLANT: draws_us}.get(name, calls[name] * call_us)
        yield f"| {name} | {us:.1f} | {us / budget.total_us:.0%} | {calls[name]:.0f} | {floor_us:.1f} |"
    yield f"| together | {budget.total_us:.1f} | 100% | {sum(calls.values()):.0f} | |"
    yield ""
    yield f"An empty call of a function takes {call_us:.3f} µs in this run, {_DRAWS} standard normal values"
    yield f"{draws_us:.1f} µs. The kernel's limit is the interval that took it least: in the air, near nothing."


def _empty_call_us() -> float:
    def nothing() -> None:
        pass

    hundred = 100

    def calls() -> None:
        for _ in range(hundred):
            nothing()

    return median_us(calls, _REPEATS) / hundred


def _draws_us() -> float:
    generator, values = np.random.default_rng(1), np.empty(_DRAWS)
    return median_us(lambda: generator.standard_normal(out=values), _REPEATS)
