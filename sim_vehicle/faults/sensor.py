"""Faults of the inertial sensor and what shakes it."""

import math

import numpy as np

from sim_vehicle.airframe import ARMS
from sim_vehicle.faults.group import Group
from sim_vehicle.faults.spec import ImuBias, ImuStuck, Vibration
from sim_vehicle.physics.layout import Disturbance, PlantState

_AXES = ("accelerometer_x", "accelerometer_y", "accelerometer_z", "gyroscope_x", "gyroscope_y", "gyroscope_z")


class Shaking(Group[Vibration]):
    """Vibration of the rotors, several sources of it adding as powers do."""

    def act(self, time_s: float, state: PlantState, disturbance: Disturbance) -> None:
        squares = np.zeros((2, ARMS))
        for vibration in self._faults:
            start_s, end_s = vibration.window_s
            if not start_s <= time_s < end_s:
                continue
            # Rotors of which none keeps step with another: their powers add.
            motors, share = (slice(0, ARMS), 1.0 / ARMS) if vibration.motor is None else (vibration.motor, 1.0)
            squares[0, motors] += share * vibration.accelerometer_rms_m_s2**2
            squares[1, motors] += share * vibration.gyroscope_rms_rad_s**2
            disturbance.shake_hz = vibration.motor_hz
        disturbance.shake_m_s2[:], disturbance.shake_rad_s[:] = np.sqrt(squares)
        disturbance.shakes = int(squares.any())

    @staticmethod
    def scatter(state: PlantState, rng: np.random.Generator) -> None:
        """Let the rotors start at different places of their turn."""
        state.rotor_phase[:] = rng.uniform(0.0, 2.0 * math.pi, ARMS)


class InertialSensor(Group[ImuBias | ImuStuck]):
    """Zeros that move and axes that are stuck."""

    def __init__(self, raw_per_interval: int) -> None:
        super().__init__()
        self._raw_per_interval = raw_per_interval

    def act(self, time_s: float, state: PlantState, disturbance: Disturbance) -> None:
        biases, stuck = np.zeros(6), np.zeros(6, np.int64)
        for fault in self._faults:
            start_s, end_s = fault.window_s
            if not start_s <= time_s < end_s:
                continue
            if isinstance(fault, ImuBias):
                biases += [*fault.accelerometer_frd_m_s2, *fault.gyroscope_frd_rad_s]
                continue
            axis = _AXES.index(fault.axis)
            stuck[axis] = 1
            if not disturbance.stuck[axis]:
                sums = state.specific_force_sum if axis < 3 else state.rate_sum
                last = float(sums[axis % 3]) / self._raw_per_interval
                disturbance.stuck_at[axis] = last if fault.value is None else fault.value
        disturbance.accelerometer_bias_frd_m_s2[:] = biases[:3]
        disturbance.gyroscope_bias_frd_rad_s[:] = biases[3:]
        disturbance.stuck[:] = stuck
