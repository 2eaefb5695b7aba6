"""What a link offers to whoever is at its other end: one object for each of MAVLink's protocols."""

from collections.abc import Callable, Mapping
from typing import Any, Protocol, TypeAlias, runtime_checkable

from sim_vehicle.autopilot.commands import StreamControl
from sim_vehicle.mavlink.encode import Message

Handler: TypeAlias = Callable[[Any], None]


class Channel(Protocol):
    """What a protocol may do with the link that it is spoken on."""

    now_us: int

    @property
    def streams(self) -> StreamControl:
        """The streams, for who sets their rates."""

    def send(self, message: Message) -> None:
        """Send something that is no stream."""


class Service(Protocol):
    """One protocol on one link, each message answered at once. What all links share is the autopilot's."""

    handlers: Mapping[int, Handler]
    """What to do with a packet, by its message's id; called in the order of arrival."""


@runtime_checkable
class BusyService(Service, Protocol):
    """One that also has something to do when nothing has come."""

    def update(self, now_us: int) -> None:
        """Called at every interval, after the control and before the streams: answers, repeats, time-outs."""
