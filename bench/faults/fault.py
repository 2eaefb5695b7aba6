"""A fault: what is injected and what is expected; and when in a flight something begins."""

import io
import random
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Literal

from rebound_cli.console import Console

if TYPE_CHECKING:
    from bench.faults.air import Air
    from rebound_cli.background import Background

Group = Literal[
    "link", "sensors", "clock", "process", "disk and console", "estimator", "wind and body", "hostile packets",
    "hostile files", "pilot", "load",
]  # fmt: skip
COMPLETED, HANDED_OVER, FAILED, KILLED = "completed", "aborted", "failed", "killed"
_WORDS = {
    COMPLETED: "lands as the mission says",
    HANDED_OVER: "ends, vehicle handed over",
    FAILED: "fault told, vehicle handed over",
    KILLED: "PX4's own failsafe lands it",
}


class Injector:
    """Does nothing; each fault overrides where it acts."""

    def begin(self, air: "Air") -> None:
        """Before the first interval."""

    def end(self) -> None:
        """After the last one."""

    def each(self, air: "Air") -> None:
        """Before every interval of the vehicle."""

    def to_companion(self, air: "Air", frames: list[bytes]) -> Sequence[bytes]:
        return frames

    def to_vehicle(self, air: "Air", frames: list[bytes]) -> Sequence[bytes]:
        return frames

    def clock_us(self, air: "Air", now_us: int) -> int:
        """What the companion's clock shows."""
        return now_us

    def console(self) -> Console:
        """Where the timeline is printed."""
        return Console(io.StringIO())

    def writer(self) -> "Background | None":
        """Who writes the log; None: it is written at once."""
        return None


@dataclass(frozen=True, slots=True)
class When:
    """So long after the companion was first in a state, and for how long."""

    state: str
    after_s: float = 0.0
    for_s: float = 1e9

    def is_on(self, air: "Air") -> bool:
        since_s = air.since.get(self.state)
        return since_s is not None and 0.0 <= air.now_s - since_s - self.after_s < self.for_s

    @classmethod
    def flying(cls, chance: random.Random, for_s: float = 1e9) -> "When":
        """In the cruise towards the wall, or at the hit: at a random instant of the first 1.5 s of the item."""
        return cls("mission", chance.uniform(0.0, 1.5), for_s)

    @classmethod
    def recovering(cls, chance: random.Random, for_s: float = 1e9) -> "When":
        """At a random instant of the first 0.6 s after the hit."""
        return cls("recovering", chance.uniform(0.0, 0.6), for_s)


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
    again_m_s: float | None = None
    """No second contact with the wall harder than this."""

    def text(self) -> str:
        parts = [" or ".join(_WORDS[outcome] for outcome in self.outcomes)]
        parts += ["the hit found"] if self.finds else [] if self.has_wall else ["(no wall in the way)"]
        parts += [] if self.false_hits else ["nothing else taken for one"]
        parts += [] if self.again_m_s is None else [f"no second contact above {self.again_m_s:g} m/s"]
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
