"""What the streams send: the state of the vehicle as its messages show it."""

import math
from dataclasses import dataclass, field

import numpy as np

from sim_vehicle.autopilot.autopilot import Autopilot
from sim_vehicle.estimator.estimate import Estimate
from sim_vehicle.estimator.samples import FlowSample, RangeSample
from sim_vehicle.hil.slow_sensors import SlowSensors
from sim_vehicle.quantities import Floats, Vector3

_KEPT = 0.99
_ADDED = 1.0 - _KEPT


class VibrationMetrics:
    """Two of the three numbers of VIBRATION: slow means of how much successive samples differ.

    Source: PX4's sensors/vehicle_imu/VehicleIMU.cpp, UpdateGyroVibrationMetrics and UpdateAccelVibrationMetrics. PX4
    uses the message's fields for other things than its definition says; the third, coning, is about raw samples that
    do not get here.
    """

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


@dataclass(slots=True)
class Telemetry:
    """What the streams send: the newest sample, the last published position, and who flies."""

    sample: Estimate
    published: Estimate
    autopilot: Autopilot
    slow: SlowSensors
    vibration: VibrationMetrics
    position_variance_m2: float
    velocity_variance_m2_s2: float
    attitude_variance_rad2: float
    flow: FlowSample | None = None
    range: RangeSample | None = None
    attitude_setpoint: Floats = field(default_factory=lambda: np.eye(3))
    """The attitude control's R_d (3, 3), body to NED."""
    renewed: tuple[bool, ...] = (False, False)
    """For the message that is being made: see `StreamKind.notes`."""
    epoch_at_boot_us: int = 0
    """Unix time at the vehicle's boot."""
    system: int = 1
    """MAV_SYS_ID."""
