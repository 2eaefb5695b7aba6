"""Virtual time: flights that go on by intervals of the vehicle's, until something is so."""

import math
from abc import ABC, abstractmethod
from collections.abc import Callable
from typing import Any

from companion.report import Event

INTERVAL_US = 4_000
EPOCH_US = 1_600_000_000_000_000


class VirtualTime(ABC):
    """Goes on by intervals of the vehicle's, until something is so; and what has been told meanwhile."""

    vehicle: Any  # the simulated one, or a test's, which needs no numba
    events: list[Event]

    @property
    def time_s(self) -> float:
        """Of the vehicle, since it was switched on."""
        return float(1e-6 * self.vehicle.time_boot_us)

    @property
    @abstractmethod
    def state(self) -> Any: ...

    @abstractmethod
    def step(self) -> Any:
        """One interval: what was sent in the last one arrives, and is answered."""

    def run_until(self, condition: Callable[[], bool], limit_s: float = 60.0) -> float:
        """Step until the condition holds; how long it took, in seconds. Fails when it does not within `limit_s`."""
        for count in range(math.ceil(limit_s * 1e6 / INTERVAL_US)):
            if condition():
                return count * INTERVAL_US * 1e-6
            self.step()
        raise AssertionError(f"not within {limit_s} s; state {self.state}, events: {self.texts()}")

    def run_for(self, seconds: float) -> None:
        for _ in range(round(seconds * 1e6 / INTERVAL_US)):
            self.step()

    def run_to(self, state: Any, limit_s: float = 60.0) -> float:
        return self.run_until(lambda: self.state == state, limit_s)

    def texts(self) -> list[str]:
        return [f"{event.kind}: {event.text}" for event in self.events]
