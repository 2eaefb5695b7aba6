"""The extended Kalman filter: inertial samples predict, everything else corrects.

filterpy's `ExtendedKalmanFilter` estimates the error of a state that is carried along beside it
(`strapdown.py`), as PX4's EKF2 does for the attitude: the error is small, so its model is nearly linear, and
an attitude stays one.
"""

import numpy as np
from filterpy.kalman import ExtendedKalmanFilter

from sim_vehicle.airframe import Airframe
from sim_vehicle.estimator import strapdown
from sim_vehicle.estimator.sensors import wrapped
from sim_vehicle.quantities import Floats, Quaternion, Vector3

# A vehicle on its feet on flat ground stands level to about two degrees, heels and gravel included.
FIRST_TILT_RAD = 0.03
# It begins where its local frame begins.
FIRST_POSITION_M = 0.01
FIRST_VELOCITY_M_S = 0.01
# What is forgotten may be this far off: beside it, a sensor's noise is nothing.
ANYWHERE_M = 1e3


class NavigationFilter:
    """State and covariance at the time of the last inertial sample used."""

    def __init__(
        self, airframe: Airframe, position_ned_m: Vector3, velocity_ned_m_s: Vector3, attitude_wxyz: Quaternion
    ) -> None:
        imu, tuning = airframe.imu, airframe.estimator
        self._step_s = step_s = 1e-6 * imu.integration_interval_us
        self._noise = np.array(
            [
                imu.gyroscope_noise_rad_s * step_s,
                imu.accelerometer_noise_m_s2 * step_s,
                tuning.gyroscope_bias_walk_rad_s2 * np.sqrt(step_s),
                tuning.accelerometer_bias_walk_m_s3 * np.sqrt(step_s),
                tuning.clipped_excess_m_s2 * 1e-6 * imu.raw_interval_us,
            ]
        )
        self.nominal = np.zeros(strapdown.NOMINAL_ROWS)
        self.nominal[strapdown.POSITION : strapdown.POSITION + 3] = position_ned_m
        self.nominal[strapdown.VELOCITY : strapdown.VELOCITY + 3] = velocity_ned_m_s
        self.nominal[strapdown.QUATERNION : strapdown.QUATERNION + 4] = attitude_wxyz
        self._ekf = ekf = ExtendedKalmanFilter(strapdown.ERROR_ROWS, 1)
        ekf.x = np.zeros(strapdown.ERROR_ROWS)
        ekf.Q = np.zeros((strapdown.ERROR_ROWS, strapdown.ERROR_ROWS))
        first = np.zeros(strapdown.ERROR_ROWS)
        first[strapdown.D_ATTITUDE : strapdown.D_ATTITUDE + 3] = FIRST_TILT_RAD
        first[strapdown.D_VELOCITY : strapdown.D_VELOCITY + 3] = FIRST_VELOCITY_M_S
        first[strapdown.D_POSITION : strapdown.D_POSITION + 3] = FIRST_POSITION_M
        first[strapdown.D_GYROSCOPE : strapdown.D_GYROSCOPE + 3] = imu.gyroscope_bias_rad_s
        first[strapdown.D_ACCELEROMETER : strapdown.D_ACCELEROMETER + 3] = imu.accelerometer_bias_m_s2
        ekf.P = np.diag(first**2)

    @property
    def covariance(self) -> Floats:
        """P of the error (ERROR_ROWS squared)."""
        covariance: Floats = self._ekf.P
        return covariance

    def predict(self, sample: Floats) -> None:
        """Carry state and covariance through one inertial sample (SAMPLE_COLUMNS,)."""
        ekf = self._ekf
        strapdown.advance(self.nominal, sample, self._step_s, self._noise, ekf.F, ekf.Q)
        ekf.predict()

    # --- corrections: each says whether it was fused -------------------------------------------------------

    def fuse_flow(self, flow_rad: tuple[float, float], noise_rad: float, gate: float) -> bool:
        """Angle by which the ground has moved past, turns taken out, since `begin_flow`."""
        innovation = np.array(flow_rad) - self.nominal[strapdown.FLOW : strapdown.FLOW + 2]
        return self._fuse(innovation, _PICK_FLOW, noise_rad**2, gate)

    def begin_flow(self) -> None:
        """Begin the integral of a new flow sample."""
        self.nominal[strapdown.FLOW : strapdown.FLOW + 2] = 0.0
        self._forget(slice(strapdown.D_FLOW, strapdown.D_FLOW + 2), 0.0)

    def fuse_range(self, distance_m: float, noise_m: float, gate: float) -> bool:
        """Distance along the down axis to the ground."""
        row = np.empty((1, strapdown.ERROR_ROWS))
        innovation = np.array([distance_m - strapdown.down_range(self.nominal, row[0])])
        return self._fuse(innovation, row, noise_m**2, gate)

    def fuse_heading(self, yaw_rad: float, noise_rad: float, gate: float) -> bool:
        """Heading of the nose."""
        row = np.empty((1, strapdown.ERROR_ROWS))
        innovation = np.array([wrapped(yaw_rad - strapdown.heading(self.nominal, row[0]))])
        return self._fuse(innovation, row, noise_rad**2, gate)

    def fuse_position(self, position_ned_m: Vector3, noise_m: float, gate: float) -> bool:
        """Position as motion capture sees it."""
        innovation = np.array(position_ned_m) - self.nominal[strapdown.POSITION : strapdown.POSITION + 3]
        return self._fuse(innovation, _PICK_POSITION, noise_m**2, gate)

    def fuse_rest(self, mean_rates_frd_rad_s: Floats, speed_noise_m_s: float, rate_noise_rad_s: float) -> None:
        """The vehicle stands still: no velocity, and what the gyroscope shows is its bias."""
        still = -self.nominal[strapdown.VELOCITY : strapdown.VELOCITY + 3]
        self._fuse(still, _PICK_VELOCITY, speed_noise_m_s**2, np.inf)
        bias = mean_rates_frd_rad_s - self.nominal[strapdown.GYROSCOPE_BIAS : strapdown.GYROSCOPE_BIAS + 3]
        self._fuse(bias, _PICK_GYROSCOPE, rate_noise_rad_s**2, np.inf)

    def _fuse(self, innovation: Floats, h: Floats, variance: float, gate: float) -> bool:
        """Correct by ``innovation`` = h error + noise, unless one of its values lies beyond the gate."""
        ekf = self._ekf
        r = variance * _UNIT[len(innovation)]
        s = h @ ekf.P @ h.T + r
        farthest = [gate**2 * expected for expected in s.diagonal().tolist()]
        accepted = all(value * value <= most for value, most in zip(innovation.tolist(), farthest, strict=True))
        if accepted:
            ekf.update(innovation, lambda _: h, lambda error: h @ error, R=r)
            strapdown.correct(self.nominal, ekf.x)
        return accepted

    # --- resets ---------------------------------------------------------------------------------------------

    def reset_horizontal_velocity(self, flow_rad: tuple[float, float], seconds: float, noise_rad: float) -> None:
        """Take the flow's word for the velocity: move it by what would explain the whole innovation."""
        row = np.empty(strapdown.ERROR_ROWS)
        distance_m = strapdown.down_range(self.nominal, row)
        about_x, about_y = (flow_rad[i] - float(self.nominal[strapdown.FLOW + i]) for i in range(2))
        w, x, y, z = self.nominal[strapdown.QUATERNION : strapdown.QUATERNION + 4].tolist()
        forward, right = distance_m * about_y / seconds, -distance_m * about_x / seconds
        self.nominal[strapdown.VELOCITY] += (1 - 2 * (y * y + z * z)) * forward + 2 * (x * y - w * z) * right
        self.nominal[strapdown.VELOCITY + 1] += 2 * (x * y + w * z) * forward + (1 - 2 * (x * x + z * z)) * right
        self._forget(slice(strapdown.D_VELOCITY, strapdown.D_VELOCITY + 2), distance_m * noise_rad / seconds)

    def forget_height(self) -> None:
        """Let the next distance say it."""
        self._forget(slice(strapdown.D_POSITION + 2, strapdown.D_POSITION + 3), ANYWHERE_M)

    def forget_position(self, speed_noise_m_s: float) -> None:
        """Let motion capture say it; the velocity that led astray is open again."""
        self._forget(slice(strapdown.D_POSITION, strapdown.D_POSITION + 3), ANYWHERE_M)
        self._forget(slice(strapdown.D_VELOCITY, strapdown.D_VELOCITY + 3), speed_noise_m_s)

    def _forget(self, rows: slice, deviation: float) -> None:
        """Make rows of the error independent of everything else, with the standard deviation given."""
        p = self._ekf.P
        p[rows, :] = 0.0
        p[:, rows] = 0.0
        p[rows, rows] = np.eye(rows.stop - rows.start) * deviation**2


def _pick(start: int, size: int) -> Floats:
    """The matrix H of a measurement that is the error's rows from ``start`` on."""
    return np.eye(strapdown.ERROR_ROWS)[start : start + size].copy()


# The shape of the noise of 1 to 3 values.
_UNIT = {size: np.eye(size) for size in (1, 2, 3)}
_PICK_FLOW = _pick(strapdown.D_FLOW, 2)
_PICK_POSITION = _pick(strapdown.D_POSITION, 3)
_PICK_VELOCITY = _pick(strapdown.D_VELOCITY, 3)
_PICK_GYROSCOPE = _pick(strapdown.D_GYROSCOPE, 3)
