"""The samples through the watch: what it has to say is told, what asks for a recovery is returned."""

from collections.abc import Sequence

from companion.detection import watch
from companion.detection.interface import Situation
from companion.detection.watch import Watch
from companion.estimate.impact import ImpactEstimate
from companion.flight.context import FlightContext
from companion.messages import Sample


def collisions(
    flight: FlightContext, watching: Watch, samples: Sequence[Sample], situation: Situation, now_us: int
) -> list[ImpactEstimate]:
    """The impacts of this step that are collisions."""
    seen = watch.advance(watching, samples, situation, now_us)
    if (watching.blind_reason is None) is not (flight.blind_since_us is None):
        flight.blind_since_us = None if watching.blind_reason is None else now_us
    for notice in seen.notices:
        flight.tell(now_us, notice.kind, notice.text, **notice.data)
    for estimate in seen.impacts:
        if not estimate.impact.is_collision:
            _tell_contact(flight, estimate, now_us)
    return [estimate for estimate in seen.impacts if estimate.impact.is_collision]


def follow_contact(flight: FlightContext, watching: Watch) -> None:
    """Let the latest collision's record see the contact's course."""
    if flight.collisions:
        flight.collisions[-1].follow_contact(watching.state, watching.estimate, watching.estimator.fixes)


def _tell_contact(flight: FlightContext, estimate: ImpactEstimate, now_us: int) -> None:
    """A touch that is no collision is worth a line and nothing more."""
    kind, force_m_s2 = estimate.impact.kind.value, estimate.peak_specific_force_m_s2
    text = f"{kind}: {force_m_s2:.1f} m/s^2, no collision"
    flight.tell(now_us, "contact", text, touched=kind, specific_force_m_s2=force_m_s2)
