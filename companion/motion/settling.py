"""Has the vehicle come to rest at a place?"""

import math
from dataclasses import dataclass, field

from companion.messages import Vector3
from companion.motion.config import SettledConfig
from companion.motion.vector import ZERO, towards


@dataclass(slots=True)
class Lasting:
    """For how long something has been so, by the vehicle's clock: a late step makes nothing last."""

    since_us: int | None = None
    lasts_us: int = 0

    def update(self, is_so: bool, time_boot_us: int) -> None:
        self.since_us = (time_boot_us if self.since_us is None else self.since_us) if is_so else None
        self.lasts_us = 0 if self.since_us is None else time_boot_us - self.since_us


@dataclass(slots=True)
class SettlingMonitor:
    """Within a distance of the place and below a low-pass filtered speed, without a break, for a duration.

    A speed that is not certain is above the limit where it is by more than its standard deviation, and by more than as
    much again: one of which nothing is known is no rest.
    """

    config: SettledConfig
    _velocity: Vector3 = ZERO
    _time_us: int = 0
    _still: Lasting = field(default_factory=Lasting)

    def settled_since(
        self, time_boot_us: int, distance_m: float, velocity_m_s: Vector3, spread_m_s: float
    ) -> int | None:
        """Take the present motion; the start (boot time) of an interval that is by now long enough, or None."""
        config, elapsed_s = self.config, max(1e-6, 1e-6 * (time_boot_us - self._time_us))
        share, self._time_us = elapsed_s / (config.smoothing_s + elapsed_s), time_boot_us
        self._velocity = towards(self._velocity, velocity_m_s, share)
        most_m_s = config.speed_m_s + min(spread_m_s, config.speed_m_s)
        is_still = distance_m <= config.distance_m and math.hypot(*self._velocity) < most_m_s
        self._still.update(is_still, time_boot_us)
        return self._still.since_us if self._still.lasts_us >= config.duration_s * 1e6 else None
