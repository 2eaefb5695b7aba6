"""Virtual time: a vehicle and whoever flies or guards it go on by intervals, until something is so."""

import math
from abc import ABC, abstractmethod
from collections.abc import Callable
from typing import Any

from companion.companion import Companion, StepResult
from companion.guard.guard import Guard
from companion.report import Event
from rebound_cli.simulation.lockstep import EPOCH_US as EPOCH_US
from sim_vehicle.mavlink.streams.stream_rates import LinkKind
from sim_vehicle.vehicle import SimulatedVehicle

INTERVAL_US = 4_000


class VirtualTime(ABC):
    """Goes on by intervals of the vehicle's, until something is so; and what has been told meanwhile."""

    events: list[Event]

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


class Stepped(VirtualTime):
    """A simulated vehicle and programs, each on a link of its own, without a log: all bytes both ways."""

    def __init__(self, vehicle: SimulatedVehicle, *programs: Companion | Guard) -> None:
        self.vehicle, self.programs = vehicle, programs
        self.links = [vehicle.add_link(LinkKind.ONBOARD) for _ in programs]
        self.events = []

    @property
    def time_s(self) -> float:
        """Of the vehicle, since it was switched on."""
        return 1e-6 * self.vehicle.time_boot_us

    @property
    def state(self) -> str:
        return str(self.programs[0].status().state)

    def step(self) -> list[StepResult]:
        """One interval; what each program made of it, where there was something to hear or to send."""
        self.vehicle.advance()
        now_us, results = EPOCH_US + self.vehicle.time_boot_us, []
        for program, link in zip(self.programs, self.links, strict=True):
            heard = b"".join(link.take())
            if heard or now_us >= program.next_deadline_us():
                result = program.step(heard, now_us)
                link.push(b"".join(result.sent_frames))
                self.events += result.events
                results.append(result)
        return results

    def step_alone(self) -> bytes:
        """One interval in which nobody answers; what the vehicle said to the first."""
        self.vehicle.advance()
        return b"".join(self.links[0].take())
