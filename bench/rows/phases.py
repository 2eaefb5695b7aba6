"""What the companion was doing at any moment of a flight, by the events it told."""

from bisect import bisect_right
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
    """Times in microseconds of the vehicle's boot clock."""

    begins_us: tuple[float, ...]
    phases: tuple[MissionPhase, ...]

    def at(self, boot_us: float) -> MissionPhase:
        index = bisect_right(self.begins_us, boot_us) - 1
        return self.phases[index] if index >= 0 else MissionPhase.GROUND

    def end_of(self, boot_us: float) -> float | None:
        """When the phase of this moment ended; None if it did not."""
        index = bisect_right(self.begins_us, boot_us) - 1
        return next(
            (self.begins_us[k] for k in range(index + 1, len(self.phases)) if self.phases[k] is not self.phases[index]),
            None,
        )


def phases_of(events: Sequence[Event], epoch_at_boot_us: float) -> Phases:
    told = [(event.time_us - epoch_at_boot_us, _BEGUN_BY[event.kind]) for event in events if event.kind in _BEGUN_BY]
    return Phases(tuple(at for at, _ in told), tuple(phase for _, phase in told))
