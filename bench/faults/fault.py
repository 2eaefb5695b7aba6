"""A fault: what is injected and what is expected."""

import random
from collections.abc import Callable
from dataclasses import dataclass
from typing import Literal

from bench.faults.air import Injector

Group = Literal[
    "link", "sensors", "clock", "process", "disk and console", "estimator", "wind and body", "hostile packets",
    "hostile files", "pilot",
]  # fmt: skip
COMPLETED, HANDED_OVER, FAILED, KILLED = "completed", "aborted", "failed", "killed"
_WORDS = {
    COMPLETED: "lands as the mission says",
    HANDED_OVER: "ends, vehicle handed over",
    FAILED: "fault told, vehicle handed over",
    KILLED: "PX4's own failsafe lands it",
}


@dataclass(frozen=True, slots=True)
class Expected:
    """Beside what holds for every row: no loss of vehicle, log or authority, no setpoint outside the envelope."""

    outcomes: tuple[str, ...] = (COMPLETED,)
    """How a flight may end, by the report."""
    finds: bool = True
    """The hit is found."""
    has_wall: bool = True
    """Without one where nobody could see it: a hit that nobody answers shows PX4 and the airframe, not this program."""
    false_hits: int = 0
    """Recoveries from nothing that a flight may count as a collision."""
    blinds: bool = False
    """While it acts nothing shows a hit. What the wall does to a vehicle that meets it then shows PX4 and the airframe,
    not this program; the hit may be told when the sensor is back, as late as any other after its touch."""

    def text(self) -> str:
        parts = [" or ".join(_WORDS[outcome] for outcome in self.outcomes)]
        parts += ["the hit found"] if self.finds else [] if self.has_wall else ["(no wall in the way)"]
        parts += [] if self.false_hits else ["nothing else taken for one"]
        parts += ["who meets the wall meanwhile is PX4's and the airframe's"] if self.blinds else []
        return "; ".join(parts)


@dataclass(frozen=True, slots=True)
class Fault:
    """A row of the table. `inject` makes the fault anew for every flight, as its chance has it."""

    name: str
    group: Group
    injected: str
    inject: Callable[[random.Random], Injector]
    expected: Expected = Expected()
    from_the_start: bool = False
    """Whether the fault acts before the first item, so that every flight has to be flown from its take-off."""
