"""A vehicle in straight flight, for single hits."""

import math

from sim_vehicle.airframe import Airframe
from sim_vehicle.physics.layout import GRAVITY_M_S2
from sim_vehicle.physics.plant import Plant, PlantOutput
from sim_vehicle.scene import Scene
from sim_vehicle.setpoint import FREE, TrajectorySetpoint
from sim_vehicle.world import Vector3


class Cruise:
    """Starts level, motors at hover; follows the straight line."""

    def __init__(
        self,
        airframe: Airframe,
        scene: Scene,
        position_ned_m: Vector3,
        velocity_ned_m_s: Vector3,
        yaw_rad: float,
        seed: int,
    ) -> None:
        self.plant = Plant(airframe, scene, seed, keeps_path=False)
        self.plant.place(position_ned_m, velocity_ned_m_s)
        state = self.plant.state
        state.motor_thrust_n[:] = airframe.mass_kg * GRAVITY_M_S2 / 4
        state.body[6:10] = [math.cos(yaw_rad / 2), 0.0, 0.0, math.sin(yaw_rad / 2)]
        state.yaw_setpoint_rad = yaw_rad
        self._start, self._velocity, self._yaw_rad = position_ned_m, velocity_ned_m_s, yaw_rad
        self._elapsed_s = 0.0

    def step(self) -> PlantOutput:
        """The next interval."""
        self._elapsed_s += 1e-6 * self.plant.interval_us
        x, y, z = (p + self._elapsed_s * v for p, v in zip(self._start, self._velocity, strict=True))
        return self.plant.step(TrajectorySetpoint((x, y, z), self._velocity, FREE, self._yaw_rad), armed=True)
