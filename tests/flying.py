"""The one harness: who flies or guards, and a vehicle, joined by bytes on virtual time.

`Flight` joins a companion with a scripted vehicle (`tests.companion.fake_vehicle`) or the simulated one
(`tests.simulated`). `tests.guard.flying` joins a guard, somebody else who commands, and the simulated vehicle.
"""

import copy
from dataclasses import dataclass, field
from typing import Any

from bench.fly.packets import decoded, number_of
from bench.fly.virtual_time import EPOCH_US, INTERVAL_US, VirtualTime
from companion.mavlink.packet import message_id_of
from companion.report import Event, FlightReport


class Told(VirtualTime):
    def kinds(self) -> list[str]:
        return [event.kind for event in self.events]

    def told(self, kind: str) -> list[str]:
        return [event.text for event in self.events if event.kind == kind]

    def event(self, kind: str, index: int = 0) -> Event:
        return [event for event in self.events if event.kind == kind][index]


@dataclass
class Flight(Told):
    """A companion, or a guard, and a vehicle; what the one sends arrives at the other an interval later."""

    companion: Any
    vehicle: Any
    now_us: int = EPOCH_US
    pending: bytes = b""
    events: list[Event] = field(default_factory=list)
    sent: list[tuple[int, bytes]] = field(default_factory=list)

    def step(self, forged: bytes = b"", others: bytes = b"") -> list[Event]:
        """`forged` reaches the companion before the vehicle's packets, `others` the vehicle after the companion's."""
        self.now_us += INTERVAL_US
        packets = self.vehicle.step(self.pending + others)
        return self.hear(forged + (packets if isinstance(packets, bytes) else b"".join(packets)))

    def hear(self, received: bytes) -> list[Event]:
        """The companion's half of a step: the vehicle stands still."""
        result = self.companion.step(received, self.now_us)
        self.pending = b"".join(result.sent_frames)
        self.sent += [(self.now_us, frame) for frame in result.sent_frames]
        self.events += result.events
        return list(result.events)

    def copy(self) -> "Flight":
        """Goes on as this one would, on a scripted vehicle; what both have done so far is flown once, and shared."""
        v = self.vehicle
        said = [*self.events, *self.sent, *v.setpoints, *v.commands, *v.heartbeats, *v.timesyncs]
        return copy.deepcopy(self, {id(one): one for one in said})

    def run_to_end(self, limit_s: float = 120.0) -> FlightReport:
        self.run_until(lambda: self.companion.finished, limit_s)
        return self.report

    @property
    def state(self) -> str:
        return self.companion.status().state

    @property
    def report(self) -> FlightReport:
        return self.companion.report()

    def messages(self, name: str, since_us: int = 0) -> list[tuple[int, Any]]:
        """What the companion has sent by that name after `now_us` = since_us, each with its time."""
        number = number_of(name)
        return [(t, decoded(frame)) for t, frame in self.sent if t > since_us and message_id_of(frame) == number]

    def setpoints_since(self, time_us: int) -> list[tuple[int, Any]]:
        return self.messages("SET_POSITION_TARGET_LOCAL_NED", time_us)
