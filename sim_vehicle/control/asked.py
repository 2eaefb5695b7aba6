"""The setpoint as the kernels read it."""

import numpy as np

from sim_vehicle.control.setpoint import AttitudeSetpoint, RatesSetpoint, Setpoint, TrajectorySetpoint
from sim_vehicle.physics.layout import ASKED_ATTITUDE, ASKED_RATES, ASKED_TRAJECTORY, SetpointRows
from sim_vehicle.physics.record import boxed, new_record
from sim_vehicle.physics.rotation import matrix_from_quaternion
from sim_vehicle.quantities import Quaternion


class AskedSetpoint:
    """A record of the kernels that follows the setpoints; `box` is what they are handed."""

    def __init__(self) -> None:
        self._asked = new_record(SetpointRows)
        self.box = boxed(self._asked)
        # Views into the record, taken once: looking a field up in Python costs microseconds.
        self._value, self._given = self._asked.value.reshape(-1), self._asked.given.reshape(-1)
        self._yaw = self._asked.yaw
        self._taken: Setpoint | None = None
        # Compiled before the flight: at its first attitude, that of a recovery, nothing would be told for 0.3 s.
        self._turn((1.0, 0.0, 0.0, 0.0))

    def take(self, setpoint: Setpoint) -> None:
        """Write the setpoint, if it is not the one that is there."""
        if setpoint is self._taken:
            return
        if isinstance(setpoint, TrajectorySetpoint):
            self._take_trajectory(setpoint)
        else:
            self._take_thrust(setpoint)
        self._taken = setpoint

    def _take_thrust(self, setpoint: AttitudeSetpoint | RatesSetpoint) -> None:
        asked = self._asked
        asked.thrust = setpoint.thrust_fraction
        if isinstance(setpoint, RatesSetpoint):
            asked.level = ASKED_RATES
            asked.rates_frd_rad_s[:] = setpoint.rates_frd_rad_s
            return
        asked.level = ASKED_ATTITUDE
        self._turn(setpoint.attitude_wxyz)
        self._yaw[:] = (0.0, 0.0, setpoint.yaw_rate_rad_s)

    def _turn(self, attitude_wxyz: Quaternion) -> None:
        matrix_from_quaternion(np.array([0.0] * 6 + [*attitude_wxyz]), self._asked.attitude)

    def _take_trajectory(self, setpoint: TrajectorySetpoint) -> None:
        if self._asked.level != ASKED_TRAJECTORY:
            self._asked.level = ASKED_TRAJECTORY
        asked = (*setpoint.position_ned_m, *setpoint.velocity_ned_m_s, *setpoint.acceleration_ned_m_s2)
        self._value[:] = [0.0 if value is None else value for value in asked]
        self._given[:] = [value is not None for value in asked]
        self._yaw[:] = (setpoint.yaw_rad or 0.0, setpoint.yaw_rad is not None, setpoint.yaw_rate_rad_s or 0.0)
