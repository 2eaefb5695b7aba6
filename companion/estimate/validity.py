"""Validity of the vehicle's velocity estimate. After a hit that was not measured whole it is not valid for a while.

A clipped accelerometer hides a part of the hit from PX4's velocity. PX4's estimator corrects this in a swing that looks
like another hit. On a real PX4 the velocity was wrong by up to 7.8 m/s. It stayed so for 0.1 s, overshot by a fifth
after 0.7 s, and the tilt was wrong for seconds. During the correction velocity and accelerometer contradict each other.

The detector uses this validity: it must not take that swing for a second hit. A recovery needs a velocity sooner, and
knows the normal and the expected rebound: it uses `reflex.motion_estimator`.
"""

import math
from collections.abc import Sequence
from dataclasses import dataclass

from companion.messages import Vector3
from companion.motion.inertial import VelocityFix, less_sum

# PX4's estimator begins to correct itself after 0.14 s. Its swing passes the true value at about 0.5 s.
UNCORRECTED_US = 140_000
LEAST_US = 600_000
# By then a wrong tilt has decayed from 15 degrees, after 4.2 m/s, to the two degrees of agreement (0.5 per second,
# bench/notes/px4.md).
MOST_US = 4_500_000
# Velocity and accelerometer must agree over this time. The swing's turning points are shorter.
AGREE_US = 300_000
# Twice the noise of a good velocity estimate, 0.03 m/s, and an accelerometer's error of 0.3 m/s^2 over that time.
AGREE_M_S = 0.15
# A tilt of 1.2 degrees: gyroscopes with a bias of 0.5 degrees a second drift by it in 2.4 s.
AGREE_M_S2 = 0.2


@dataclass(slots=True)
class VelocityValidity:
    """Changed only by its methods. Times: vehicle's boot clock."""

    invalid_since_boot_us: int | None = None
    """Time of the latest hit that was not measured whole."""
    _is_again: bool = False
    """Whether the velocity was invalid already when the latest hit came: an earlier hit's part stays hidden."""

    @property
    def is_valid(self) -> bool:
        return self.invalid_since_boot_us is None

    def is_attitude_valid(self, time_us: int) -> bool:
        """Whether the attitude is valid: no hit is being corrected, or the correction cannot have begun."""
        since_us = self.invalid_since_boot_us
        return since_us is None or (not self._is_again and time_us - since_us < UNCORRECTED_US)

    def invalidate(self, time_us: int) -> None:
        """A new hit: the velocity is not valid until the hit is known to be measured whole."""
        self._is_again, self.invalid_since_boot_us = not self.is_valid, time_us

    def assess(self, is_fully_measured: bool, time_us: int) -> None:
        """Take whether the latest hit was measured whole, as known by now."""
        if not is_fully_measured:
            self.invalid_since_boot_us = self.invalid_since_boot_us or time_us
        elif not self._is_again:
            self.invalid_since_boot_us = None

    def update(self, fixes: Sequence[VelocityFix], level_acceleration_m_s2: Vector3) -> None:
        """Take the newest velocity, and the acceleration of a vehicle that is level by its own attitude, NED.

        While velocity and accelerometer agree, the velocity minus the accelerometer's integral is constant. After
        MOST_US the velocity is valid in any case.
        """
        since_us, now_us = self.invalid_since_boot_us, fixes[-1].time_boot_us
        if since_us is None or now_us - since_us <= LEAST_US:
            return
        recent = [fix for fix in fixes if now_us - fix.time_boot_us <= AGREE_US]
        axes = zip(*map(less_sum, recent), strict=True)
        is_long = now_us - recent[0].time_boot_us >= AGREE_US // 2
        agrees = is_long and all(max(axis) - min(axis) < AGREE_M_S for axis in axes)
        if (agrees and math.hypot(*level_acceleration_m_s2) < AGREE_M_S2) or now_us - since_us > MOST_US:
            self.invalid_since_boot_us = None
