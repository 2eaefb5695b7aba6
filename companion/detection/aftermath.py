"""What a contact leaves behind: a step in the velocity that the accelerometer did not show.

Between two velocities the vehicle's own estimate must change as the accelerometer says (strapdown: v' = R f + g). A
contact that fell between the samples the wire carries, or into a lost one, makes the estimate jump and not the sum.
The body's rates jump with it, for a push beside the centre turns; on their own they prove nothing, because a motor
that fails turns the vehicle too.
"""

import math
from dataclasses import dataclass, field

from companion.estimate.rotation import body_to_ned
from companion.messages import Quaternion, Vector3

GRAVITY_M_S2 = 9.80665
LEVEL: Quaternion = (1.0, 0.0, 0.0, 0.0)
ZERO: Vector3 = (0.0, 0.0, 0.0)
# A spread of fewer steps than this is a guess: two thirds of a second at 30 Hz.
TRUSTED = 20
# Older than this an attitude says nothing of a vehicle that may turn at 3 rad/s.
ATTITUDE_KEPT_S = 0.1
# The velocities before the newest that it is compared with: enough to halve their noise, few enough to be recent.
COMPARED = 3
# Velocities further apart leave too much to a sum of samples that sees a quarter of the time, and to a filter's own
# corrections: at 10 Hz healthy vehicles' steps reach 0.3 m/s (four public logs). 30 Hz with a packet lost is inside.
LONGEST_STEP_S = 0.075
# A longer silence of the accelerometer leaves a hole in the sum.
LONGEST_IMU_GAP_S = 0.1
# A vehicle's velocity estimate lags by no more than this (optical flow with an output predictor: 20 ms).
LONGEST_DELAY_US = 40_000
# A step of the rates marks the gap that the contact fell into for this long: the velocity's interval and its delay.
RATE_STEP_KEPT_US = 120_000


@dataclass(slots=True)
class Aftermath:
    """Changed only by its methods. Times: vehicle's boot clock; vectors local NED."""

    attitude_wxyz: Quaternion = LEVEL
    attitude_boot_us: int = 0
    imu_boot_us: int = 0
    previous_imu_us: int = 0
    acceleration_ned_m_s2: Vector3 = ZERO
    sum_ned_m_s: Vector3 = ZERO
    rates_frd_rad_s: Vector3 = ZERO
    rate_step_rad_s: float = 0.0
    rate_step_frd_rad_s: Vector3 = ZERO
    rate_step_from_us: int = 0
    rate_step_until_us: int = 0
    residuals: list[tuple[int, float, float, float]] = field(default_factory=list)
    variance_m2_s2: float = 0.0
    known: int = 0
    unlearnt: Vector3 | None = None

    def imu(self, time_us: int, f: Vector3, w: Vector3) -> None:
        """Add one sample to the sum, in the attitude of its own time."""
        elapsed_us = time_us - self.imu_boot_us
        f_x, f_y, f_z = f
        p, q, r = w
        behind_s = (time_us - self.attitude_boot_us) * 1e-6
        if -ATTITUDE_KEPT_S < behind_s < ATTITUDE_KEPT_S:
            # Turned on by its own rates since the attitude was told: f + dt w x f.
            f = (
                f_x + behind_s * (q * f_z - r * f_y),
                f_y + behind_s * (r * f_x - p * f_z),
                f_z + behind_s * (p * f_y - q * f_x),
            )
        a_n, a_e, a_d = body_to_ned(self.attitude_wxyz, f)
        a_d += GRAVITY_M_S2
        if 0 < elapsed_us < 1e6 * LONGEST_IMU_GAP_S:
            b_n, b_e, b_d = self.acceleration_ned_m_s2
            n, e, d = self.sum_ned_m_s
            half_s = 0.5e-6 * elapsed_us
            self.sum_ned_m_s = (n + half_s * (a_n + b_n), e + half_s * (a_e + b_e), d + half_s * (a_d + b_d))
            p_0, q_0, r_0 = self.rates_frd_rad_s
            p_1, q_1, r_1 = p - p_0, q - q_0, r - r_0
            step2 = p_1 * p_1 + q_1 * q_1 + r_1 * r_1
            kept = self.rate_step_rad_s
            if step2 > kept * kept or time_us - self.rate_step_until_us > RATE_STEP_KEPT_US:
                self.rate_step_rad_s = math.sqrt(step2)
                self.rate_step_frd_rad_s = (p_1, q_1, r_1)
                self.rate_step_from_us, self.rate_step_until_us = self.imu_boot_us, time_us
        else:
            self.forget()
        self.acceleration_ned_m_s2 = (a_n, a_e, a_d)
        self.rates_frd_rad_s = w
        self.previous_imu_us, self.imu_boot_us = self.imu_boot_us, time_us

    def attitude(self, time_us: int, attitude_wxyz: Quaternion) -> None:
        self.attitude_wxyz, self.attitude_boot_us = attitude_wxyz, time_us

    def forget(self) -> None:
        """The sum has a hole, a contact in it, or the estimator was reset: what was before is no measure."""
        self.residuals.clear()

    def step_m_s(self, time_us: int, velocity_ned_m_s: Vector3) -> Vector3 | None:
        """Take one velocity: how far it is from what the recent ones and the accelerometer lead to, or None."""
        residuals = self.residuals
        if residuals and not 0 < time_us - residuals[-1][0] < 1e6 * LONGEST_STEP_S:
            residuals.clear()
        ahead_s = (time_us - self.imu_boot_us) * 1e-6
        if not -LONGEST_IMU_GAP_S < ahead_s < LONGEST_IMU_GAP_S:
            return None
        v, u, a = velocity_ned_m_s, self.sum_ned_m_s, self.acceleration_ned_m_s2
        n, e, d = v[0] - u[0] - ahead_s * a[0], v[1] - u[1] - ahead_s * a[1], v[2] - u[2] - ahead_s * a[2]
        count = len(residuals)
        step = None
        if count == COMPARED:
            (_, n_0, e_0, d_0), (_, n_1, e_1, d_1), (_, n_2, e_2, d_2) = residuals
            step = (n - (n_0 + n_1 + n_2) / 3, e - (e_0 + e_1 + e_2) / 3, d - (d_0 + d_1 + d_2) / 3)
            del residuals[0]
        residuals.append((time_us, n, e, d))
        return step

    def learn(self, step: Vector3) -> None:
        """Take in the step before this one; the newest must not hide its own successor.

        Hits are learnt, too: a vehicle whose estimate jumps again and again gets a spread that knows it. It rises fast
        and falls slowly (see `floor`).
        """
        learnt, self.unlearnt = self.unlearnt, step
        if learnt is None:
            return
        square = (learnt[0] * learnt[0] + learnt[1] * learnt[1] + learnt[2] * learnt[2]) / 3.0
        self.known = min(self.known + 1, 100)
        change = square - self.variance_m2_s2
        self.variance_m2_s2 += change / (min(self.known, 10) if change > 0.0 else self.known)

    @property
    def spread_m_s(self) -> float:
        """Of a quiet vehicle's steps, each axis; without bound until enough are known."""
        return math.sqrt(self.variance_m2_s2) if self.known >= TRUSTED else math.inf

    def rate_step_near(self, velocity_us: int) -> float:
        """The largest step of the rates from sample to sample that a jump at ``velocity_us`` may belong to."""
        return self.rate_step_rad_s if velocity_us - self.rate_step_until_us < RATE_STEP_KEPT_US else 0.0

    def contact_gap_us(self, velocity_us: int, least_rad_s: float) -> int:
        """Latest time at which the vehicle was certainly free before the step seen at ``velocity_us``."""
        if self.rate_step_near(velocity_us) >= least_rad_s:
            return self.rate_step_from_us
        before = self.residuals[-2][0] if len(self.residuals) > 1 else velocity_us
        return before - LONGEST_DELAY_US
