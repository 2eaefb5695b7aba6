"""The vehicle's velocities beside the integrated accelerometer.

While the two agree, velocity minus integral is constant.
"""

from collections import deque
from dataclasses import dataclass, field

from companion.messages import Attitude, ImuSample, LocalPosition, Odometry, Vector3
from companion.motion.history import CURRENT_US, KEPT_US
from companion.motion.strapdown import Strapdown


@dataclass(frozen=True, slots=True)
class VelocityFix:
    """One velocity of the estimate, with the accelerometer's integral at its time; local NED."""

    time_boot_us: int
    velocity_ned_m_s: Vector3
    sum_ned_m_s: Vector3


def less_sum(fix: VelocityFix) -> Vector3:
    """Velocity minus integral, m/s: constant while the two agree."""
    v, u = fix.velocity_ned_m_s, fix.sum_ned_m_s
    return (v[0] - u[0], v[1] - u[1], v[2] - u[2])


@dataclass(slots=True)
class Inertial:
    """Changed only by its methods. Times: vehicle's boot clock."""

    strapdown: Strapdown = field(default_factory=Strapdown)
    fixes: deque[VelocityFix] = field(default_factory=deque)
    """Velocities without a restart of the integral or a reset of the estimator between them, the newest last."""
    has_new_fix: bool = False
    """Whether the newest velocity is one of them; while ODOMETRY comes, only its velocities are."""
    _odometry_boot_us: int | None = None
    _reset_counter: int = 0

    def imu(self, sample: ImuSample) -> bool:
        """Take one sample; False where a gap restarted the integral."""
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
        elif told_us is not None and time_us - told_us <= CURRENT_US:
            return
        u = self.strapdown.sum_at(time_us)
        if u is None:
            return
        self.has_new_fix, fixes = True, self.fixes
        fixes.append(VelocityFix(time_us, sample.velocity_ned_m_s, u))
        while fixes[0].time_boot_us < time_us - KEPT_US:
            fixes.popleft()
