"""Who else is there: somebody on the link who sends in the vehicle's name or in nobody's, and a pilot."""

import math
import random
from collections.abc import Callable, Sequence
from dataclasses import dataclass

from bench.faults.injectors import Change, OnTheWay
from bench.fly.air import Air, Injector, When
from bench.fly.packets import SET_MODE, changed, decoded, made, packed_by
from companion.mavlink.encode import COMPONENT_ID
from companion.mavlink.packet import message_id_of

_MANUAL, _STRANGER = 1 << 16, (7, 1)
# Ten a second.
_DENIED_EVERY = 25
# Among them NaN, infinities, what no float holds twice, and what a vehicle could say.
_FLOATS: tuple[float, ...] = (math.nan, math.inf, -math.inf, 3.4e38, -3.4e38, 1e20, 1e-45, 0.0)
_FLOATS += (-1e6, -100.0, -10.0, -1.0, 1.0, 10.0, 100.0)
_BITS = {"uint8_t": 8, "uint16_t": 16, "uint32_t": 32, "uint64_t": 64, "int8_t": 7, "int16_t": 15, "int32_t": 31}


def forged(when: When, number: int, change: Change, times: int = 1, every_s: float = 0.0) -> OnTheWay:
    """Packets in the vehicle's name beside its own: the newest true one of its kind with some fields changed."""
    latest: dict[int, bytes] = {}
    left, due_s = times, 0.0

    def act(air: Air, frames: list[bytes]) -> Sequence[bytes]:
        nonlocal left, due_s
        if number not in latest or left == 0 or air.now_s < due_s:
            return frames
        left, due_s = left - 1, air.now_s + every_s
        return [*frames, changed(latest[number], lambda message: change(message, air))]

    return OnTheWay(when, act, _keeping(latest))


def _keeping(latest: dict[int, bytes]) -> Callable[[list[bytes]], None]:
    """Notes the newest packet of every kind."""
    return lambda frames: latest.update((message_id_of(frame), frame) for frame in frames)


def noise(when: When, most: int) -> OnTheWay:
    """Bytes that are no packets, in every interval."""
    return OnTheWay(when, lambda air, frames: [*frames, air.chance.randbytes(air.chance.randint(1, most))])


def strangers(when: When, copies: int = 1) -> OnTheWay:
    """Another system's packets: its own heartbeats, modes and forces, as many as the vehicle's."""

    def act(air: Air, frames: list[bytes]) -> Sequence[bytes]:
        beat = {"type": 2, "autopilot": 12, "base_mode": 1, "custom_mode": _MANUAL}
        force = {"time_usec": air.vehicle.time_boot_us, "xacc": -40.0, "fields_updated": 63}
        return [*frames, *(made("HEARTBEAT", beat, _STRANGER), made("HIGHRES_IMU", force, _STRANGER)) * copies]

    return OnTheWay(when, act)


def denied(when: When) -> OnTheWay:
    """Answers to commands in the vehicle's name: what was asked for is denied."""
    fields = {"command": SET_MODE, "result": 2, "target_system": 1, "target_component": COMPONENT_ID}
    intervals = 0

    def note(frames: list[bytes]) -> None:
        nonlocal intervals
        intervals += 1

    def act(air: Air, frames: list[bytes]) -> Sequence[bytes]:
        return frames if intervals % _DENIED_EVERY else [*frames, made("COMMAND_ACK", fields)]

    return OnTheWay(when, act, note)


def hostile(when: When, spared: Sequence[int] = ()) -> OnTheWay:
    """True packets of every kind that comes, with one to three fields spoiled, beside the vehicle's own."""
    latest: dict[int, bytes] = {}

    def act(air: Air, frames: list[bytes]) -> Sequence[bytes]:
        chance, kinds = air.chance, [number for number in latest if number not in spared]
        return [
            *(_spoiled(chance, latest[chance.choice(kinds)]) for _ in range(chance.choice((0, 0, 1, 1, 2)))),
            *frames,
        ]

    return OnTheWay(when, act, _keeping(latest))


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
