"""A weak force on a vehicle that hovers, or just did: a person's hand, or a soft strike.

They differ in how the force begins. An arm takes 80 ms and more to push; a hand that grips takes away the little speed
that a hover has. Whatever strikes comes with its speed, and its force is there from one sample to the next. So a force
is looked at for a moment, and is a strike as soon as it jumps.
"""

import math
from dataclasses import dataclass

from companion.detection.classify import hovers
from companion.messages import Vector3

# A vehicle that a hand pushes with 2 m/s^2 soon moves, and is let go half a second later.
HOVERED_US = 500_000
# What a hand does steadily is learnt as if it were drag, and shows again when it lets go; it was told before.
HAND_US = 2_000_000
# A jump may fall into two windows of a quick stream; in 20 ms the fastest push of 6 m/s^2 changes by 2.3.
JUMP_OVER_US = 21_000
# A grip of 30 N s/m takes the 0.1 m/s that a hovering kilogram drifts at with 2.7 m/s^2, noise comes on top: in
# thresholds, of which the least is 1.75 m/s^2.
JUMP = 2.4
# A hand turns a vehicle by what it pushes with beside the middle, and that rises slowly, too: less than half of what
# motors do, where a guard that is struck turns it by more.
TURN_RAD_S, TURN_RAD_S2 = 0.2, 80.0


@dataclass(slots=True)
class SoftContact:
    """Times: vehicle's boot clock; forces body FRD, m/s^2."""

    hovered_boot_us: int = -HOVERED_US
    is_hand: bool = False
    """Whether the present contact, or the latest one, was taken for a hand."""
    hand_boot_us: int = -HAND_US
    since_boot_us: int | None = None
    free_until_us: int = 0
    last_us: int = 0
    last: Vector3 = (0.0, 0.0, 0.0)
    before_us: int = 0
    before: Vector3 = (0.0, 0.0, 0.0)

    def imu(self, time_us: int, f: Vector3) -> None:
        """Take one sample, after it was judged."""
        self.before_us, self.before = self.last_us, self.last
        self.last_us, self.last = time_us, f

    def velocity(self, time_us: int, velocity_ned_m_s: Vector3) -> None:
        if hovers(velocity_ned_m_s):
            self.hovered_boot_us = time_us

    def fired(self, time_us: int, is_hand: bool) -> None:
        """A contact has been told."""
        self.since_boot_us, self.is_hand = None, is_hand
        if is_hand:
            self.hand_boot_us = time_us

    def may_be_hand(self, time_us: int) -> bool:
        return time_us - self.hovered_boot_us < HOVERED_US or time_us - self.hand_boot_us < HAND_US

    def jumps(self, time_us: int, f: Vector3, threshold_m_s2: float) -> bool:
        """Whether the force has changed since the sample before, or the two before, by more than a hand's does."""
        least = JUMP * threshold_m_s2
        if math.dist(f, self.last) >= least:
            return True
        return time_us - self.before_us < JUMP_OVER_US and math.dist(f, self.before) >= least

    def turns(self, time_us: int, rate_step_rad_s: float) -> bool:
        """Whether the rates have stepped since the sample before by more than a hand makes them."""
        return rate_step_rad_s >= TURN_RAD_S + TURN_RAD_S2 * 1e-6 * (time_us - self.last_us)

    def looked_at_us(self, time_us: int, free_until_us: int) -> int:
        """How long the present doubtful force has been looked at."""
        if self.since_boot_us is None:
            self.since_boot_us, self.free_until_us = time_us, free_until_us
        return time_us - self.since_boot_us
