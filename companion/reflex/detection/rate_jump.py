"""A rate jump: body rates that change from one sample to the next, and stay changed.

A contact beside the centre turns the vehicle at once. Failed motors and commands turn it on and on: the next step is as
large. A broken sample, and vibration, turn back with the next step.
"""

import math
from dataclasses import dataclass

from companion.messages import Vector3
from companion.motion.config import MOTORS_RAD_S2
from companion.motion.vector import ZERO
from companion.reflex.config import EVEN, SPREAD_MEMORY_S, FusedConfig
from companion.reflex.detection.detector import Innovation

_MEMORY_US, _BY_MOTORS_RAD_S_US = 1e6 * SPREAD_MEMORY_S, 1e-6 * MOTORS_RAD_S2


@dataclass(slots=True)
class RateJump(Innovation):
    """Of the step before the newest one, rad/s, and from when on it is a hit. Changed only by `imu`.

    Rates: body FRD; times: vehicle's boot clock.
    """

    rates_frd_rad_s: Vector3 = ZERO
    step_frd_rad_s: Vector3 = ZERO
    over_us: int = 0
    shared_rad2_s2: float = 0.0
    """Size of the product of that step and the one before it."""
    variance_rad2_s2: float = 0.0

    def imu(self, before_us: int, time_us: int, rates_frd_rad_s: Vector3, config: FusedConfig) -> None:
        """Take one sample; the one before it was at `before_us`.

        What a step has beyond the parts of it that its neighbours have, either way, is neither a turn that goes on nor
        one that goes back. Steps over different times, beside a lost sample, cannot tell.
        """
        p, q, r = self.rates_frd_rad_s
        a, b, c = self.step_frd_rad_s
        was_us, was_shared, elapsed_us = self.over_us, self.shared_rad2_s2, time_us - before_us
        self.rates_frd_rad_s, self.over_us = rates_frd_rad_s, elapsed_us
        x, y, z = rates_frd_rad_s
        self.step_frd_rad_s = x, y, z = x - p, y - q, z - r
        self.shared_rad2_s2 = shared = abs(x * a + y * b + z * c)
        size, self.value = math.hypot(a, b, c), 0.0
        if size == 0.0 or elapsed_us >= EVEN * was_us or was_us >= EVEN * elapsed_us:
            return
        value = size - (shared if shared > was_shared else was_shared) / size
        if value > 0.0:
            self.value = value
        spreads_rad_s = config.noise_factor * math.sqrt(self.variance_rad2_s2)
        self.limit = limit = max(config.rate_step_rad_s, _BY_MOTORS_RAD_S_US * was_us, spreads_rad_s)
        learnt, share = size if size < limit else limit, elapsed_us / (_MEMORY_US + elapsed_us)
        self.variance_rad2_s2 += share * (learnt * learnt - self.variance_rad2_s2)
