"""The ways in which faults act: on sensors, estimates, the companion's process, and by others on the link."""

import itertools
import math
import operator
from collections.abc import Callable, Mapping, Sequence
from typing import Any

from bench.fly.air import Air, Injector, When
from bench.fly.packets import SET_MODE, changed, made
from companion.mavlink.encode import COMPONENT_ID
from companion.mavlink.packet import message_id_of
from sim_vehicle.bench.faults import FaultRequest

Change = Callable[[Any, Air], None]
"""Of a message that passes."""
_MANUAL, _STRANGER = 1 << 16, (7, 1)
# Ten a second.
_DENIED_EVERY = 25


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
    first: dict[int, dict[str, Any]] = {}

    def repeat(message: Any, air: Air) -> None:
        said = {
            name: getattr(message, name) for name in message.fieldnames if name not in ("time_usec", "time_boot_ms")
        }
        for name, value in first.setdefault(message.get_msgId(), said).items():
            setattr(message, name, value)

    return rewritten(when, numbers, repeat)


def thinned(when: When, numbers: Sequence[int], keep_every: int) -> Injector:
    """Of some messages only every n-th comes."""
    count = itertools.count(1)

    def is_kept(frame: bytes) -> bool:
        return message_id_of(frame) not in numbers or next(count) % keep_every == 0

    return Injector(when, to_companion=lambda air, frames: [frame for frame in frames if is_kept(frame)])


def setting(**fields: Any) -> Change:
    """A change that gives fields these values."""
    return _changing(lambda now, value: value, fields)


def adding(**fields: float) -> Change:
    """A change that adds to fields."""
    return _changing(operator.add, fields)


def _changing(new: Callable[[Any, Any], Any], fields: Mapping[str, Any]) -> Change:
    def change(message: Any, air: Air) -> None:
        for name, value in fields.items():
            setattr(message, name, new(getattr(message, name), value))

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
    latest: dict[int, bytes] = {}
    left, due_s = times, 0.0

    def note(frames: list[bytes]) -> None:
        latest.update((message_id_of(frame), frame) for frame in frames)

    def act(air: Air, frames: list[bytes]) -> Sequence[bytes]:
        nonlocal left, due_s
        if number not in latest or left == 0 or air.now_s < due_s:
            return frames
        left, due_s = left - 1, air.now_s + every_s
        return [*frames, changed(latest[number], lambda message: change(message, air))]

    return Injector(when, to_companion=act, note=note)


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

    def act(air: Air, frames: list[bytes]) -> Sequence[bytes]:
        return frames if air.intervals % _DENIED_EVERY else [*frames, made("COMMAND_ACK", fields)]

    return Injector(when, to_companion=act)


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
    _break(air.companion.core, "_act", error or _BrokenError("nobody thought of this"))


def break_encoder(air: Air) -> None:
    """The next message cannot be packed."""
    _break(air.companion._encoder, "packets", _BrokenError("not to be packed"))
