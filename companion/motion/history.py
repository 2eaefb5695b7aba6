"""The last two seconds of motion, in the vehicle's boot clock."""

from collections import deque
from dataclasses import dataclass, field

from companion.messages import LocalPosition
from companion.motion.config import KEPT_US, LONGEST_GAP_US


@dataclass(slots=True)
class Lateness:
    """Whether a sample comes behind a newer one. Where all do for a while, that one's stamp was wrong."""

    since_us: int | None = None  # by the vehicle's clock, since when all have come late

    def is_late(self, time_boot_us: int, newest_boot_us: int) -> bool:
        if not 0 <= newest_boot_us - time_boot_us < KEPT_US:
            self.since_us = None
            return False
        since_us = self.since_us = time_boot_us if self.since_us is None else self.since_us
        return time_boot_us - since_us < LONGEST_GAP_US


@dataclass(slots=True)
class MotionHistory:
    """Positions and velocities in the order of their time stamps; late packets are dropped."""

    latest: LocalPosition | None = None
    _samples: deque[LocalPosition] = field(default_factory=deque)
    _lateness: Lateness = field(default_factory=Lateness)

    def add(self, sample: LocalPosition) -> bool:
        """Remember a sample; False when it is older than what is known and was dropped."""
        samples, time_us, latest = self._samples, sample.time_boot_us, self.latest
        if latest is not None and self._lateness.is_late(time_us, latest.time_boot_us):
            return False
        if latest is not None and time_us <= latest.time_boot_us:
            samples.clear()
        self.latest = sample
        samples.append(sample)
        while samples[0].time_boot_us < time_us - KEPT_US:
            samples.popleft()
        return True

    def remembers(self, sample: LocalPosition) -> bool:
        """Whether this very sample was remembered; one of the same values may have come late."""
        return any(sample is each for each in reversed(self._samples))

    def before(self, time_boot_us: int) -> LocalPosition | None:
        """The latest one before a time."""
        return next((sample for sample in reversed(self._samples) if sample.time_boot_us < time_boot_us), None)

    def between(self, start_boot_us: int, end_boot_us: int) -> list[LocalPosition]:
        """Samples with start <= time < end, oldest first."""
        return [sample for sample in self._samples if start_boot_us <= sample.time_boot_us < end_boot_us]
