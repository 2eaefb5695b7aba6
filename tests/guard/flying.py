"""A guard, somebody else who commands, and a simulated vehicle: what tests need besides `bench.fly.commanded`.

`GuardedFlight`: the guard on one link, a pilot or a program on another. `AttachedFlight`: the guard on the program's
own connection, through which both send names and fields, as by MAVSDK.
"""

import json
import math
from collections.abc import Callable
from typing import Any

from pymavlink.dialects.v20 import development as dialect

from bench.fly.commanded import MANUAL_POSITION, OFFBOARD, REPEATED_EVERY_S, SOCKET_HOLDS, Commanded
from bench.fly.virtual_time import EPOCH_US
from companion.guard.attached import AttachedGuard, AttachedStep
from companion.guard.config import GuardConfig
from companion.guard.guard import Guard
from companion.guard.states import State
from companion.report import Event
from sim_vehicle.mavlink.streams.stream_rates import LinkKind


class GuardedFlight(Commanded):
    """The guard on one link, the pilot or the program on another; `others_last` is what that one has heard."""

    def __init__(
        self,
        config: GuardConfig | None = None,
        parameters: dict[str, float] | None = None,
        airframe: str = "foldable",
        **scene: Any,
    ) -> None:
        super().__init__(airframe, parameters, **scene)
        self.guard = Guard(config or GuardConfig())
        self._guard_link = self.vehicle.add_link(LinkKind.ONBOARD)
        self._other_link = self.vehicle.add_link(LinkKind.NORMAL)
        self._other = dialect.MAVLink(None, srcSystem=255, srcComponent=190)
        self._parser, self._reader = dialect.MAVLink(None), dialect.MAVLink(None)
        self._guards_bytes = self._others_bytes = b""
        self.others_last: dict[str, Any] = {}

    def send(self, message: Any) -> None:
        self._others_bytes += message.pack(self._other)
        self._other.seq = (self._other.seq + 1) % 256

    def sticks(self, forward: float) -> None:
        self.send(dialect.MAVLink_manual_control_message(1, round(1000 * forward), 0, 500, 0, 0))

    def pilot(self) -> list[float]:
        """Sticks twenty times a second; the list's only number is the forward one."""
        forward = [0.0]
        self.every(0.05, lambda: self.sticks(forward[0]))
        return forward

    def flown_by_sticks(self) -> list[float]:
        """In the air and in position mode."""
        stick = self.pilot()
        self.take_off()
        self.run_until(lambda: self.mode == "AUTO.LOITER", 20.0)
        self.set_mode(MANUAL_POSITION)
        self.run_until(lambda: self.mode == "POSCTL", 2.0)
        return stick

    def pushed_into_the_wall(self, recovers: bool = True) -> list[float]:
        """By sticks, until the guard takes over; then they are let go, and it recovers."""
        stick = self.flown_by_sticks()
        stick[0] = 0.3
        self.run_until(lambda: self.state in (State.TAKING_OVER, State.RECOVERING), 20.0)
        stick[0] = 0.0
        if recovers:
            self.run_to(State.RECOVERING, 1.0)
        return stick

    def _exchange(self) -> None:
        for sender, sent in (("guard", self._guards_bytes), ("other", self._others_bytes)):
            messages = self._parser.parse_buffer(bytearray(sent)) if sent else []
            self.on_wire += [(self.time_s, sender, message) for message in messages or []]
        self._guard_link.push(self._guards_bytes)
        self._other_link.push(self._others_bytes)
        self._others_bytes = b""
        self.vehicle.advance()
        for packet in self._other_link.take():
            message = self._reader.decode(bytearray(packet))
            self.others_last[message.get_type()] = message
        self._guards_bytes = b""
        self._unread = [*self._unread, *self._guard_link.take()][:SOCKET_HOLDS]
        if not self.is_late:
            received, self._unread = b"".join(self._unread), []
            self.guard_hears(received)

    def guard_hears(self, received: bytes) -> list[Event]:
        """Alone, what somebody sends in the vehicle's name."""
        result = self.guard.step(received, self.now_us)
        self._guards_bytes += b"".join(result.sent_frames)
        self.events += result.events
        return list(result.events)

    @property
    def position(self) -> tuple[float, float, float]:
        return self.guard.status().position_ned_m


class AttachedFlight(Commanded):
    """What the program sends goes through the guard's gate, as MAVSDK's does; `sender` is "guard" or "program"."""

    def __init__(self, config: GuardConfig | None = None, airframe: str = "foldable") -> None:
        super().__init__(airframe, None)
        self.guard = AttachedGuard(config or GuardConfig(), 1, EPOCH_US)
        self._mavlink, self._parser = dialect.MAVLink(None, 245, 190), dialect.MAVLink(None)
        self.outgoing: list[tuple[str, str, dict[str, Any]]] = []

    @property
    def mode(self) -> int | None:
        return self.guard.core.flight.vehicle.custom_mode

    def send(self, message: Any) -> None:
        self.outgoing.append(("program", message.get_type(), fields_of(message)))

    def fly_by(self, north_m_s: float, east_m_s: float = 0.0) -> Callable[[], None]:
        """That velocity in OFFBOARD; what is returned ends the setpoints."""
        ends = self.every(REPEATED_EVERY_S, lambda: self.velocity(north_m_s, east_m_s))
        self.run_for(0.3)
        self.set_mode(OFFBOARD)
        return ends

    def fly_into_the_wall(self, speed_m_s: float = 1.5) -> None:
        """Take off, OFFBOARD, north until the guard holds."""
        self.take_off()
        self.fly_by(speed_m_s)
        self.run_until(lambda: self.guard.core.machine.holds, 20.0)

    def _exchange(self) -> None:
        self.take(self.guard.step((), self.now_us))
        packets, self.outgoing, outgoing = b"", [], self.outgoing
        for sender, name, fields in outgoing:
            if self.guard.lets_pass(name, fields, self.now_us):
                message = message_of(name, fields)
                self.on_wire.append((self.time_s, sender, message))
                packets += message.pack(self._mavlink)
        for packet in self.vehicle.step(packets):
            self.hear(self._parser.decode(bytearray(packet)), self.now_us)

    def hear(self, message: Any, now_us: int) -> None:
        self.take(self.guard.hear(message.get_type(), (1, 1), fields_of(message), now_us))

    def take(self, step: AttachedStep) -> None:
        self.outgoing += [("guard", name, json.loads(json.dumps(dict(fields)))) for name, fields in step.sent]
        self.events += step.events


def fields_of(message: Any) -> dict[str, Any]:
    """As libmav has them, by way of JSON: NaN is null, text is text, an array is a list."""
    values = {name: getattr(message, name) for name in message.fieldnames}
    is_unset = {name: isinstance(value, float) and not math.isfinite(value) for name, value in values.items()}
    return json.loads(json.dumps({name: None if is_unset[name] else value for name, value in values.items()}))


def message_of(name: str, fields: dict[str, Any]) -> Any:
    kind = getattr(dialect, f"MAVLink_{name.lower()}_message")
    values = [math.nan if fields[field] is None else fields[field] for field in kind.fieldnames]
    return kind(*[value.encode() if isinstance(value, str) else value for value in values])
