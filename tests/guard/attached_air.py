"""A program, the guard on the program's own connection, and a simulated vehicle, on virtual time.

What the program sends goes through the guard's gate as MAVSDK's does, as names and JSON fields.
"""

import json
import math
from collections.abc import Callable
from typing import Any

from pymavlink.dialects.v20 import development as dialect

from companion.guard.attached import AttachedGuard, AttachedStep
from companion.guard.config import GuardConfig
from companion.guard.states import State
from companion.report import Event
from sim_vehicle.airframe import load_built_in
from sim_vehicle.scene import Scene
from sim_vehicle.vehicle import SimulatedVehicle
from tests.guard.flying import ARM, EPOCH_US, SET_MODE, TAKEOFF, VELOCITY_ONLY, WALL

# As MAVSDK's ground station.
PROGRAM = (245, 190)
# MAVSDK's Offboard repeats its last setpoint every 50 ms, for ever; in whole intervals of 4 ms.
REPEATED_EVERY_S = 0.052


class AttachedAir:
    """`on_wire` is what reaches the vehicle: (time, "guard" or "program", name, fields)."""

    def __init__(self, config: GuardConfig | None = None, airframe: str = "foldable") -> None:
        scene = Scene.model_validate({"walls": [WALL]})
        self.vehicle = SimulatedVehicle(load_built_in(airframe), scene, 1)
        self.guard = AttachedGuard(config or GuardConfig(), 1, EPOCH_US)
        self.events: list[Event] = []
        self.on_wire: list[tuple[float, str, str, dict[str, Any]]] = []
        self._mavlink, self._parser = dialect.MAVLink(None, *PROGRAM), dialect.MAVLink(None)
        self._outgoing: list[tuple[str, str, dict[str, Any]]] = []
        self._velocity: tuple[float, float, float] | None = None
        self._next_s = self._next_beat_s = 0.0

    @property
    def time_s(self) -> float:
        return 1e-6 * self.vehicle.time_boot_us

    @property
    def state(self) -> State:
        return self.guard.core.machine.state

    @property
    def mode(self) -> int | None:
        return self.guard.core.flight.vehicle.custom_mode

    def send(self, message: Any) -> None:
        """The program's."""
        self._outgoing.append(("program", message.get_type(), fields_of(message)))

    def command(self, number: int, *params: float) -> None:
        unset = math.nan if number == TAKEOFF else 0.0
        self.send(dialect.MAVLink_command_long_message(1, 1, number, 0, *params, *[unset] * (7 - len(params))))

    def set_mode(self, main: int, sub: int = 0) -> None:
        self.command(SET_MODE, 1, main, sub)

    def set_velocity(self, velocity: tuple[float, float, float] | None) -> None:
        """From now on, twenty times a second, whatever happens."""
        self._velocity = velocity

    def step(self) -> None:
        if self.time_s >= self._next_beat_s:
            self._next_beat_s = self.time_s + 1.0
            self.send(dialect.MAVLink_heartbeat_message(6, 8, 0, 0, 4, 3))
        if self._velocity is not None and self.time_s >= self._next_s:
            self._next_s = self.time_s + REPEATED_EVERY_S
            values = (0.0, 0.0, 0.0, *self._velocity, *[0.0] * 5)
            boot_ms = round(1e3 * self.time_s)
            self.send(dialect.MAVLink_set_position_target_local_ned_message(boot_ms, 1, 1, 1, VELOCITY_ONLY, *values))
        self.take(self.guard.step((), self.now_us))
        outgoing, self._outgoing = self._outgoing, []
        packets = b""
        for sender, name, fields in outgoing:
            fields = json.loads(json.dumps(fields))
            if self.guard.lets_pass(name, fields, self.now_us):
                self.on_wire.append((self.time_s, sender, name, fields))
                packets += message_of(name, fields).pack(self._mavlink)
        for packet in self.vehicle.step(packets):
            message = self._parser.decode(bytearray(packet))
            heard = json.loads(json.dumps(fields_of(message)))
            self.take(self.guard.hear(message.get_type(), (1, 1), heard, self.now_us))

    @property
    def now_us(self) -> int:
        return EPOCH_US + self.vehicle.time_boot_us

    def take(self, step: AttachedStep) -> None:
        self._outgoing += [("guard", name, dict(fields)) for name, fields in step.sent]
        self.events += step.events

    def run(self, seconds: float) -> None:
        for _ in range(round(seconds * 250)):
            self.step()

    def until(self, condition: Callable[[], bool], at_most_s: float) -> None:
        start_s = self.time_s
        while not condition():
            assert self.time_s - start_s < at_most_s, (self.state, [event.text for event in self.events])
            self.step()

    def setpoints(self, sender: str, since_s: float, until_s: float = math.inf) -> list[dict[str, Any]]:
        return [
            fields
            for at_s, who, name, fields in self.on_wire
            if who == sender and name.startswith("SET_POSITION_TARGET") and since_s <= at_s < until_s
        ]

    def event_s(self, kind: str) -> float:
        return 1e-6 * (next(event for event in self.events if event.kind == kind).time_us - EPOCH_US)

    def fly_into_the_wall(self, speed_m_s: float = 1.5) -> None:
        """Take off, OFFBOARD, north until the guard holds."""
        self.until(lambda: self.state is State.STANDING_BY, 10.0)
        self.run(2.0)
        self.command(ARM, 1)
        self.run(0.5)
        self.command(TAKEOFF)
        self.until(lambda: self.state is State.WATCHING, 20.0)
        self.run(3.0)
        self.set_velocity((speed_m_s, 0.0, 0.0))
        self.run(0.3)
        self.set_mode(6)
        self.until(lambda: self.guard.core.machine.holds, 20.0)


def fields_of(message: Any) -> dict[str, Any]:
    """As libmav has them: NaN is null, text is text."""
    found = {}
    for name in message.fieldnames:
        value = getattr(message, name)
        if isinstance(value, float) and not math.isfinite(value):
            value = None
        found[name] = value
    return found


def message_of(name: str, fields: dict[str, Any]) -> Any:
    kind = getattr(dialect, f"MAVLink_{name.lower()}_message")
    values = [math.nan if fields[field] is None else fields[field] for field in kind.fieldnames]
    return kind(*[value.encode() if isinstance(value, str) else value for value in values])
