"""A pilot who takes position mode, whatever happens meanwhile: nothing of the companion's comes between."""

import random
from collections.abc import Callable, Sequence
from dataclasses import dataclass

from bench.fly.air import HANDED_OVER, Air, Expected, Fault, Injector, When

_TAKEN = Expected((HANDED_OVER,), finds=False)


@dataclass
class Taken(Injector):
    """The pilot takes over; before, the process may stall or the link be cut, so that it goes unheard."""

    when: When
    stall_s: float = 0.0
    cut_s: float = 0.0
    is_begun: bool = False
    cut_until_s: float = 0.0

    def begin(self, air: Air) -> None:
        air.add_pilot()

    def each(self, air: Air) -> None:
        if self.is_begun or not self.when.is_on(air):
            return
        self.is_begun = True
        self.cut_until_s = air.now_s + self.cut_s
        air.stall_s = self.stall_s
        air.take_over()

    # The companion's link alone is cut: the pilot has a radio of its own.
    def to_companion(self, air: Air, frames: list[bytes]) -> Sequence[bytes]:
        return [] if air.now_s < self.cut_until_s else frames

    def to_vehicle(self, air: Air, frames: list[bytes]) -> Sequence[bytes]:
        return [] if air.now_s < self.cut_until_s else frames


def _taken(
    state: str, within_s: float, from_s: float = 0.3, stall_s: float = 0.0, cut_s: float = 0.0
) -> Callable[[random.Random], Injector]:
    return lambda chance: Taken(When(state, chance.uniform(from_s, from_s + within_s)), stall_s, cut_s)


FAULTS = (
    Fault(
        "takes over in take-off",
        "POSCTL at a random instant of the climb",
        _taken("takeoff", 2.3, from_s=1.7),
        _TAKEN,
        from_the_start=True,
    ),
    Fault(
        "takes over in the cruise", "POSCTL at a random instant before or at the hit", _taken("mission", 1.0), _TAKEN
    ),
    Fault("takes over in a recovery", "POSCTL within 0.6 s of the hit", _taken("recovering", 0.6), _TAKEN),
    Fault("takes over in a landing", "POSCTL within 0.9 s of its begin", _taken("landing", 0.6), _TAKEN),
    Fault(
        "takes over in a stall of 1.2 s",
        "the process gets no time for 1.2 s, and POSCTL at its begin",
        _taken("mission", 1.0, stall_s=1.2),
        _TAKEN,
    ),
    Fault("takes over in a stall of 3 s", "the same for 3 s", _taken("mission", 1.0, stall_s=3.0), _TAKEN),
    Fault(
        "takes over in a cut of 3 s",
        "the link is cut for 3 s, and POSCTL at its begin",
        _taken("mission", 1.0, cut_s=3.0),
        _TAKEN,
    ),
    Fault(
        "takes over in a cut recovery",
        "the link is cut for 1 s within 0.6 s of the hit, and POSCTL",
        _taken("recovering", 0.6, cut_s=1.0),
        _TAKEN,
    ),
)
