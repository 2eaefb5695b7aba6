"""A weak force on a vehicle that hovers, or just did: a person's hand, or a soft strike.

They differ in how the force begins. An arm takes 80 ms and more to push; a hand that grips stops the small speed of a
hover. An obstacle strikes with its own speed, and its force is there from one sample to the next. So a force is
observed for a moment, and is a strike as soon as it jumps.
"""

import math
from dataclasses import dataclass

from companion.detection.classify import hovers
from companion.messages import Vector3

# A vehicle counts as hovering for this time after it hovered: pushed by a hand with 2 m/s^2 it soon moves.
HOVERED_US = 500_000
# A steady hand's force is learnt as if it were drag, and shows again when it lets go. Within this time it is the same
# hand.
HAND_US = 2_000_000
# A jump may lie in two averaging windows of a fast stream. In 20 ms a hand's force of 6 m/s^2 changes by 2.3.
JUMP_OVER_US = 21_000
# Least jump, in thresholds of at least 1.75 m/s^2. A grip of 30 N s/m stops a kilogram that drifts at 0.1 m/s with
# 2.7 m/s^2, plus noise.
JUMP = 2.4
# Least rate jump, and per second between the samples. A hand's torque rises slowly, too: less than half of what motors
# do. A struck guard turns the vehicle by more.
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
        """Take one sample, after its detection step."""
        self.before_us, self.before = self.last_us, self.last
        self.last_us, self.last = time_us, f

    def velocity(self, time_us: int, velocity_ned_m_s: Vector3) -> None:
        if hovers(velocity_ned_m_s):
            self.hovered_boot_us = time_us

    def fired(self, time_us: int, is_hand: bool) -> None:
        """Note that a contact was reported."""
        self.since_boot_us, self.is_hand = None, is_hand
        if is_hand:
            self.hand_boot_us = time_us

    def may_be_hand(self, time_us: int) -> bool:
        return time_us - self.hovered_boot_us < HOVERED_US or time_us - self.hand_boot_us < HAND_US

    def jumps(self, time_us: int, f: Vector3, threshold_m_s2: float) -> bool:
        """Whether the force changed over one sample, or over two, by more than a hand's does."""
        least = JUMP * threshold_m_s2
        if math.dist(f, self.last) >= least:
            return True
        return time_us - self.before_us < JUMP_OVER_US and math.dist(f, self.before) >= least

    def turns(self, time_us: int, rate_step_rad_s: float) -> bool:
        """Whether the rate jump since the sample before exceeds a hand's."""
        return rate_step_rad_s >= TURN_RAD_S + TURN_RAD_S2 * 1e-6 * (time_us - self.last_us)

    def looked_at_us(self, time_us: int, free_until_us: int) -> int:
        """How long the present uncertain force has been observed, us."""
        if self.since_boot_us is None:
            self.since_boot_us, self.free_until_us = time_us, free_until_us
        return time_us - self.since_boot_us
