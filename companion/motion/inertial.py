"""The accelerometer's sum and the vehicle's own velocities beside it, heard once for all who judge by them.

Between two velocities the estimate changes as the accelerometer says: velocity less sum stands still while they agree.
"""

from collections import deque
from dataclasses import dataclass, field

from companion.messages import Attitude, ImuSample, LocalPosition, Odometry, Vector3
from companion.motion.history import ODOMETRY_KEPT_US
from companion.motion.strapdown import Strapdown

# What shows a hit, or denies it, lies within three tenths of a second of it.
KEPT_US = 1_000_000


@dataclass(frozen=True, slots=True)
class VelocityFix:
    """One velocity of the estimate with the accelerometer's sum and mean at its stamp; local NED."""

    time_boot_us: int
    velocity_ned_m_s: Vector3
    sum_ned_m_s: Vector3
    acceleration_ned_m_s2: Vector3


def less_sum(fix: VelocityFix) -> Vector3:
    """What the velocity says beyond the accelerometer: constant while the two agree."""
    v, u = fix.velocity_ned_m_s, fix.sum_ned_m_s
    return (v[0] - u[0], v[1] - u[1], v[2] - u[2])


@dataclass(slots=True)
class Inertial:
    """Changed only by its methods. Times: vehicle's boot clock."""

    strapdown: Strapdown = field(default_factory=Strapdown)
    fixes: deque[VelocityFix] = field(default_factory=deque)
    """Between which neither sum nor velocity has jumped by itself, the newest last."""
    has_new_fix: bool = False
    """Whether the newest velocity is one of them: while ODOMETRY comes, its are the ones to go by."""
    _odometry_boot_us: int | None = None
    _reset_counter: int = 0

    def imu(self, sample: ImuSample) -> bool:
        """Take one sample; False where a hole in the stream made the sum begin anew."""
        whole = self.strapdown.imu(
            sample.time_boot_us, sample.specific_force_frd_m_s2, sample.angular_velocity_frd_rad_s
        )
        if not whole:
            self.fixes.clear()
        return whole

    def attitude(self, sample: Attitude, is_valid: bool = True) -> None:
        """Take one attitude; see `Strapdown`."""
        self.strapdown.attitude(sample.time_boot_us, sample.attitude_wxyz, is_valid)

    def velocity(self, sample: LocalPosition | Odometry) -> None:
        """Take one velocity."""
        time_us, told_us = sample.time_boot_us, self._odometry_boot_us
        self.has_new_fix = False
        if isinstance(sample, Odometry):
            if told_us is None or sample.reset_counter != self._reset_counter:
                self.fixes.clear()
            self._odometry_boot_us, self._reset_counter = time_us, sample.reset_counter
        elif told_us is not None and time_us - told_us <= ODOMETRY_KEPT_US:
            return
        u = self.strapdown.sum_at(time_us)
        if u is None:
            return
        self.has_new_fix, fixes = True, self.fixes
        fixes.append(VelocityFix(time_us, sample.velocity_ned_m_s, u, self.strapdown.acceleration_ned_m_s2))
        while fixes[0].time_boot_us < time_us - KEPT_US:
            fixes.popleft()
