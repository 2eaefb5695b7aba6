"""How well a link delivers: packets lost by their sequence numbers, unreadable bytes, how evenly samples arrive."""

from dataclasses import dataclass, field

import numpy as np

from companion.mavlink.packet import Stray, has_signature, sequence_of, source_of

# A sequence number has one byte; one that is behind by less than half of its range was overtaken on the way.
_NUMBERS = 256
# Of the delays, so many percent at each end are a busy computer's.
_ODD_PERCENT = 1.0


@dataclass(slots=True)
class Delivery:
    """Of one vehicle. A packet of another, which something on the way forwards, counts its own numbers."""

    received: int = 0
    lost: int = 0
    unreadable_bytes: int = 0
    signed: int = 0
    delays_us: list[tuple[int, int]] = field(default_factory=list)  # each sample's own time, and how late it came
    _sequence: int | None = None

    def take(self, frame: bytes, vehicle: tuple[int, int]) -> None:
        """A packet, or bytes that are none."""
        if isinstance(frame, Stray):
            self.unreadable_bytes += len(frame)
        elif source_of(frame) == vehicle:
            missing = 0 if self._sequence is None else (sequence_of(frame) - self._sequence - 1) % _NUMBERS
            if missing < _NUMBERS // 2:
                self._sequence = sequence_of(frame)
                self.lost += missing
            self.received += 1
            self.signed += has_signature(frame)

    @property
    def jitter_us(self) -> float | None:
        """By how much the samples' delays differ; what grows evenly is two clocks that drift apart."""
        if len(self.delays_us) < _NUMBERS:
            return None
        stamps, delays = (np.array(column, float) for column in zip(*self.delays_us, strict=True))
        stamps -= stamps[0]
        # The first delay is a difference of two epochs: too large a number to be fitted exactly.
        delays -= delays[0]
        left = delays - np.polyval(np.polyfit(stamps, delays, 1), stamps)
        early, late = np.percentile(left, (_ODD_PERCENT, 100.0 - _ODD_PERCENT))
        return float(late - early)
