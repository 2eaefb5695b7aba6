"""The integrated accelerometer: v' = R f + g, with the reported attitude carried on by the body rates."""

from dataclasses import dataclass

from companion.messages import Quaternion, Vector3
from companion.motion.rotation import body_to_ned, ned_to_body, turned

GRAVITY_M_S2 = 9.80665
LEVEL: Quaternion = (1.0, 0.0, 0.0, 0.0)
ZERO: Vector3 = (0.0, 0.0, 0.0)
# A longer gap restarts the integral: two samples of 20 Hz, the least rate of HIGHRES_IMU. An attitude further from a
# sample is not carried on to it.
LONGEST_GAP_US = 100_000
# Largest lag of a velocity that is compared with the integral (optical flow with an output predictor: 20 ms).
LONGEST_DELAY_US = 40_000
# Cosine of 15 degrees: about the tilt error of a real PX4 after 7.8 m/s were clipped (bench/notes/px4.md). Beyond it
# the gyroscopes are wrong.
MOST_WRONG = 0.966
# Largest angular acceleration by motors, rad/s^2, and its share about yaw, where only their drag turns the vehicle.
MOTORS_RAD_S2, YAW_SHARE = 100.0, 0.3


@dataclass(slots=True)
class Strapdown:
    """Changed only by `attitude` and `imu`. Times: vehicle's boot clock; vectors local NED."""

    attitude_wxyz: Quaternion = LEVEL
    """As last reported, valid or not."""
    time_boot_us: int = 0
    rates_frd_rad_s: Vector3 = ZERO
    acceleration_ned_m_s2: Vector3 = ZERO
    sum_ned_m_s: Vector3 = ZERO
    valid_wxyz: Quaternion = LEVEL
    """At the newest sample: the last valid attitude, carried on by the rates.

    An estimator that corrects its velocity takes part of the error for a tilt; gyroscopes do not. After 2.4 m/s were
    clipped, a real PX4's tilt was wrong by 4 degrees for more than a second (bench/notes/px4.md).
    """
    level_acceleration_m_s2: Vector3 = ZERO
    """Horizontal acceleration, NED, of a vehicle that is level by its reported attitude; zero while that is valid."""

    def attitude(self, time_us: int, attitude_wxyz: Quaternion, is_valid: bool = True) -> None:
        behind_us, self.attitude_wxyz = self.time_boot_us - time_us, attitude_wxyz
        if abs(behind_us) < LONGEST_GAP_US:
            attitude_wxyz = turned(attitude_wxyz, self.rates_frd_rad_s, 1e-6 * behind_us)
        n, e, d = body_to_ned(self.valid_wxyz, ned_to_body(attitude_wxyz, (0.0, 0.0, -1.0)))
        if is_valid or -d < MOST_WRONG:
            self.valid_wxyz, self.level_acceleration_m_s2 = attitude_wxyz, ZERO
        else:
            self.level_acceleration_m_s2 = (-GRAVITY_M_S2 * n / d, -GRAVITY_M_S2 * e / d, 0.0)

    def imu(self, time_us: int, f: Vector3, w: Vector3) -> bool:
        """Integrate one sample (body FRD); False where a gap restarted the integral."""
        elapsed_us = time_us - self.time_boot_us
        whole, half_s = 0 < elapsed_us < LONGEST_GAP_US, 0.5e-6 * elapsed_us
        if whole:
            p, q, r = self.rates_frd_rad_s
            self.valid_wxyz = turned(self.valid_wxyz, (p + w[0], q + w[1], r + w[2]), half_s)
        else:
            self.valid_wxyz = self.attitude_wxyz
        a_n, a_e, a_d = body_to_ned(self.valid_wxyz, f)
        a_d += GRAVITY_M_S2
        if whole:
            b_n, b_e, b_d = self.acceleration_ned_m_s2
            n, e, d = self.sum_ned_m_s
            self.sum_ned_m_s = (n + half_s * (a_n + b_n), e + half_s * (a_e + b_e), d + half_s * (a_d + b_d))
        self.acceleration_ned_m_s2 = (a_n, a_e, a_d)
        self.rates_frd_rad_s = w
        self.time_boot_us = time_us
        return whole

    def sum_at(self, time_us: int) -> Vector3 | None:
        """The sum at a time near the newest sample; None where it is not near."""
        ahead_us = time_us - self.time_boot_us
        if not -LONGEST_GAP_US < ahead_us < LONGEST_GAP_US:
            return None
        s, a, ahead_s = self.sum_ned_m_s, self.acceleration_ned_m_s2, ahead_us * 1e-6
        return (s[0] + ahead_s * a[0], s[1] + ahead_s * a[1], s[2] + ahead_s * a[2])
