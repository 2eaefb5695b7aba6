"""What leaves a step: messages to send, and lines for the timeline."""

from dataclasses import dataclass

from companion.flight.context import FlightContext
from companion.messages import Outgoing
from companion.report import Event


@dataclass(frozen=True, slots=True)
class Outputs:
    messages: tuple[Outgoing, ...]
    events: tuple[Event, ...]


NOTHING = Outputs((), ())


def collect(flight: FlightContext) -> Outputs:
    """Empty the outbox and the timeline into the step's outputs."""
    if not flight.outbox and not flight.events:
        return NOTHING
    outputs = Outputs(tuple(flight.outbox), tuple(flight.events))
    flight.outbox, flight.events = [], []
    return outputs
