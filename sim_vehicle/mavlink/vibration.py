"""Two of the three numbers of VIBRATION: slow means of how much successive samples differ.

Source: PX4's sensors/vehicle_imu/VehicleIMU.cpp, UpdateGyroVibrationMetrics and
UpdateAccelVibrationMetrics. PX4 uses the message's fields for other things than its definition says;
the third, coning, is about raw samples that do not get here.
"""

import math

from sim_vehicle.setpoint import Vector3

_KEPT = 0.99
_ADDED = 1.0 - _KEPT


class VibrationMetrics:
    """Means over all samples; update with every one of them."""

    def __init__(self) -> None:
        self.gyroscope_rad_s = 0.0
        self.accelerometer_m_s2 = 0.0
        self._force: Vector3 = (0.0, 0.0, 0.0)
        self._rate: Vector3 = (0.0, 0.0, 0.0)

    def update(self, specific_force_frd_m_s2: Vector3, angular_velocity_frd_rad_s: Vector3) -> None:
        """Take one sample."""
        jolt = math.dist(specific_force_frd_m_s2, self._force)
        twist = math.dist(angular_velocity_frd_rad_s, self._rate)
        self.accelerometer_m_s2 = _KEPT * self.accelerometer_m_s2 + _ADDED * jolt
        self.gyroscope_rad_s = _KEPT * self.gyroscope_rad_s + _ADDED * twist
        self._force = specific_force_frd_m_s2
        self._rate = angular_velocity_frd_rad_s
