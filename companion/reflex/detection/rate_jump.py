"""A rate jump: body rates that change sooner than motors can change them, and stay changed.

A contact beside the centre turns the vehicle. Motors do so about the thrust by their drag alone, which is weak, and
faster across it. One broken sample is never the middle one of three; motors brake a true one by so much at most.
"""

import math
from dataclasses import dataclass

from companion.messages import Vector3
from companion.motion.config import LONGEST_GAP_US, MOTORS_RAD_S2, SHOWN_US
from companion.motion.vector import ZERO
from companion.reflex.config import ACROSS_THRUST, EXCESS, MEMORY_S, RATE_MEMORY_US, FusedConfig
from companion.reflex.detection.detector import Innovation

_MEMORY_US = 1e6 * MEMORY_S


@dataclass(slots=True)
class RateJump(Innovation):
    """The middle one of the last three rates beside their mean before, rad/s of yaw. Changed only by `imu`.

    Times: vehicle's boot clock.
    """

    newest_rad_s: Vector3 = ZERO
    step_rad_s: Vector3 = ZERO
    over_us: int = 0
    mean_rad_s: Vector3 = ZERO
    variance_rad2_s2: float = 0.0
    shown: float = 0.0
    """The largest ratio of late: an estimator that has missed a hit shows it later than the gyroscopes."""
    shown_us: int = 0

    def imu(self, before_us: int, time_us: int, rates_frd_rad_s: Vector3, config: FusedConfig) -> None:
        """Take one sample; the one before it was at `before_us`."""
        (x, y, z), (a, b, c), (p, q, r) = self.newest_rad_s, self.step_rad_s, rates_frd_rad_s
        p, q = ACROSS_THRUST * p, ACROSS_THRUST * q
        # After a gap or a reboot it has the weight of the longest interval.
        was_us = self.over_us if 0 < self.over_us < LONGEST_GAP_US else LONGEST_GAP_US
        self.newest_rad_s, self.over_us = (p, q, r), time_us - before_us
        self.step_rad_s = i, j, k = p - x, q - y, r - z
        on = a * i + b * j + c * k
        # The one between is the middle one, unless the newest step goes back: behind where the last began, or less far.
        if on < 0.0:
            if on + a * a + b * b + c * c >= 0.0:
                a, b, c = -i, -j, -k
            # A gap lets no broken sample count.
            braked_rad_s = MOTORS_RAD_S2 * ACROSS_THRUST * 1e-6 * min(max(self.over_us, 0), RATE_MEMORY_US)
            share = max(0.0, 1.0 - braked_rad_s / math.sqrt(a * a + b * b + c * c))
            x, y, z = x - share * a, y - share * b, z - share * c
        (m, n, o), share, least = self.mean_rad_s, was_us / RATE_MEMORY_US, config.rate_step_rad_s
        i, j, k = x - m, y - n, z - o
        if share >= 1.0:
            self.mean_rad_s, least = (x, y, z), least * share
        else:
            self.mean_rad_s = (m + share * i, n + share * j, o + share * k)
        spreads_rad_s = EXCESS * config.noise_factor * math.sqrt(self.variance_rad2_s2)
        size = self.value = math.hypot(i, j, k)
        limit = self.limit = least if least > spreads_rad_s else spreads_rad_s
        learnt = size if size < limit else limit
        self.variance_rad2_s2 += was_us / (_MEMORY_US + was_us) * (learnt * learnt - self.variance_rad2_s2)
        if size >= self.shown * limit or not 0 <= time_us - self.shown_us <= SHOWN_US:
            self.shown, self.shown_us = size / limit, time_us
