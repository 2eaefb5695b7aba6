"""Hostile but well-formed messages of the vehicle's, and what must hold of every setpoint whatever is heard."""

import math
import random
from collections.abc import Iterable

from pymavlink.dialects.v20 import development as mav

from bench.fly.packets import decoded, made, outside
from companion.mavlink.readers import READERS
from tests.companion.fake_vehicle import FakeVehicle
from tests.flying import Flight

HEARD = sorted(READERS)
# The states of a flight.
STATES = ("connect", "takeoff", "mission", "recovering", "holding", "returning", "landing")

FLOATS = (math.nan, math.inf, -math.inf, 3.4e38, -3.4e38, 1e20, -1e20, 1e-45, 0.0, -0.0, 1e6, -1e6)
MILD = (-1000.0, -100.0, -40.0, -10.0, -3.0, -1.0, -0.1, 0.1, 1.0, 3.0, 10.0, 40.0, 100.0, 1000.0)
INTEGER_BITS = {"uint8_t": 8, "uint16_t": 16, "uint32_t": 32, "uint64_t": 64, "int8_t": 7, "int16_t": 15}
INTEGER_BITS |= {"int32_t": 31, "int64_t": 63}


class Attacker:
    """Who knows the vehicle's ids and its newest messages, and sends in its name."""

    def __init__(self, vehicle: FakeVehicle, seed: int) -> None:
        self._vehicle = vehicle
        self._random = random.Random(seed)
        self._tx = mav.MAVLink(None, vehicle.system_id, 1)

    def packet(self, message_id: int) -> bytes:
        """One message, true but for some fields; which of them, and their values, by chance."""
        message = self._true(message_id)
        names = list(message.fieldnames)
        for name in self._random.sample(names, self._random.randint(1, min(3, len(names)))):
            self._spoil(message, name)
        return bytes(message.pack(self._tx))

    def _true(self, message_id: int) -> mav.MAVLink_message:
        v, kind = self._vehicle, mav.mavlink_map[message_id]
        now = {"time_usec": v.time_us, "time_boot_ms": v.time_us // 1000, "q1": 1.0, "fields_updated": 0x3F}
        now |= dict(zip(("x", "y", "z", "vx", "vy", "vz"), (*v.position, *v.velocity), strict=True))
        is_real = "float" in kind.fieldtypes
        now |= {n: f if is_real else round(f) for n, f in zip(("xacc", "yacc", "zacc"), v.specific_force, strict=True)}
        now |= {"frame_id": 1, "child_frame_id": 1, "autopilot": v.autopilot, "type": v.vehicle_type}
        now |= {"custom_mode": v.mode, "base_mode": 0x9D if v.armed else 0x1D, "landed_state": v.landed, "thrust": 0.5}
        now["system_status"] = 4 if v.armed else 3
        return decoded(made(kind.msgname, {name: now[name] for name in kind.fieldnames if name in now}))

    def _spoil(self, message: mav.MAVLink_message, name: str) -> None:
        kind = message.fieldtypes[message.fieldnames.index(name)]
        if kind == "char":
            return
        now = getattr(message, name)
        if isinstance(now, list):
            now[self._random.randrange(len(now))] = self._value(kind, 0)
        else:
            setattr(message, name, self._value(kind, now))

    def _value(self, kind: str, now: float) -> object:
        r = self._random
        if kind in ("float", "double"):
            return r.choice((r.choice(FLOATS), r.choice(MILD), now + r.choice(MILD), r.uniform(-20.0, 20.0)))
        bits = INTEGER_BITS[kind]
        least = 0 if kind[0] == "u" else -(1 << bits)
        most = (1 << bits) - 1
        near = min(max(int(now) + r.choice((-1, 1)) * r.choice((1, 1000, 1_000_000, 60_000_000)), least), most)
        return r.choice((least, most, 0, r.randint(least, most), near))


def attacked(f: Flight, packets: Iterable[bytes]) -> None:
    sent = len(f.sent)
    f.step(b"".join(packets))
    for _, frame in f.sent[sent:]:
        # What a setpoint asks for is finite, inside the fence, and within the limits; whatever it is not asked is NaN.
        assert outside(f.companion.core, frame) is None, str(decoded(frame))
