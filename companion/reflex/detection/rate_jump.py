"""A rate jump: a yaw rate that changes sooner than motors can change it, and stays changed.

A contact beside the centre turns the vehicle about its thrust. Motors do so by their drag alone, which is weak. One
broken sample is no median of three.
"""

import math
from dataclasses import dataclass

from companion.motion.config import LONGEST_GAP_US
from companion.reflex.config import EXCESS, RATE_MEMORY_US, SPREAD_MEMORY_S, FusedConfig
from companion.reflex.detection.detector import Innovation

_MEMORY_US = 1e6 * SPREAD_MEMORY_S


@dataclass(slots=True)
class RateJump(Innovation):
    """Of the yaw rate, the median of the last three samples, beside its mean before, rad/s. Changed only by `imu`.

    Times: vehicle's boot clock.
    """

    last_rad_s: tuple[float, float] = (0.0, 0.0)
    over_us: int = 0
    mean_rad_s: float = 0.0
    variance_rad2_s2: float = 0.0

    def imu(self, before_us: int, time_us: int, yaw_rate_rad_s: float, config: FusedConfig) -> None:
        """Take one sample; the one before it was at `before_us`."""
        (a, b), c = self.last_rad_s, yaw_rate_rad_s
        # After a gap or a reboot it has the weight of the longest interval.
        was_us = self.over_us if 0 < self.over_us < LONGEST_GAP_US else LONGEST_GAP_US
        self.last_rad_s, self.over_us = (b, c), time_us - before_us
        median = b if (b - a) * (c - b) >= 0.0 else a if (a - b) * (c - a) >= 0.0 else c
        jump, share, least = median - self.mean_rad_s, was_us / RATE_MEMORY_US, config.rate_step_rad_s
        if share >= 1.0:
            self.mean_rad_s, least = median, least * share
        else:
            self.mean_rad_s += share * jump
        spreads_rad_s = EXCESS * config.noise_factor * math.sqrt(self.variance_rad2_s2)
        self.value, self.limit = size, limit = abs(jump), least if least > spreads_rad_s else spreads_rad_s
        learnt = size if size < limit else limit
        self.variance_rad2_s2 += was_us / (_MEMORY_US + was_us) * (learnt * learnt - self.variance_rad2_s2)
