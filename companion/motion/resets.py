"""A local frame that does not move when PX4's estimator resets its position.

Received positions are shifted back by the resets so far, sent setpoints are shifted on. So the vehicle, its setpoints
and the obstacle map stay in place. ODOMETRY counts the resets (`reset_counter`). The jump is the difference between the
position after a reset and the position to which its velocity led.
"""

import math
from dataclasses import dataclass, replace

from companion.messages import (
    VELOCITY_M_S,
    AttitudeSetpoint,
    LocalPosition,
    Odometry,
    PositionTarget,
    Refused,
    Sample,
    Setpoint,
    Vector3,
)
from companion.motion.config import CURRENT_US, STAMP_RESOLUTION_US
from companion.motion.vector import ZERO, minus, plus

# Samples that have a place; no other changes by a reset, or counts one.
PLACES = frozenset((LocalPosition, Odometry, PositionTarget))


@dataclass(slots=True)
class Resets:
    """A reset counts from its second message on, so that one forged or broken message shifts nothing."""

    shift_ned_m: Vector3 = ZERO  # offset from this frame to the vehicle's, m
    _before: tuple[int, Vector3] | None = None
    """Counter and offset before the newest reset: that counter may come back, and restores its offset."""
    _latest: Odometry | None = None
    _first: Odometry | None = None  # the first message with another counter than the latest's
    _place: LocalPosition | None = None  # the latest one accepted; None after a reset

    @property
    def has_shifted(self) -> bool:
        return self._before is not None

    def follow(self, sample: Sample, most_m: float) -> Sample:
        """The sample in this frame. A jump of more than `most_m` does not shift it."""
        if type(sample) is Odometry:
            self._hear(sample, most_m)
        elif type(sample) is LocalPosition:
            if self._jumps(sample):
                return Refused("LOCAL_POSITION_NED", "the place jumps, and no reset is counted")
            self._place = sample
        if self.shift_ned_m == ZERO:
            return sample
        if isinstance(sample, (LocalPosition, Odometry, PositionTarget)) and sample.position_ned_m is not None:
            return replace(sample, position_ned_m=minus(sample.position_ned_m, self.shift_ned_m))
        return sample

    def _jumps(self, sample: LocalPosition) -> bool:
        """Whether a position jumps faster than any velocity of EKF2, while ODOMETRY counts no reset."""
        place, told = self._place, self._latest
        if place is None or told is None:
            return False
        over_us = sample.time_boot_us - place.time_boot_us
        if over_us < 0 or abs(sample.time_boot_us - told.time_boot_us) >= CURRENT_US:
            return False
        most_m = VELOCITY_M_S * 1e-6 * (over_us + STAMP_RESOLUTION_US)
        return math.dist(sample.position_ned_m, place.position_ned_m) > most_m

    def _hear(self, sample: Odometry, most_m: float) -> None:
        latest, first = self._latest, self._first
        if latest is None or sample.reset_counter == latest.reset_counter:
            self._latest, self._first = sample, None
        elif first is None or first.reset_counter != sample.reset_counter:
            self._first = sample
        else:
            was, self._before = self._before, (latest.reset_counter, self.shift_ned_m)
            if was is not None and was[0] == sample.reset_counter:
                self.shift_ned_m = was[1]
            elif math.hypot(*(jump := _jump_m(latest, first))) <= most_m:
                self.shift_ned_m = plus(self.shift_ned_m, 1.0, jump)
            self._latest, self._first, self._place = sample, None, None

    def sent(self, setpoint: Setpoint) -> Setpoint:
        """A setpoint moved from the companion's local NED, without resets, into the vehicle's."""
        if self.shift_ned_m == ZERO or isinstance(setpoint, AttitudeSetpoint):
            return setpoint
        return replace(setpoint, position_ned_m=plus(setpoint.position_ned_m, 1.0, self.shift_ned_m))


def _jump_m(before: Odometry, after: Odometry) -> Vector3:
    """By how much a reset has moved the place; zero after a silence, in which the vehicle itself has moved."""
    over_us = after.time_boot_us - before.time_boot_us
    if not 0 <= over_us < CURRENT_US:
        return ZERO
    flown_m_s = plus(before.velocity_ned_m_s, 1.0, after.velocity_ned_m_s)
    return plus(minus(after.position_ned_m, before.position_ned_m), -0.5e-6 * over_us, flown_m_s)
