"""A guard, somebody else who commands, and a simulated vehicle: what tests need besides `bench.fly.commanded`.

`GuardedFlight`: the guard on one link, a pilot or a program on another. `AttachedFlight`: the guard on the program's
own connection, through which both send names and fields, as by MAVSDK.
"""

import math
from collections.abc import Callable
from typing import Any

from pymavlink.dialects.v20 import development as dialect

from bench.fly import commanded
from bench.fly.commanded import MANUAL_POSITION, OFFBOARD, REPEATED_EVERY_S, Commanded
from bench.fly.packets import GROUND_STATION, decoded
from bench.fly.virtual_time import EPOCH_US
from companion.companion import StepResult
from companion.guard.config import GuardConfig
from companion.guard.guard import AttachedGuard, Guard
from companion.guard.states import State
from companion.mavlink.named import named, packet_from
from companion.report import Event
from sim_vehicle.mavlink.streams.stream_rates import LinkKind
from tests.flying import Told

VELOCITY_ONLY = 0xDC7
PROGRAM = (245, 190)


class Watched(Told, Commanded):
    """`on_wire` has all that reaches the vehicle: when, from whom and what."""

    def __init__(self, *arguments: Any, **scene: Any) -> None:
        self.on_wire: list[tuple[float, str, Any]] = []
        super().__init__(*arguments, **scene)

    def passes(self, sender: str, packet: bytes) -> None:
        self.on_wire.append((self.time_s, sender, decoded(packet)))

    def velocity(self, north: float, east: float = 0.0) -> None:
        values = (0.0, 0.0, 0.0, north, east, *[0.0] * 6)
        boot_ms = round(1e3 * self.time_s)
        self.send(dialect.MAVLink_set_position_target_local_ned_message(boot_ms, 1, 1, 1, VELOCITY_ONLY, *values))

    def stop_all(self) -> None:
        self._repeated.clear()

    def sent_by(self, sender: str, name: str = "", since_s: float = 0.0, until_s: float = math.inf) -> list[Any]:
        return [
            message
            for at_s, who, message in self.on_wire
            if who == sender and name in message.get_type() and since_s <= at_s < until_s
        ]

    def setpoints(self, sender: str, since_s: float = 0.0, until_s: float = math.inf) -> list[Any]:
        return self.sent_by(sender, "SET_POSITION_TARGET", since_s, until_s)

    def event_s(self, kind: str) -> float:
        return 1e-6 * (self.event(kind).time_us - EPOCH_US)


class BetweenFlight(Watched, commanded.BetweenFlight):
    """The guard is the link; `heard` is what comes through it to the others, and when."""

    def __init__(self, *arguments: Any, **scene: Any) -> None:
        super().__init__(*arguments, **scene)
        self.heard: list[tuple[float, Any]] = []

    def others_heard(self, message: Any) -> None:
        super().others_heard(message)
        self.heard.append((self.time_s, message))


class GuardedFlight(Watched):
    """The guard on one link, the pilot or the program on another; `others_last` is what that one has heard.

    `forward` is where a pilot holds the stick, once there is one.
    """

    def __init__(
        self, config: GuardConfig | None = None, parameters: dict[str, float] | None = None, **scene: Any
    ) -> None:
        super().__init__("foldable", parameters, **scene)
        self.guard = Guard(config or GuardConfig())
        self._guards_link = self.vehicle.add_link(LinkKind.ONBOARD)
        self._others_link = self.vehicle.add_link(LinkKind.NORMAL)
        self._guards: list[bytes] = []
        self._others: list[bytes] = []
        self.others_last: dict[str, Any] = {}
        self.forward = 0.0

    def send(self, message: Any) -> None:
        self._others.append(message.pack(dialect.MAVLink(None, *GROUND_STATION)))

    def has_pilot(self) -> None:
        self.every(
            0.05, lambda: self.send(dialect.MAVLink_manual_control_message(1, round(1000 * self.forward), 0, 500, 0, 0))
        )

    def flown_by_sticks(self, forward: float = 0.0) -> None:
        """In the air and in position mode."""
        self.has_pilot()
        self.take_off()
        self.run_until(lambda: self.mode == "AUTO.LOITER", 20.0)
        self.set_mode(MANUAL_POSITION)
        self.run_until(lambda: self.mode == "POSCTL", 2.0)
        self.forward = forward

    def pushed_into_the_wall(self) -> None:
        """By sticks, until the guard takes over; then they are let go."""
        self.flown_by_sticks(0.3)
        self.run_until(lambda: self.state in (State.TAKING_OVER, State.RECOVERING), 20.0)
        self.forward = 0.0

    def _exchange(self) -> None:
        for sender, packets, link in (
            ("guard", self._guards, self._guards_link),
            ("other", self._others, self._others_link),
        ):
            for packet in packets:
                self.passes(sender, packet)
            link.push(b"".join(packets))
        self._guards, self._others = [], []
        self.vehicle.advance()
        self.others_last |= {
            message.get_type(): message for message in map(decoded, self._others_link.take()) if message
        }
        self.guard_hears(b"".join(self._guards_link.take()))

    def guard_hears(self, received: bytes) -> list[Event]:
        """Alone, what somebody sends in the vehicle's name."""
        result = self.guard.step(received, self.now_us)
        self._guards += result.sent_frames
        self.events += result.events
        return list(result.events)


class AttachedFlight(Watched):
    """What the program sends goes through the guard's gate, as MAVSDK's does; `sender` is "guard" or "program"."""

    def __init__(self) -> None:
        super().__init__("foldable", None)
        self.guard = AttachedGuard(GuardConfig(), 1)
        self.outgoing: list[tuple[str, bytes]] = []

    @property
    def mode(self) -> int | None:
        return self.guard.core.flight.vehicle.custom_mode

    def send(self, message: Any) -> None:
        self.outgoing.append(("program", message.pack(dialect.MAVLink(None, *PROGRAM))))

    def fly_by(self, north_m_s: float, east_m_s: float = 0.0) -> Callable[[], None]:
        """That velocity in OFFBOARD; what is returned ends the setpoints."""
        ends = self.every(REPEATED_EVERY_S, lambda: self.velocity(north_m_s, east_m_s))
        self.run_for(0.3)
        self.set_mode(OFFBOARD)
        return ends

    def fly_into_the_wall(self) -> None:
        self.take_off()
        self.fly_by(1.5)
        self.run_until(lambda: self.guard.core.holds, 20.0)

    def _exchange(self) -> None:
        self.take(self.guard.step(b"", self.now_us))
        packets, self.outgoing, outgoing = b"", [], self.outgoing
        for sender, packet in outgoing:
            if self.guard.lets_pass(packet):
                packets += packet
                self.passes(sender, packet)
        for packet in self.vehicle.step(packets):
            self.take(self.guard.step(by_name(packet), self.now_us))

    def take(self, step: StepResult) -> None:
        self.outgoing += [("guard", by_name(packet, PROGRAM) or packet) for packet in step.sent_frames]
        self.events += step.events


def by_name(packet: bytes, source: tuple[int, int] = (1, 1)) -> bytes:
    """By way of MAVSDK's names and fields; empty where the guard looks at nothing of it."""
    name, fields_json = named(packet)
    return packet_from(name, source, fields_json.encode())
