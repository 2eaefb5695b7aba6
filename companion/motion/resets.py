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
    PositionSetpoint,
    PositionTarget,
    Refused,
    Sample,
    Vector3,
)
from companion.motion.config import CURRENT_US, STAMP_RESOLUTION_US
from companion.motion.vector import ZERO


@dataclass(slots=True)
class Resets:
    """A reset counts from its second message on, so that one forged or broken message shifts nothing."""

    shift_ned_m: Vector3 = ZERO
    """Offset from this frame to the vehicle's, m."""
    _shifts: dict[int, Vector3] = field(default_factory=dict)
    """Offsets by reset counter: a counter that comes back restores its offset."""
    _latest: Odometry | None = None
    _first: Odometry | None = None
    """The first message with another counter than the latest's."""
    _place: LocalPosition | None = None
    """The latest one accepted; None after a reset."""

    def follow(self, sample: Sample, most_m: float) -> Sample:
        """The sample in this frame. A jump of more than `most_m` does not shift it."""
        if type(sample) is Odometry:
            self._hear(sample, most_m)
        elif type(sample) is LocalPosition:
            if self._jumps(sample):
                return Refused("LOCAL_POSITION_NED", "the place jumps, and no reset is counted")
            self._place = sample
        n, e, d = self.shift_ned_m
        if self.shift_ned_m == ZERO:
            return sample
        if isinstance(sample, LocalPosition | Odometry | PositionTarget) and sample.position_ned_m is not None:
            x, y, z = sample.position_ned_m
            return replace(sample, position_ned_m=(x - n, y - e, z - d))
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
            known = self._shifts.get(sample.reset_counter)
            self.shift_ned_m = self._after(latest, first, most_m) if known is None else known
            self._latest, self._first, self._place = sample, None, None

    def _after(self, before: Odometry, first: Odometry, most_m: float) -> Vector3:
        over_s = (first.time_boot_us - before.time_boot_us) * 1e-6
        came = zip(first.position_ned_m, before.position_ned_m, before.velocity_ned_m_s, strict=True)
        jump = [p - q - over_s * v for p, q, v in came]
        if sum(part * part for part in jump) > most_m * most_m:
            return self.shift_ned_m
        n, e, d = (s + j for s, j in zip(self.shift_ned_m, jump, strict=True))
        return (n, e, d)

    def sent(self, setpoint: PositionSetpoint | AttitudeSetpoint) -> PositionSetpoint | AttitudeSetpoint:
        """A setpoint moved from the companion's local NED, without resets, into the vehicle's."""
        if self.shift_ned_m == ZERO or isinstance(setpoint, AttitudeSetpoint):
            return setpoint
        x, y, z = (p + s for p, s in zip(setpoint.position_ned_m, self.shift_ned_m, strict=True))
        return replace(setpoint, position_ned_m=(x, y, z))
