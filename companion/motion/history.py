"""The last two seconds of motion, in the vehicle's boot clock."""

from collections import deque
from itertools import islice

from companion.messages import LocalPosition

# An estimate uses the half second before a contact; twice that, and a reserve for late detections.
KEPT_US = 2_000_000
# A time this far back is not a reordered packet but a rebooted vehicle.
REBOOT_US = 1_000_000
# PX4 cuts time_boot_ms to whole milliseconds: a stamp may be this much before its sample.
STAMP_RESOLUTION_US = 1_000
# For this time after its latest message ODOMETRY counts as received: 15 messages at PX4's 30 Hz. Until then its
# velocities and its reset counter are used.
ODOMETRY_KEPT_US = 500_000


class MotionHistory:
    """Positions and velocities in the order of their time stamps; late packets are dropped."""

    __slots__ = ("_samples",)

    def __init__(self) -> None:
        self._samples: deque[LocalPosition] = deque()

    def add(self, sample: LocalPosition) -> bool:
        """Remember a sample; False when it is older than what is known and was dropped."""
        samples = self._samples
        if samples:
            newest_us = samples[-1].time_boot_us
            if sample.time_boot_us <= newest_us:
                if newest_us - sample.time_boot_us < REBOOT_US:
                    return False
                samples.clear()
        samples.append(sample)
        oldest_us = sample.time_boot_us - KEPT_US
        while samples[0].time_boot_us < oldest_us:
            samples.popleft()
        return True

    def newest(self, count: int) -> list[LocalPosition]:
        """The newest of all, the very newest first."""
        return list(islice(reversed(self._samples), count))

    def latest(self) -> LocalPosition | None:
        return self._samples[-1] if self._samples else None

    def before(self, time_boot_us: int) -> LocalPosition | None:
        """The latest one before a time."""
        return next((sample for sample in reversed(self._samples) if sample.time_boot_us < time_boot_us), None)

    def between(self, start_boot_us: int, end_boot_us: int) -> list[LocalPosition]:
        """Samples with start <= time < end, oldest first."""
        return [sample for sample in self._samples if start_boot_us <= sample.time_boot_us < end_boot_us]
