"""Somebody on the link who sends in the vehicle's name, or in nobody's."""

import math
import random
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from typing import Any

from bench.faults.injectors import Forged, adding, setting
from bench.fly.air import COMPLETED, FAILED, HANDED_OVER, Air, Expected, Fault, Injector, When
from bench.fly.packets import (
    ATTITUDE,
    COMMAND_ACK,
    EXTENDED_STATE,
    HEARTBEAT,
    IMU,
    MODE,
    ODOMETRY,
    POSITION,
    SET_MODE,
    decoded,
    made,
    packed_by,
)
from companion.mavlink.encode import COMPONENT_ID
from companion.mavlink.packet import message_id_of

_TWITCH = Expected(finds=False)
_MAY_END = Expected((COMPLETED, HANDED_OVER, FAILED), finds=False)
_MANUAL, _ARMED = 1 << 16, 0x80
# Among them NaN, infinities, what no float holds twice, and what a vehicle could say.
_FLOATS = (
    math.nan,
    math.inf,
    -math.inf,
    3.4e38,
    -3.4e38,
    1e20,
    1e-45,
    0.0,
    -1e6,
    -100.0,
    -10.0,
    -1.0,
    1.0,
    10.0,
    100.0,
)
_BITS = {"uint8_t": 8, "uint16_t": 16, "uint32_t": 32, "uint64_t": 64, "int8_t": 7, "int16_t": 15, "int32_t": 31}


def _disarmed(message: Any, air: Air) -> None:
    message.base_mode &= ~_ARMED


def _forged(number: int, change: Callable[[Any, Air], None], times: int = 1, every_s: float = 0.0) -> Any:
    return lambda chance: Forged(When.flying(chance), number, change, times, every_s)


def _velocity(chance: random.Random) -> Injector:
    """One packet, of ODOMETRY or of LOCAL_POSITION_NED, with a velocity 2 m/s aside."""
    axis, number = chance.choice(("vx", "vy", "vz")), chance.choice((ODOMETRY, POSITION))
    return Forged(When.flying(chance), number, adding(**{axis: chance.choice((-2.0, 2.0))}))


def _rate(rad_s: float) -> Callable[[random.Random], Injector]:
    return lambda chance: Forged(
        When.flying(chance), IMU, adding(**{chance.choice(("xgyro", "ygyro")): chance.choice((-rad_s, rad_s))})
    )


def _force(m_s2: float, times: int = 1) -> Callable[[random.Random], Injector]:
    return lambda chance: Forged(
        When.flying(chance),
        IMU,
        adding(**{chance.choice(("xacc", "yacc")): chance.choice((-m_s2, m_s2))}),
        times,
        0.004,
    )


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
        forged = [
            made("HEARTBEAT", {"type": 2, "autopilot": 12, "base_mode": 1, "custom_mode": _MANUAL}, self.sender),
            made(
                "HIGHRES_IMU", {"time_usec": air.vehicle.time_boot_us, "xacc": -40.0, "fields_updated": 63}, self.sender
            ),
        ]
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
    spares: tuple[int, ...] = ()
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


FAULTS = (
    Fault("forged disarm", "one HEARTBEAT: disarmed", _forged(HEARTBEAT, _disarmed), _TWITCH),
    Fault(
        "forged disarm, twice",
        "two HEARTBEATs within 20 ms: disarmed",
        _forged(HEARTBEAT, _disarmed, 2, 0.01),
        _MAY_END,
    ),
    Fault(
        "forged mode",
        "one CURRENT_MODE: MANUAL",
        _forged(MODE, setting(custom_mode=_MANUAL, intended_custom_mode=_MANUAL)),
        _TWITCH,
    ),
    Fault(
        "forged mode, twice",
        "two agreeing ones within 20 ms",
        _forged(MODE, setting(custom_mode=_MANUAL, intended_custom_mode=_MANUAL), 2, 0.01),
        _MAY_END,
    ),
    Fault(
        "forged landing",
        "five EXTENDED_SYS_STATEs: on the ground",
        _forged(EXTENDED_STATE, setting(landed_state=1), 5, 0.05),
        _MAY_END,
    ),
    Fault(
        "forged autopilot",
        "one HEARTBEAT of a plane with ArduPilot",
        _forged(HEARTBEAT, setting(type=1, autopilot=3)),
        _MAY_END,
    ),
    Fault("forged hit", "one HIGHRES_IMU with 40 m/s2 sideways", _force(40.0), _TWITCH),
    Fault("forged hit of three samples", "three in a row with 40 m/s2 sideways", _force(40.0, 3), _TWITCH),
    Fault("forged velocity", "one ODOMETRY or LOCAL_POSITION_NED 2 m/s aside", _velocity, _TWITCH),
    Fault("forged rate 10 rad/s", "one HIGHRES_IMU that turns at 10 rad/s", _rate(10.0), _TWITCH),
    Fault("forged rate 30 rad/s", "one HIGHRES_IMU that turns at 30 rad/s", _rate(30.0), _TWITCH),
    Fault(
        "forged attitude",
        "one ATTITUDE_QUATERNION upside down",
        _forged(ATTITUDE, setting(q1=0.0, q2=1.0, q3=0.0, q4=0.0)),
        _TWITCH,
    ),
    Fault(
        "forged place",
        "one LOCAL_POSITION_NED 20 m away and as fast",
        _forged(POSITION, adding(x=20.0, vx=20.0)),
        _TWITCH,
    ),
    Fault("forged answers", "every 0.1 s COMMAND_ACK: DO_SET_MODE denied", lambda c: Denied(When.flying(c)), _MAY_END),
    Fault(
        "another vehicle",
        "heartbeats and hits of system 7 in every interval",
        lambda c: Strangers(When("connect", 2.0)),
        from_the_start=True,
    ),
    Fault(
        "flood", "20 of them in every interval: 5,000 packets a second", lambda c: Strangers(When.flying(c, 3.0), 10)
    ),
    Fault(
        "one foreign byte",
        "a byte in every interval between the packets",
        lambda c: Noise(When("connect", 2.0), 1),
        _TWITCH,
        from_the_start=True,
    ),
    Fault(
        "foreign bytes",
        "up to 300 bytes of noise in every interval, from the cruise on",
        lambda c: Noise(When.flying(c), 300),
        _MAY_END,
    ),
    Fault(
        "hostile packets",
        "up to two in every interval: any kind, any field, any value",
        lambda c: Hostile(When.flying(c)),
        Expected((COMPLETED, HANDED_OVER, FAILED), finds=False, false_hits=99),
    ),
    Fault(
        "hostile values",
        "the same, but mode, arming and landed state stay true",
        lambda c: Hostile(When.flying(c), (HEARTBEAT, MODE, EXTENDED_STATE, COMMAND_ACK)),
        Expected((COMPLETED, HANDED_OVER, FAILED), finds=False, has_wall=False, false_hits=99),
    ),
)
