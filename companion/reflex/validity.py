"""Validity of the vehicle's velocity estimate. After a hit that was not measured whole it is not valid for a while.

A clipped accelerometer hides a part of the hit from PX4's velocity. PX4's estimator corrects this in a swing that looks
like another hit. On a real PX4 the velocity was wrong by up to 7.8 m/s. It stayed so for 0.1 s, overshot by a fifth
after 0.7 s, and the tilt was wrong for seconds.

The detector uses this validity: it must not take that swing for a second hit. A second hit jumps further than the swing
of the first one's speed. A recovery knows the normal and the expected rebound, too: it uses `reflex.motion_estimator`.
"""

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from companion.motion.config import TILT_RAD_PER_M_S
from companion.reflex.config import APPROACH_M_S, CORRECTED_US, UNCORRECTED_US
from companion.reflex.correction import error_response


@dataclass(slots=True)
class VelocityValidity:
    """Changed only by its methods. Times: vehicle's boot clock."""

    invalid_since_boot_us: int | None = None
    """Time of the latest hit that was not measured whole."""
    _is_again: bool = False
    """Whether the velocity was invalid already when the latest hit came: an earlier hit's part stays hidden."""
    _speed_m_s: float = 0.0
    """Of the latest hit, or of the hardest of those."""

    @property
    def is_valid(self) -> bool:
        return self.invalid_since_boot_us is None

    def tilt_error_rad(self, time_us: int) -> float:
        """By how much the reported tilt may be wrong: 0 if no hit is being corrected, or the correction cannot have
        begun."""
        since_us = self.invalid_since_boot_us
        is_right = since_us is None or (not self._is_again and time_us - since_us < UNCORRECTED_US)
        return 0.0 if is_right else TILT_RAD_PER_M_S * (1.0 + self._speed_m_s)

    def correction_m_s(self, times_us: Sequence[int]) -> float:
        """By how much the newest of these velocities may differ from the mean of the others, because a hit is being
        corrected: an elastic one that was hidden whole, by the worst model of an estimator. What struck a vehicle that
        stood still may have done so at any speed."""
        if self.invalid_since_boot_us is None:
            return 0.0
        if self._speed_m_s < APPROACH_M_S:
            return math.inf
        *before, newest = (error_response(1e-6 * (each - self.invalid_since_boot_us))[0] for each in times_us)
        return 2.0 * self._speed_m_s * float(np.abs(newest - sum(before) / len(before)).max())

    def invalidate(self, time_us: int, speed_m_s: float) -> None:
        """A new hit, at this speed: the velocity is not valid until the hit is known to be measured whole."""
        self._is_again, self.invalid_since_boot_us = not self.is_valid, time_us
        self._speed_m_s = max(speed_m_s, self._speed_m_s) if self._is_again else speed_m_s

    def assess(self, is_fully_measured: bool, time_us: int) -> None:
        """Take whether the latest hit was measured whole, as known by now."""
        if not is_fully_measured:
            self.invalid_since_boot_us = self.invalid_since_boot_us or time_us
        elif not self._is_again:
            self.invalid_since_boot_us = None

    def update(self, time_us: int) -> None:
        """Take the present time."""
        if self.invalid_since_boot_us is not None and time_us - self.invalid_since_boot_us > CORRECTED_US:
            self.invalid_since_boot_us = None
