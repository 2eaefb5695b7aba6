"""Who else is there: somebody on the link who sends in the vehicle's name or in nobody's, and a pilot."""

import math
import random
from collections.abc import Sequence
from dataclasses import dataclass, field

from bench.faults.injectors import Change
from bench.fly.air import Air, Injector, When
from bench.fly.packets import SET_MODE, changed, decoded, made, packed_by
from companion.mavlink.encode import COMPONENT_ID
from companion.mavlink.packet import message_id_of

_MANUAL = 1 << 16
# Among them NaN, infinities, what no float holds twice, and what a vehicle could say.
_FLOATS: tuple[float, ...] = (math.nan, math.inf, -math.inf, 3.4e38, -3.4e38, 1e20, 1e-45, 0.0)
_FLOATS += (-1e6, -100.0, -10.0, -1.0, 1.0, 10.0, 100.0)
_BITS = {"uint8_t": 8, "uint16_t": 16, "uint32_t": 32, "uint64_t": 64, "int8_t": 7, "int16_t": 15, "int32_t": 31}


@dataclass
class Forged(Injector):
    """Packets in the vehicle's name beside its own: the newest true one of its kind with some fields changed."""

    when: When
    number: int
    change: Change
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


@dataclass
class Noise(Injector):
    """Bytes that are no packets, in every interval."""

    when: When
    most: int

    def to_companion(self, air: Air, frames: list[bytes]) -> Sequence[bytes]:
        if not self.when.is_on(air):
            return frames
        return [*frames, air.chance.randbytes(air.chance.randint(1, self.most))]


@dataclass
class Strangers(Injector):
    """Another system's packets: its own heartbeats, modes and forces, as many as the vehicle's."""

    when: When
    copies: int = 1
    sender: tuple[int, int] = (7, 1)

    def to_companion(self, air: Air, frames: list[bytes]) -> Sequence[bytes]:
        if not self.when.is_on(air):
            return frames
        beat = {"type": 2, "autopilot": 12, "base_mode": 1, "custom_mode": _MANUAL}
        force = {"time_usec": air.vehicle.time_boot_us, "xacc": -40.0, "fields_updated": 63}
        forged = [made("HEARTBEAT", beat, self.sender), made("HIGHRES_IMU", force, self.sender)]
        return [*frames, *forged * self.copies]


@dataclass
class Denied(Injector):
    """Answers to commands in the vehicle's name: what was asked for is denied."""

    when: When
    count: int = 0

    def to_companion(self, air: Air, frames: list[bytes]) -> Sequence[bytes]:
        self.count += 1
        if self.count % 25 or not self.when.is_on(air):
            return frames
        fields = {"command": SET_MODE, "result": 2, "target_system": 1, "target_component": COMPONENT_ID}
        return [*frames, made("COMMAND_ACK", fields)]


@dataclass
class Hostile(Injector):
    """True packets of every kind that comes, with one to three fields spoiled, beside the vehicle's own."""

    when: When
    spares: Sequence[int] = ()
    latest: dict[int, bytes] = field(default_factory=dict)

    def to_companion(self, air: Air, frames: list[bytes]) -> Sequence[bytes]:
        self.latest |= {message_id_of(frame): frame for frame in frames}
        if not self.when.is_on(air):
            return frames
        kinds = [number for number in self.latest if number not in self.spares]
        forged = [self._spoiled(air, air.chance.choice(kinds)) for _ in range(air.chance.choice((0, 0, 1, 1, 2)))]
        return [*forged, *frames]

    def _spoiled(self, air: Air, number: int) -> bytes:
        message = decoded(self.latest[number])
        assert message is not None, "it was the vehicle's own"
        names = [name for name, kind in zip(message.fieldnames, message.fieldtypes, strict=True) if kind != "char"]
        for name in air.chance.sample(names, min(len(names), air.chance.randint(1, 3))):
            kind, now = message.fieldtypes[message.fieldnames.index(name)], getattr(message, name)
            value = self._value(air.chance, kind)
            setattr(message, name, [*now[:-1], value] if isinstance(now, list) else value)
        return packed_by(message)

    def _value(self, chance: random.Random, kind: str) -> float:
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
