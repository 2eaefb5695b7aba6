"""A local frame that does not move when PX4's estimator resets its position.

Received positions are shifted back by the resets so far, sent setpoints are shifted on. So the vehicle, its setpoints
and the obstacle map stay in place. ODOMETRY counts the resets (`reset_counter`). The jump is the difference between the
position after a reset and the position to which its velocity led.
"""

import math
from dataclasses import dataclass, field, replace

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
    _shifts: dict[int, Vector3] = field(default_factory=dict)
    """Offsets by reset counter: a counter that comes back restores its offset."""
    _latest: Odometry | None = None
    _first: Odometry | None = None  # the first message with another counter than the latest's
    _place: LocalPosition | None = None  # the latest one accepted; None after a reset

    @property
    def has_shifted(self) -> bool:
        return bool(self._shifts)

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
        if isinstance(sample, LocalPosition | Odometry | PositionTarget) and sample.position_ned_m is not None:
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
            self._shifts[latest.reset_counter] = self.shift_ned_m
            over_s = (first.time_boot_us - latest.time_boot_us) * 1e-6
            jump = plus(minus(first.position_ned_m, latest.position_ned_m), -over_s, latest.velocity_ned_m_s)
            shift = self.shift_ned_m if math.hypot(*jump) > most_m else plus(self.shift_ned_m, 1.0, jump)
            self.shift_ned_m = self._shifts.get(sample.reset_counter, shift)
            self._latest, self._first, self._place = sample, None, None

    def sent(self, setpoint: Setpoint) -> Setpoint:
        """A setpoint moved from the companion's local NED, without resets, into the vehicle's."""
        if self.shift_ned_m == ZERO or isinstance(setpoint, AttitudeSetpoint):
            return setpoint
        return replace(setpoint, position_ned_m=plus(setpoint.position_ned_m, 1.0, self.shift_ned_m))
