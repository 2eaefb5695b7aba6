"""The integrated accelerometer: v' = R f + g, with the reported attitude carried on by the body rates.

The vehicle's velocities stand beside it. While the two agree, velocity minus integral is constant.
"""

import math
from collections import deque
from dataclasses import dataclass, field

from companion.messages import LocalPosition, Odometry, Quaternion, Vector3
from companion.motion.config import CURRENT_US, GRAVITY_M_S2, KEPT_US, LONGEST_GAP_US
from companion.motion.rotation import body_to_ned, ned_to_body, swept_ned, turned, yaw_rad
from companion.motion.vector import ZERO, minus, plus

LEVEL: Quaternion = (1.0, 0.0, 0.0, 0.0)


@dataclass(frozen=True, slots=True)
class VelocityFix:
    """One velocity of the estimate, with the accelerometer's integral at its time; local NED."""

    time_boot_us: int
    velocity_ned_m_s: Vector3
    sum_ned_m_s: Vector3
    turns_ned_m_s: Vector3 = ZERO  # how fast the accelerometer turns about the vehicle's centre

    @property
    def less_sum_m_s(self) -> Vector3:
        """Velocity minus integral: constant while the two agree."""
        return minus(self.velocity_ned_m_s, self.sum_ned_m_s)


@dataclass(slots=True)
class Strapdown:
    """Changed only by its methods. Times: vehicle's boot clock; vectors local NED."""

    attitude_wxyz: Quaternion = LEVEL  # as last reported, valid or not
    time_boot_us: int = 0
    rates_frd_rad_s: Vector3 = ZERO
    acceleration_ned_m_s2: Vector3 = ZERO
    sum_ned_m_s: Vector3 = ZERO
    sensor_frd_m: Vector3 = ZERO  # where the accelerometer is, from the centre, about which the vehicle turns
    centre_frd_m_s2: Vector3 = ZERO  # specific force, sideways as there
    valid_wxyz: Quaternion = LEVEL
    """At the newest sample: the last valid attitude, carried on by the rates.

    An estimator that corrects its velocity takes part of the error for a tilt; gyroscopes do not. After 2.4 m/s were
    clipped, a real PX4's tilt was wrong by 4 degrees for more than a second (bench/notes/px4.md).
    """
    level_acceleration_m_s2: Vector3 = ZERO
    """Horizontal acceleration, NED, of a vehicle that is level by its reported attitude; zero while that is valid."""
    heading_error_rad: float = 0.0  # of the reported attitude; zero while that is valid
    sinks_m_s2: float = 0.0
    """By how much less than by its reported attitude a thrust of 1 g lifts; zero while that is valid."""
    fixes: deque[VelocityFix] = field(default_factory=deque)
    """Velocities without a restart of the integral or a reset of the estimator between them, the newest last."""
    has_new_fix: bool = False
    """Whether the newest velocity is one of them; while ODOMETRY comes, only its velocities are."""
    _odometry: Odometry | None = None
    _lacks_rates: bool = False
    """Whether rates were missing or wrong since an attitude was certainly right: nothing is better than the reported
    one."""

    def attitude(self, time_us: int, attitude_wxyz: Quaternion, most_wrong_rad: float = 0.0) -> None:
        """Take one reported attitude, whose tilt may be wrong by so much; one that is further off has its reason."""
        behind_us, self.attitude_wxyz = self.time_boot_us - time_us, attitude_wxyz
        if abs(behind_us) < LONGEST_GAP_US:
            attitude_wxyz = turned(attitude_wxyz, self.rates_frd_rad_s, 1e-6 * behind_us)
        n, e, d = body_to_ned(self.valid_wxyz, ned_to_body(attitude_wxyz, (0.0, 0.0, -1.0)))
        if not most_wrong_rad or self._lacks_rates or -d < math.cos(most_wrong_rad):
            self.valid_wxyz, self.level_acceleration_m_s2 = attitude_wxyz, ZERO
            self.heading_error_rad = self.sinks_m_s2 = 0.0
            self._lacks_rates = most_wrong_rad > 0.0
        else:
            self.level_acceleration_m_s2 = (-GRAVITY_M_S2 * n / d, -GRAVITY_M_S2 * e / d, 0.0)
            self.heading_error_rad = math.remainder(yaw_rad(attitude_wxyz) - yaw_rad(self.valid_wxyz), math.tau)
            told, valid = (body_to_ned(each, (0.0, 0.0, 1.0))[2] for each in (attitude_wxyz, self.valid_wxyz))
            self.sinks_m_s2 = GRAVITY_M_S2 * (told - valid)

    def imu(self, time_us: int, f: Vector3, w: Vector3, at_centre: Vector3 | None = None) -> None:
        """Integrate one sample (body FRD), whose force may be another at the centre; a gap restarts the integral."""
        elapsed_us = time_us - self.time_boot_us
        whole, half_s = 0 < elapsed_us < LONGEST_GAP_US, 0.5e-6 * elapsed_us
        if whole:
            p, q, r = self.rates_frd_rad_s
            self.valid_wxyz = turned(self.valid_wxyz, (p + w[0], q + w[1], r + w[2]), half_s)
        else:
            self.valid_wxyz, self._lacks_rates = self.attitude_wxyz, True
            self.fixes.clear()
        a_n, a_e, a_d = body_to_ned(self.valid_wxyz, f)
        a_d += GRAVITY_M_S2
        if whole:
            b_n, b_e, b_d = self.acceleration_ned_m_s2
            n, e, d = self.sum_ned_m_s
            self.sum_ned_m_s = (n + half_s * (a_n + b_n), e + half_s * (a_e + b_e), d + half_s * (a_d + b_d))
        self.time_boot_us, self.rates_frd_rad_s, self.acceleration_ned_m_s2 = time_us, w, (a_n, a_e, a_d)
        self.centre_frd_m_s2 = at_centre or f

    @property
    def turns_ned_m_s(self) -> Vector3:
        """How fast the accelerometer turns about the vehicle's centre."""
        return swept_ned(self.valid_wxyz, self.rates_frd_rad_s, self.sensor_frd_m)

    def velocity(self, sample: LocalPosition | Odometry) -> None:
        time_us, told = sample.time_boot_us, self._odometry
        self.has_new_fix, ahead_us = False, time_us - self.time_boot_us
        if isinstance(sample, Odometry):
            if told is None or sample.reset_counter != told.reset_counter:
                self.fixes.clear()
            self._odometry = sample
        elif told is not None and time_us - told.time_boot_us <= CURRENT_US:
            return
        if not -LONGEST_GAP_US < ahead_us < LONGEST_GAP_US:
            return
        in_sum = plus(self.sum_ned_m_s, ahead_us * 1e-6, self.acceleration_ned_m_s2)
        self.has_new_fix, fixes = True, self.fixes
        fixes.append(VelocityFix(time_us, sample.velocity_ned_m_s, in_sum, self.turns_ned_m_s))
        while fixes[0].time_boot_us < time_us - KEPT_US:
            fixes.popleft()
