"""The last two seconds of motion, in the vehicle's boot clock."""

from collections import deque
from dataclasses import dataclass, field

from companion.messages import LocalPosition

# Evidence for or against a hit lies within 0.3 s of it; the origin is the mean of a second. A time further back than
# this is not that of a reordered packet but of a rebooted vehicle. By then each stream has sent a message: those that a
# detector uses come ten times a second and more.
KEPT_US = 2_000_000
# PX4 cuts time_boot_ms to whole milliseconds: a stamp may be this much before its sample.
STAMP_RESOLUTION_US = 1_000
# A message counts as current for this time: 15 of PX4's ODOMETRY at 30 Hz, whose velocities and reset counter are used
# until then, as are those of ATTITUDE_TARGET.
CURRENT_US = 500_000
# The vehicle's estimate shows a hit by this time: all but the longest contacts are over (0.12 s at 1 m/s), it is 20 to
# 40 ms late, and a filter's switching makes it swing.
SHOWN_US = 150_000
# A velocity that differs by less does not differ: four times the noise of a good estimate, which reaches 0.1 m/s now
# and then. An estimate has converged when its known error stays below that.
SAME_M_S = 0.15


@dataclass(slots=True)
class MotionHistory:
    """Positions and velocities in the order of their time stamps; late packets are dropped."""

    _samples: deque[LocalPosition] = field(default_factory=deque)

    def add(self, sample: LocalPosition) -> bool:
        """Remember a sample; False when it is older than what is known and was dropped."""
        samples, time_us = self._samples, sample.time_boot_us
        late_us = samples[-1].time_boot_us - time_us if samples else -1
        if 0 <= late_us < KEPT_US:
            return False
        if late_us >= KEPT_US:
            samples.clear()
        samples.append(sample)
        while samples[0].time_boot_us < time_us - KEPT_US:
            samples.popleft()
        return True

    def latest(self) -> LocalPosition | None:
        return self._samples[-1] if self._samples else None

    def before(self, time_boot_us: int) -> LocalPosition | None:
        """The latest one before a time."""
        return next((sample for sample in reversed(self._samples) if sample.time_boot_us < time_boot_us), None)

    def between(self, start_boot_us: int, end_boot_us: int) -> list[LocalPosition]:
        """Samples with start <= time < end, oldest first."""
        return [sample for sample in self._samples if start_boot_us <= sample.time_boot_us < end_boot_us]
