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
# Least jump, in thresholds of at least 1.75 m/s^2. A grip of 30 N s/m stops a kilogram that drifts at 0.1 m/s with
# 2.7 m/s^2, plus noise.
JUMP = 2.4


@dataclass(slots=True)
class SoftContact:
    """Times: vehicle's boot clock; forces body FRD, m/s^2."""

    hovered_boot_us: int = -HOVERED_US
    is_hand: bool = False
    """Whether the present contact, or the latest one, was taken for a hand."""
    since_boot_us: int | None = None
    free_until_us: int = 0
    last: Vector3 = (0.0, 0.0, 0.0)
    before_us: int = 0
    before: Vector3 = (0.0, 0.0, 0.0)

    def imu(self, before_us: int, f: Vector3) -> None:
        """Take one sample, after its detection step; the one before it was at `before_us`."""
        self.before_us, self.before, self.last = before_us, self.last, f

    def velocity(self, time_us: int, velocity_ned_m_s: Vector3) -> None:
        if hovers(velocity_ned_m_s):
            self.hovered_boot_us = time_us

    def fired(self, is_hand: bool) -> None:
        """Note that a contact was reported."""
        self.since_boot_us, self.is_hand = None, is_hand

    def may_be_hand(self, time_us: int) -> bool:
        return time_us - self.hovered_boot_us < HOVERED_US

    def jumps(self, f: Vector3, threshold_m_s2: float) -> bool:
        """Whether the force changed over one sample, or over two, by more than a hand's does."""
        return any(math.dist(f, force) >= JUMP * threshold_m_s2 for force in (self.last, self.before))
