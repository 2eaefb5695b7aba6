"""What each part of an interval costs: time, and calls of Python's and C's functions.

The same flight is flown again and again, and of every part the least time is taken: what the machine does besides falls
out. The number of calls is the same on any machine, busy or not.
"""

import importlib
import sys
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from time import perf_counter_ns
from types import FrameType
from typing import Any

Function = Callable[..., Any]


@dataclass(frozen=True, slots=True)
class Part:
    """What a function does itself, without the other parts that it calls."""

    name: str
    place: str
    """As "module:name" or "module:Class.name"."""
    caller: str | None = None
    """The name of the part that calls it."""


KERNEL, PLANT, VEHICLE, COMPANION, LOG = "plant: kernel", "plant: the rest", "vehicle: autopilot", "companion", "log"
PARTS = (
    Part(KERNEL, "sim_vehicle.plant.plant:advance_interval", PLANT),
    Part(PLANT, "sim_vehicle.plant.plant:Plant._advance", VEHICLE),
    Part(VEHICLE, "sim_vehicle.vehicle:SimulatedVehicle.advance"),
    Part("vehicle: MAVLink in", "sim_vehicle.mavlink.link:Link.receive", VEHICLE),
    Part("vehicle: MAVLink out", "sim_vehicle.mavlink.link:Link.update", VEHICLE),
    Part("companion: MAVLink in", "companion.mavlink.decode:Decoder.feed", COMPANION),
    Part(COMPANION, "companion.companion:Stepped.step"),
    Part("companion: MAVLink out", "companion.mavlink.encode:Encoder.all_packets", COMPANION),
    # The last of an interval of a flight that is logged.
    Part(LOG, "rebound_cli.results.run_folder:FlightRecorder.record"),
)


@contextmanager
def wrapped(wrap: Callable[[Part, Function], Function]) -> Iterator[None]:
    """Each part's function replaced, for as long as this lasts, by what is made of it."""
    replaced = []
    for part in PARTS:
        module, _, names = part.place.partition(":")
        owner: Any = importlib.import_module(module)
        *classes, name = names.split(".")
        for class_name in classes:
            owner = getattr(owner, class_name)
        replaced.append((owner, name, vars(owner).get(name)))
        setattr(owner, name, wrap(part, getattr(owner, name)))
    try:
        yield
    finally:
        for owner, name, before in replaced:
            if before is None:
                delattr(owner, name)  # it was inherited
            else:
                setattr(owner, name, before)


@dataclass(frozen=True, slots=True)
class Cost:
    """Of one flight, by part: the time with the parts that it calls, and the calls that it makes itself."""

    spent_ns: dict[str, int]
    calls: dict[str, int]
    intervals: int


def cost_of(fly: Callable[[], object], counts_calls: bool = False) -> Cost:
    """Where calls are counted the time says nothing."""
    spent_ns, calls = ({part.name: 0 for part in PARTS} for _ in range(2))
    intervals, within, wrappers = 0, [""], set()

    def count(frame: FrameType, event: str, argument: Any) -> None:
        if event in ("call", "c_call") and within[0] and frame.f_code not in wrappers:
            calls[within[0]] += 1

    def watched(part: Part, function: Function) -> Function:
        name = part.name

        def run(*arguments: Any, **named: Any) -> Any:
            nonlocal intervals
            outside, within[0] = within[0], name
            begun = perf_counter_ns()
            try:
                return function(*arguments, **named)
            finally:
                spent_ns[name] += perf_counter_ns() - begun
                within[0] = outside
                intervals += name == LOG

        wrappers.add(run.__code__)
        return run

    with wrapped(watched):
        sys.setprofile(count if counts_calls else None)
        try:
            fly()
        finally:
            sys.setprofile(None)
    return Cost(spent_ns, calls, intervals)


def mean_us(fly: Callable[[], object], flights: int) -> dict[str, float]:
    """Of an interval, by part, without the parts that it calls: the least of so many flights.

    The timers, some 0.1 us each, count to whoever calls.
    """
    flown = [cost_of(fly) for _ in range(flights)]
    least = {part.name: min(1e-3 * cost.spent_ns[part.name] / cost.intervals for cost in flown) for part in PARTS}
    return {name: us - sum(least[part.name] for part in PARTS if part.caller == name) for name, us in least.items()}


def calls_an_interval(fly: Callable[[], object]) -> dict[str, float]:
    """Mean over all intervals of a flight, by part: what it calls itself, without the other parts."""
    cost = cost_of(fly, counts_calls=True)
    return {name: round(calls / cost.intervals, 2) for name, calls in cost.calls.items()}
