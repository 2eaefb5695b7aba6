"""What a link offers to whoever is at its other end, one object for each of MAVLink's protocols; and from what."""

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from types import MappingProxyType
from typing import Any, Protocol, TypeAlias

from sim_vehicle.autopilot.autopilot import Autopilot
from sim_vehicle.autopilot.messages import Identity
from sim_vehicle.mavlink.encode import Message
from sim_vehicle.mavlink.signing import Signing
from sim_vehicle.mavlink.streams.streams import Streams
from sim_vehicle.mavlink.streams.topics import Topics
from sim_vehicle.mavlink.telemetry import Telemetry

Handler: TypeAlias = Callable[[Any], None]


@dataclass(frozen=True, slots=True)
class Board:
    """The vehicle's software, as all its links reach it."""

    identity: Identity
    autopilot: Autopilot
    telemetry: Telemetry
    topics: Topics
    signing: Signing
    interval_us: int
    """Of the inertial samples, and so of the vehicle's steps."""


class Channel(Protocol):
    """What a protocol may do with the link that it is spoken on."""

    now_us: int
    streams: Streams
    """For who sets their rates."""

    def send(self, message: Message) -> None:
        """Send something that is no stream."""


class Service:
    """One protocol on one link, each message answered at once. What all links share is the autopilot's."""

    handlers: Mapping[int, Handler] = MappingProxyType({})
    """What to do with a packet, by its message's id; called in the order of arrival."""

    def update(self, now_us: int) -> None:
        """Called at every interval, after the control and before the streams: answers, repeats, time-outs."""

    def close(self) -> None:
        """The link has ended: what was going on over it does not hold up another one."""
