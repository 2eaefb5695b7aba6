"""The ways in which faults act on sensors, estimates, clocks and the companion's process."""

import itertools
import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass
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
class OnTheWay(Injector):
    """Packets on their way to the companion: while it is time it gets what `act` makes of them; `note` sees all."""

    when: When
    act: Callable[[Air, list[bytes]], Sequence[bytes]]
    note: Callable[[list[bytes]], None] = lambda frames: None

    def to_companion(self, air: Air, frames: list[bytes]) -> Sequence[bytes]:
        self.note(frames)
        return self.act(air, frames) if self.when.is_on(air) else frames


def rewritten(when: When, numbers: Sequence[int], change: Change) -> OnTheWay:
    """Packets of some messages are changed."""

    def one(air: Air, frame: bytes) -> bytes:
        return changed(frame, lambda message: change(message, air)) if message_id_of(frame) in numbers else frame

    return OnTheWay(when, lambda air, frames: [one(air, frame) for frame in frames])


def stuck(when: When, numbers: Sequence[int]) -> OnTheWay:
    """Messages come at their rate, with the stamps of their time, and say for ever what they said at first."""
    first: dict[int, bytes] = {}

    def restamp(message: Any, air: Air) -> None:
        for name, unit_us in (("time_usec", 1), ("time_boot_ms", 1000)):
            if hasattr(message, name):
                setattr(message, name, air.vehicle.time_boot_us // unit_us)

    def one(air: Air, frame: bytes) -> bytes:
        if message_id_of(frame) not in numbers:
            return frame
        return changed(first.setdefault(message_id_of(frame), frame), lambda message: restamp(message, air))

    return OnTheWay(when, lambda air, frames: [one(air, frame) for frame in frames])


def thinned(when: When, numbers: Sequence[int], keep_every: int) -> OnTheWay:
    """Of some messages only every n-th comes."""
    count = itertools.count(1)

    def is_kept(frame: bytes) -> bool:
        return message_id_of(frame) not in numbers or next(count) % keep_every == 0

    return OnTheWay(when, lambda air, frames: [frame for frame in frames if is_kept(frame)])


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
