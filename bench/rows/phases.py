"""What the companion was doing at any moment of a flight, by the events it told."""

from collections.abc import Sequence
from dataclasses import dataclass
from enum import Enum

from companion.report import Event


class MissionPhase(Enum):
    GROUND = "on the ground"
    CLIMB = "take-off"
    ITEM = "item"
    RECOVERING = "recovering"
    HOLDING = "holding"
    RETURNING = "returning"
    LANDING = "landing"
    OVER = "over"


_BEGUN_BY = {
    "armed": MissionPhase.CLIMB,
    "item": MissionPhase.ITEM,
    "detection": MissionPhase.RECOVERING,
    "hold": MissionPhase.HOLDING,
    "return": MissionPhase.RETURNING,
    "landing": MissionPhase.LANDING,
    "done": MissionPhase.OVER,
    "aborted": MissionPhase.OVER,
}


@dataclass(frozen=True, slots=True)
class Phases:
    """When each phase of a flight began, in microseconds of the vehicle's boot clock."""

    begun: tuple[tuple[float, MissionPhase], ...]

    def at(self, boot_us: float) -> MissionPhase:
        return next((phase for at_us, phase in reversed(self.begun) if at_us <= boot_us), MissionPhase.GROUND)

    def end_of(self, boot_us: float) -> float | None:
        """When the phase of this moment ended; None if it did not."""
        now = self.at(boot_us)
        return next((at_us for at_us, phase in self.begun if at_us > boot_us and phase is not now), None)


def phases_of(events: Sequence[Event], epoch_at_boot_us: float) -> Phases:
    told = (event for event in events if event.kind in _BEGUN_BY)
    return Phases(tuple((event.time_us - epoch_at_boot_us, _BEGUN_BY[event.kind]) for event in told))
