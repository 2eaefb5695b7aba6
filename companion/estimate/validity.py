"""May the vehicle's velocity be believed? After a hit that its accelerometer did not show whole, not at once.

What clipping hides of a hit is missing in PX4's velocity. Its estimator finds back in a swing that looks like another
hit. Measured on a real PX4: off by up to 7.8 m/s, unchanged for a tenth of a second, a fifth too far on the other side
after 0.7 s, and a tilt for seconds. While velocity and accelerometer contradict each other it is correcting itself.

This judges for the detector, which must not take that swing for a second hit and loses little by waiting. A recovery
has its own estimate, `reflex.motion_estimator`: it needs a velocity sooner, and knows the normal and the rebound to
expect.
"""

import math
from collections.abc import Sequence
from dataclasses import dataclass

from companion.messages import Vector3
from companion.motion.inertial import VelocityFix, less_sum

# The estimator has not yet begun to correct itself for 0.14 s, and swings through the truth at about 0.5 s.
UNCORRECTED_US = 140_000
LEAST_US = 600_000
# By then what a filter has taken for a tilt, 15 degrees after 4.2 m/s, is down to the two that agree (0.5 per second,
# bench/notes/px4.md).
MOST_US = 4_500_000
# Agreement is judged over this; the swing's turning points are shorter.
AGREE_US = 300_000
# A good velocity estimate's noise of 0.03 m/s, twice, and an accelerometer off by 0.3 m/s^2 in that time.
AGREE_M_S = 0.15
# A tilt of 1.2 degrees: what gyroscopes off by half a degree a second make of themselves in 2.4 s.
AGREE_M_S2 = 0.2


@dataclass(slots=True)
class VelocityValidity:
    """Changed only by its methods. Times: vehicle's boot clock."""

    invalid_since_boot_us: int | None = None
    """Since the latest hit; None when that was measured whole."""
    earlier_invalid_since_boot_us: int | None = None
    """Since one before it, which was still in doubt when the latest came."""

    @property
    def is_valid(self) -> bool:
        return self._since_us is None

    def is_attitude_valid(self, time_us: int) -> bool:
        """Whether the estimator cannot have begun to correct itself, and its attitude with its velocity."""
        since_us = self._since_us
        return since_us is None or (self.earlier_invalid_since_boot_us is None and time_us - since_us < UNCORRECTED_US)

    @property
    def _since_us(self) -> int | None:
        return self.earlier_invalid_since_boot_us if self.invalid_since_boot_us is None else self.invalid_since_boot_us

    def invalidate(self, time_us: int) -> None:
        """A new hit, which may have been more than was seen."""
        self.earlier_invalid_since_boot_us, self.invalid_since_boot_us = self._since_us, time_us

    def assess(self, is_fully_measured: bool, time_us: int) -> None:
        """Whether the latest hit has been measured whole, as far as it is known now; what an earlier one hid stays."""
        if is_fully_measured:
            self.invalid_since_boot_us = None
        elif self.invalid_since_boot_us is None:
            self.invalid_since_boot_us = time_us

    def restore(self) -> None:
        """The estimate agrees again."""
        self.invalid_since_boot_us = self.earlier_invalid_since_boot_us = None

    def age(self, now_us: int) -> None:
        """Doubt ends, whatever the velocities say or if none comes."""
        since_us = self._since_us
        if since_us is not None and now_us - since_us > MOST_US:
            self.restore()

    def update(self, fixes: Sequence[VelocityFix], level_acceleration_m_s2: Vector3) -> None:
        """Take the newest of the velocities: less the accelerometer's sum they stand still while the two agree. And the
        acceleration of a vehicle that is level by its attitude, as its gyroscopes show it."""
        invalid_since_us, now_us = self._since_us, fixes[-1].time_boot_us
        if (
            invalid_since_us is None
            or now_us - invalid_since_us <= LEAST_US
            or math.hypot(*level_acceleration_m_s2) >= AGREE_M_S2
        ):
            return
        recent = [fix for fix in fixes if now_us - fix.time_boot_us <= AGREE_US]
        axes = zip(*map(less_sum, recent), strict=True)
        is_long = now_us - recent[0].time_boot_us >= AGREE_US // 2
        if is_long and all(max(axis) - min(axis) < AGREE_M_S for axis in axes):
            self.restore()
