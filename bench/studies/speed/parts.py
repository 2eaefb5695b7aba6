"""What each part of an interval costs: time, and calls of Python's and C's functions.

The same flight is flown again and again: its intervals are the same each time, so that of every part of every interval
the least time of all flights is taken. What the machine does besides falls out. The number of calls is the same on any
machine, busy or not: `calls.json` has what it is held to, and `python -m bench speed --calls` makes that anew.
"""

import importlib
import json
import sys
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from time import perf_counter_ns
from types import FrameType
from typing import Any

import numpy as np
import numpy.typing as npt

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


def measured_budget(fly: Callable[[], object], flights: int) -> Budget:
    """Of what is flown, so many times."""
    least = 1e-3 * np.min([_timed_flight(fly) for _ in range(flights)], axis=0)
    names = [part.name for part in PARTS]
    spent = dict(zip(names, map(float, least.mean(axis=0)), strict=True))
    mean = {name: us - sum(spent[part.name] for part in PARTS if part.caller == name) for name, us in spent.items()}
    return Budget(mean, len(least))


def _timed_flight(fly: Callable[[], object]) -> Ints:
    """Nanoseconds of each part in each interval, with the parts that it calls (intervals, parts)."""
    rows: list[tuple[int, ...]] = []
    spent = {part.name: 0 for part in PARTS}

    def timed(part: Part, function: Function) -> Function:
        name, is_last = part.name, part.name == LOG

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
        fly()
    return np.array(rows)


HELD_TO = Path(__file__).parent / "calls.json"


def calls_an_interval(fly: Callable[[], object]) -> dict[str, float]:
    """Mean over all intervals of a flight, by part: what it calls itself, without the other parts."""
    counted, intervals, within = {part.name: 0 for part in PARTS}, 0, [""]
    observers = set()

    def count(frame: FrameType, event: str, argument: Any) -> None:
        if event in ("call", "c_call") and within[0] and frame.f_code not in observers:
            counted[within[0]] += 1

    def observed(part: Part, function: Function) -> Function:
        name = part.name

        def run(*arguments: Any, **named: Any) -> Any:
            nonlocal intervals
            outside, within[0] = within[0], name
            try:
                return function(*arguments, **named)
            finally:
                within[0] = outside
                intervals += name == LOG

        observers.add(run.__code__)
        return run

    with wrapped(observed):
        sys.setprofile(count)
        try:
            fly()
        finally:
            sys.setprofile(None)
    return {name: round(calls / intervals, 2) for name, calls in counted.items()}


def held_to() -> dict[str, float]:
    found: dict[str, float] = json.loads(HELD_TO.read_text(encoding="utf-8"))
    return found


def hold_to(calls: dict[str, float]) -> None:
    HELD_TO.write_text(json.dumps(calls, indent=2) + "\n", encoding="utf-8")
