"""The ways in which most faults act: by the simulated vehicle, on packets that pass, or with packets of their own."""

import math
import random
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from typing import Any

from bench.fly.air import Air, Injector, When
from bench.fly.packets import changed
from companion.mavlink.packet import message_id_of
from sim_vehicle.bench.faults import FaultRequest


@dataclass
class Simulated(Injector):
    """What the simulated vehicle, its sensors, its estimate or its link can do by themselves."""

    request: FaultRequest
    when: When
    is_injected: bool = False

    def each(self, air: Air) -> None:
        if not self.is_injected and self.when.is_on(air):
            self.is_injected = True
            air.inject(self.request, self.when.for_s if math.isfinite(self.when.for_s) else None)


@dataclass
class Rewritten(Injector):
    """Packets of some messages are changed on their way to the companion."""

    when: When
    numbers: Sequence[int]
    change: Callable[[Any, Air], None]

    def to_companion(self, air: Air, frames: list[bytes]) -> Sequence[bytes]:
        if not self.when.is_on(air):
            return frames
        return [
            changed(frame, lambda message: self.change(message, air)) if message_id_of(frame) in self.numbers else frame
            for frame in frames
        ]


@dataclass
class Forged(Injector):
    """Packets in the vehicle's name beside its own: the newest true one of its kind with some fields changed."""

    when: When
    number: int
    change: Callable[[Any, Air], None]
    times: int = 1
    every_s: float = 0.0
    latest: bytes | None = None
    _due_s: float = field(default=0.0)

    def to_companion(self, air: Air, frames: list[bytes]) -> Sequence[bytes]:
        for frame in frames:
            if message_id_of(frame) == self.number:
                self.latest = frame
        if self.latest is None or self.times == 0 or air.now_s < self._due_s or not self.when.is_on(air):
            return frames
        self.times -= 1
        self._due_s = air.now_s + self.every_s
        return [*frames, changed(self.latest, lambda message: self.change(message, air))]


def setting(**fields: Any) -> Callable[[Any, Air], None]:
    """A change that gives fields these values."""

    def change(message: Any, air: Air) -> None:
        for name, value in fields.items():
            setattr(message, name, value)

    return change


def adding(**fields: float) -> Callable[[Any, Air], None]:
    """A change that adds to fields."""

    def change(message: Any, air: Air) -> None:
        for name, value in fields.items():
            setattr(message, name, getattr(message, name) + value)

    return change


Inject = Callable[[random.Random], Injector]


def flying(request: FaultRequest, for_s: float = math.inf) -> Inject:
    """What the simulated vehicle can do by itself, from a random instant of the cruise on."""
    return lambda chance: Simulated(request, When.flying(chance, for_s))


def rewriting(numbers: Sequence[int], change: Callable[[Any, Air], None], for_s: float = math.inf) -> Inject:
    """The same for messages of these numbers."""
    return lambda chance: Rewritten(When.flying(chance, for_s), numbers, change)
