"""The ways in which faults act on sensors, estimates, clocks and the companion's process."""

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from typing import Any

from bench.fly.air import Air, Injector, When
from bench.fly.packets import changed
from companion.mavlink.packet import message_id_of
from sim_vehicle.bench.faults import FaultRequest, clock_jump

Change = Callable[[Any, Air], None]
"""Of a message that passes."""


@dataclass
class Once(Injector):
    """Something done once, when it is time."""

    when: When
    do: Callable[[Air], None]
    is_done: bool = False

    def each(self, air: Air) -> None:
        if not self.is_done and self.when.is_on(air):
            self.is_done = True
            self.do(air)


def simulated(request: FaultRequest, when: When) -> Injector:
    """What the simulated vehicle, its sensors, its estimate or its link can do by themselves."""
    for_s = when.for_s if math.isfinite(when.for_s) else None
    return Once(when, lambda air: air.inject(request, for_s))


def anew(when: When) -> Injector:
    """The vehicle's clock begins at zero, as after a reboot that nobody saw."""
    return Once(when, lambda air: air.inject(clock_jump(-air.now_s)))


@dataclass
class Jumped(Injector):
    """The clock that the companion reads is ahead or behind by so much, from a moment on."""

    when: When
    jump_s: float

    def clock_us(self, air: Air, now_us: int) -> int:
        return now_us + round(self.jump_s * 1e6) if self.when.is_on(air) else now_us


@dataclass
class Rewritten(Injector):
    """Packets of some messages are changed on their way to the companion."""

    when: When
    numbers: Sequence[int]
    change: Change

    def to_companion(self, air: Air, frames: list[bytes]) -> Sequence[bytes]:
        if not self.when.is_on(air):
            return frames
        return [
            changed(frame, lambda message: self.change(message, air)) if message_id_of(frame) in self.numbers else frame
            for frame in frames
        ]


@dataclass
class Stuck(Injector):
    """Messages come at their rate, with the stamps of their time, and say for ever what they said at first."""

    when: When
    numbers: Sequence[int]
    first: dict[int, bytes] = field(default_factory=dict)

    def to_companion(self, air: Air, frames: list[bytes]) -> Sequence[bytes]:
        if not self.when.is_on(air):
            return frames
        return [self._stuck(air, frame) if message_id_of(frame) in self.numbers else frame for frame in frames]

    def _stuck(self, air: Air, frame: bytes) -> bytes:
        first = self.first.setdefault(message_id_of(frame), frame)

        def restamp(message: Any) -> None:
            for name, unit_us in (("time_usec", 1), ("time_boot_ms", 1000)):
                if hasattr(message, name):
                    setattr(message, name, air.vehicle.time_boot_us // unit_us)

        return changed(first, restamp)


@dataclass
class Thinned(Injector):
    """Of some messages only every n-th comes."""

    when: When
    numbers: Sequence[int]
    keep_every: int
    count: int = 0

    def to_companion(self, air: Air, frames: list[bytes]) -> Sequence[bytes]:
        if not self.when.is_on(air):
            return frames
        return [frame for frame in frames if message_id_of(frame) not in self.numbers or self._is_kept()]

    def _is_kept(self) -> bool:
        self.count += 1
        return self.count % self.keep_every == 0


def setting(**fields: Any) -> Change:
    """A change that gives fields these values."""

    def change(message: Any, air: Air) -> None:
        for name, value in fields.items():
            setattr(message, name, value)

    return change


def adding(**fields: float) -> Change:
    """A change that adds to fields."""

    def change(message: Any, air: Air) -> None:
        for name, value in fields.items():
            setattr(message, name, getattr(message, name) + value)

    return change


def near_zero(message: Any, air: Air) -> None:
    """An accelerometer that is off, with the noise of its converter."""
    for axis in ("xacc", "yacc", "zacc"):
        setattr(message, axis, air.chance.gauss(0.0, 0.02))


def repeating(message: Any, air: Air) -> None:
    message.time_usec -= message.time_usec % 100_000


def backwards(message: Any, air: Air) -> None:
    message.time_usec -= air.chance.choice((0, 0, 0, 50_000, 200_000))


CHANGES: dict[str, Change] = {"near_zero": near_zero, "repeating": repeating, "backwards": backwards}


# --- the process


def stall(seconds: float) -> Callable[[Air], None]:
    """It gets no time."""

    def do(air: Air) -> None:
        air.stall_s = seconds

    return do


def signal(reason: str) -> Callable[[Air], None]:
    def do(air: Air) -> None:
        air.interrupts.reason = reason

    return do


class _BrokenError(Exception):
    """A mistake in the program."""


class _Broken:
    """A part of the companion of which one method raises once."""

    def __init__(self, part: Any, method: str, error: Exception) -> None:
        self._part, self._method, self._error = part, method, error

    def __getattr__(self, name: str) -> Any:
        if name == self._method:
            self._method = ""
            raise self._error
        return getattr(self._part, name)


def break_step(air: Air, error: Exception | None = None) -> None:
    """What the flight does next raises."""
    core = air.companion.core
    assert core is not None, "it flies"
    broken = _Broken(core.machine, "step", error or _BrokenError("nobody thought of this"))
    core.machine = broken  # type: ignore[assignment]


def break_encoder(air: Air) -> None:
    """The next message cannot be packed."""
    encoder = air.companion._encoder
    whole = encoder.packets

    def packets(outgoing: Any) -> list[bytes]:
        encoder.packets = whole  # type: ignore[method-assign]
        raise _BrokenError("not to be packed")

    encoder.packets = packets  # type: ignore[method-assign]
