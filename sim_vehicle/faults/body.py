"""Faults of the vehicle's body: motors, supply, load, pushes, and the inertial sensor and what shakes it."""

import math

import numpy as np

from sim_vehicle.airframe import MOST_ROTORS
from sim_vehicle.faults import spec
from sim_vehicle.faults.group import Group
from sim_vehicle.faults.wind import risen
from sim_vehicle.physics.layout import Disturbance, PlantState

_AXES = ("accelerometer_x", "accelerometer_y", "accelerometer_z", "gyroscope_x", "gyroscope_y", "gyroscope_z")


class Motors(Group[spec.MotorFailure | spec.FreeFall | spec.BatterySag]):
    """What each motor gives of what it is commanded."""

    def __init__(self) -> None:
        super().__init__()
        self.voltage_share = 1.0

    def act(self, time_s: float, state: PlantState, disturbance: Disturbance) -> None:
        shares, self.voltage_share = [1.0] * MOST_ROTORS, 1.0
        for fault in self._faults:
            start_s, end_s = fault.window_s
            if time_s < start_s:
                continue
            if isinstance(fault, spec.BatterySag):
                # A propeller's speed goes with voltage, its thrust with the square of its speed.
                fallen = min((time_s - start_s) / (end_s - start_s), 1.0)
                voltage_share = 1.0 - fallen * (1.0 - fault.voltage_share)
                self.voltage_share *= voltage_share
                shares = [share * voltage_share**2 for share in shares]
            elif time_s < end_s and isinstance(fault, spec.MotorFailure):
                shares[fault.motor] *= fault.thrust_share
            elif time_s < end_s:
                shares = [0.0] * MOST_ROTORS
        disturbance.motor_share[:] = shares


class Load(Group[spec.PayloadDrop]):
    """What the vehicle still carries."""

    def act(self, time_s: float, state: PlantState, disturbance: Disturbance) -> None:
        disturbance.carried_kg = sum(drop.mass_kg for drop in self._faults if time_s < drop.window_s[0])


class Pushes(Group[spec.Push]):
    """Forces on a point of the body, one at a time."""

    def act(self, time_s: float, state: PlantState, disturbance: Disturbance) -> None:
        """Write the force (NED, N) and its point (FRD, m) at this boot time into ``disturbance``."""
        disturbance.pushes = 0
        for push in self.acting(time_s):
            share = risen(time_s, *push.window_s, push.rise_s) if push.rise_s > 0.0 else 1.0
            disturbance.pushes = 1
            disturbance.push_ned_n[:] = share * np.array(push.force_ned_n)
            disturbance.push_point_frd_m[:] = push.point_frd_m


class Shaking(Group[spec.Vibration]):
    """Vibration of the rotors, several sources of it adding as powers do."""

    def __init__(self, rotors: int) -> None:
        super().__init__()
        self._rotors = rotors

    def act(self, time_s: float, state: PlantState, disturbance: Disturbance) -> None:
        squares = np.zeros((2, MOST_ROTORS))
        for vibration in self.acting(time_s):
            # Rotors of which none keeps step with another: their powers add.
            motors, share = (slice(0, self._rotors), 1.0 / self._rotors)
            if vibration.motor is not None:
                motors, share = slice(vibration.motor, vibration.motor + 1), 1.0
            squares[0, motors] += share * vibration.accelerometer_rms_m_s2**2
            squares[1, motors] += share * vibration.gyroscope_rms_rad_s**2
            disturbance.shake_hz = vibration.motor_hz
        disturbance.shake_m_s2[:], disturbance.shake_rad_s[:] = np.sqrt(squares)
        disturbance.shakes = int(squares.any())

    def scatter(self, state: PlantState, rng: np.random.Generator) -> None:
        """Let the rotors start at different places of their turn."""
        state.rotor_phase[: self._rotors] = rng.uniform(0.0, 2.0 * math.pi, self._rotors)


class InertialSensor(Group[spec.ImuBias | spec.ImuStuck]):
    """Zeros that move and axes that are stuck."""

    def __init__(self, raw_per_interval: int) -> None:
        super().__init__()
        self._raw_per_interval = raw_per_interval

    def act(self, time_s: float, state: PlantState, disturbance: Disturbance) -> None:
        biases, stuck = np.zeros(6), np.zeros(6, np.int64)
        for fault in self.acting(time_s):
            if isinstance(fault, spec.ImuBias):
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
