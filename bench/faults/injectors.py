"""The ways in which faults act: on sensors, estimates, the companion's process, and by others on the link."""

import itertools
import math
import random
from collections.abc import Callable, Sequence
from typing import Any

from bench.fly.air import Air, Injector, When
from bench.fly.packets import SET_MODE, changed, decoded, made, packed_by
from companion.mavlink.encode import COMPONENT_ID
from companion.mavlink.packet import message_id_of
from sim_vehicle.bench.faults import FaultRequest

Change = Callable[[Any, Air], None]
"""Of a message that passes."""
_MANUAL, _STRANGER = 1 << 16, (7, 1)
# Ten a second.
_DENIED_EVERY = 25
# Among them NaN, infinities, what no float holds twice, and what a vehicle could say.
_FLOATS: tuple[float, ...] = (math.nan, math.inf, -math.inf, 3.4e38, -3.4e38, 1e20, 1e-45, 0.0)
_FLOATS += (-1e6, -100.0, -10.0, -1.0, 1.0, 10.0, 100.0)
_BITS = {"uint8_t": 8, "uint16_t": 16, "uint32_t": 32, "uint64_t": 64, "int8_t": 7, "int16_t": 15, "int32_t": 31}


def simulated(request: FaultRequest, when: When) -> Injector:
    """What the simulated vehicle, its sensors, its estimate or its link can do by themselves."""
    for_s = when.for_s if math.isfinite(when.for_s) else None
    return Injector(when, lambda air: air.inject(request, for_s))


# --- packets of the vehicle's own


def rewritten(when: When, numbers: Sequence[int], change: Change) -> Injector:
    """Packets of some messages are changed."""

    def one(air: Air, frame: bytes) -> bytes:
        return changed(frame, lambda message: change(message, air)) if message_id_of(frame) in numbers else frame

    return Injector(when, to_companion=lambda air, frames: [one(air, frame) for frame in frames])


def stuck(when: When, numbers: Sequence[int]) -> Injector:
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

    return Injector(when, to_companion=lambda air, frames: [one(air, frame) for frame in frames])


def thinned(when: When, numbers: Sequence[int], keep_every: int) -> Injector:
    """Of some messages only every n-th comes."""
    count = itertools.count(1)

    def is_kept(frame: bytes) -> bool:
        return message_id_of(frame) not in numbers or next(count) % keep_every == 0

    return Injector(when, to_companion=lambda air, frames: [frame for frame in frames if is_kept(frame)])


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


# --- packets of others


def forged(when: When, number: int, change: Change, times: int = 1, every_s: float = 0.0) -> Injector:
    """Packets in the vehicle's name beside its own: the newest true one of its kind with some fields changed."""
    left, due_s = times, 0.0

    def beside(air: Air, latest: dict[int, bytes]) -> list[bytes]:
        nonlocal left, due_s
        if number not in latest or left == 0 or air.now_s < due_s:
            return []
        left, due_s = left - 1, air.now_s + every_s
        return [changed(latest[number], lambda message: change(message, air))]

    return _knowing(when, lambda air, frames, latest: [*frames, *beside(air, latest)])


def hostile(when: When, spared: Sequence[int] = ()) -> Injector:
    """True packets of every kind that comes, with one to three fields spoiled, beside the vehicle's own."""

    def act(air: Air, frames: list[bytes], latest: dict[int, bytes]) -> list[bytes]:
        chance, kinds = air.chance, [number for number in latest if number not in spared]
        count = chance.choice((0, 0, 1, 1, 2))
        return [*(_spoiled(chance, latest[chance.choice(kinds)]) for _ in range(count)), *frames]

    return _knowing(when, act)


def _knowing(when: When, act: Callable[[Air, list[bytes], dict[int, bytes]], list[bytes]]) -> Injector:
    """With the newest packet of every kind."""
    latest: dict[int, bytes] = {}

    def note(frames: list[bytes]) -> None:
        latest.update((message_id_of(frame), frame) for frame in frames)

    return Injector(when, to_companion=lambda air, frames: act(air, frames, latest), note=note)


def _spoiled(chance: random.Random, frame: bytes) -> bytes:
    message = decoded(frame)
    assert message is not None, "it was the vehicle's own"
    names = [name for name, kind in zip(message.fieldnames, message.fieldtypes, strict=True) if kind != "char"]
    for name in chance.sample(names, min(len(names), chance.randint(1, 3))):
        kind, now = message.fieldtypes[message.fieldnames.index(name)], getattr(message, name)
        value = _value(chance, kind)
        setattr(message, name, [*now[:-1], value] if isinstance(now, list) else value)
    return packed_by(message)


def _value(chance: random.Random, kind: str) -> float:
    if kind in ("float", "double"):
        return chance.choice((chance.choice(_FLOATS), chance.uniform(-20.0, 20.0)))
    bits = _BITS.get(kind, 31)
    return chance.choice((0, 1, (1 << bits) - 1, chance.randint(0, (1 << bits) - 1)))


def noise(when: When, most: int) -> Injector:
    """Bytes that are no packets, in every interval."""
    return Injector(when, to_companion=lambda air, frames: [*frames, air.chance.randbytes(air.chance.randint(1, most))])


def strangers(when: When, copies: int = 1) -> Injector:
    """Another system's packets: its own heartbeats, modes and forces, as many as the vehicle's."""

    def act(air: Air, frames: list[bytes]) -> Sequence[bytes]:
        beat = {"type": 2, "autopilot": 12, "base_mode": 1, "custom_mode": _MANUAL}
        force = {"time_usec": air.vehicle.time_boot_us, "xacc": -40.0, "fields_updated": 63}
        return [*frames, *(made("HEARTBEAT", beat, _STRANGER), made("HIGHRES_IMU", force, _STRANGER)) * copies]

    return Injector(when, to_companion=act)


def denied(when: When) -> Injector:
    """Answers to commands in the vehicle's name: what was asked for is denied."""
    fields = {"command": SET_MODE, "result": 2, "target_system": 1, "target_component": COMPONENT_ID}
    intervals = 0

    def note(frames: list[bytes]) -> None:
        nonlocal intervals
        intervals += 1

    def act(air: Air, frames: list[bytes]) -> Sequence[bytes]:
        return frames if intervals % _DENIED_EVERY else [*frames, made("COMMAND_ACK", fields)]

    return Injector(when, to_companion=act, note=note)


def taken(when: When, stall_s: float = 0.0, cut_s: float = 0.0) -> Injector:
    """The pilot takes over; before, the process may stall or the link be cut, so that it goes unheard."""

    def begin(air: Air) -> None:
        air.stall_s = stall_s
        air.take_over()

    def cut(air: Air, frames: list[bytes]) -> Sequence[bytes]:
        """The companion's link alone: the pilot has a radio of its own."""
        return [] if air.pilot_at_s is not None and air.now_s < air.pilot_at_s + cut_s else frames

    return Injector(when, begin, cut, cut, has_pilot=True)


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


def _break(part: Any, method: str, error: Exception) -> None:
    """The method raises once."""

    def broken(*arguments: Any) -> None:
        delattr(part, method)
        raise error

    setattr(part, method, broken)


def break_step(air: Air, error: Exception | None = None) -> None:
    """What the flight does next raises, once."""
    core = air.companion.core
    assert core is not None, "it flies"
    _break(core.machine, "step", error or _BrokenError("nobody thought of this"))


def break_encoder(air: Air) -> None:
    """The next message cannot be packed."""
    _break(air.companion._encoder, "packets", _BrokenError("not to be packed"))
