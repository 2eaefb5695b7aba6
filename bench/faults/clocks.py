"""Clocks that jump: the companion's, and the vehicle's."""

import random
from collections.abc import Callable
from dataclasses import dataclass

from bench.faults.injectors import Simulated, flying
from bench.fly.air import COMPLETED, FAILED, HANDED_OVER, Air, Expected, Fault, Injector, When
from sim_vehicle.bench.faults import clock_jump

_MAY_END = Expected((COMPLETED, HANDED_OVER, FAILED), finds=False)
# 7 s before 32-bit milliseconds begin anew, less what the vehicle's clock shows by then: the flight passes the end.
_WRAP_S = 4_294_960.0 - 3.0


@dataclass
class Jumped(Injector):
    """The clock that the companion reads is ahead or behind by so much, from a moment on."""

    when: When
    jump_s: float

    def clock_us(self, air: Air, now_us: int) -> int:
        return now_us + round(self.jump_s * 1e6) if self.when.is_on(air) else now_us


@dataclass
class Anew(Injector):
    """The vehicle's clock begins at zero, as after a reboot that nobody saw."""

    when: When
    is_injected: bool = False

    def each(self, air: Air) -> None:
        if not self.is_injected and self.when.is_on(air):
            self.is_injected = True
            air.inject(clock_jump(-air.now_s))


def _jumped(jump_s: float) -> Callable[[random.Random], Injector]:
    return lambda chance: Jumped(When.flying(chance), jump_s)


FAULTS = (
    Fault(
        "clock 5 s ahead", "the clock that the loop reads jumps by 5 s (a suspended computer)", _jumped(5.0), _MAY_END
    ),
    Fault("clock a day ahead", "the same by a day (the product's own clock is monotonic)", _jumped(86_400.0), _MAY_END),
    Fault(
        "vehicle's clock anew",
        "every stamp of the vehicle begins at zero (a reboot)",
        lambda c: Anew(When.flying(c)),
        _MAY_END,
    ),
    Fault(
        "vehicle's clock ahead", "every stamp of the vehicle jumps ahead by 30 s", flying(clock_jump(30.0)), _MAY_END
    ),
    Fault(
        "32-bit milliseconds end",
        "time_boot_ms begins anew in the flight",
        lambda c: Simulated(clock_jump(_WRAP_S), When("connect")),
        from_the_start=True,
    ),
)
