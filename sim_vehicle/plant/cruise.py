"""A flight that begins in the air, for studies of single hits: steady, straight, towards something."""

from sim_vehicle.airframe import Airframe
from sim_vehicle.control.setpoint import TrajectorySetpoint
from sim_vehicle.estimator.estimate import Estimate
from sim_vehicle.plant.plant import Plant
from sim_vehicle.quantities import Vector3
from sim_vehicle.scene import Scene


class Cruise:
    """The body, its inner loops and its sensors, flying straight on at a constant velocity and heading.

    ``position_ned_m`` is the centre of mass at boot time 0. The same arguments give the same bits.
    """

    def __init__(
        self,
        airframe: Airframe,
        scene: Scene,
        position_ned_m: Vector3,
        velocity_ned_m_s: Vector3,
        yaw_rad: float = 0.0,
        seed: int = 1,
    ) -> None:
        self.plant = Plant(airframe, scene, seed)
        self.plant.cruise(position_ned_m, velocity_ned_m_s, yaw_rad)
        self._from = position_ned_m
        self._velocity = velocity_ned_m_s
        self._yaw_rad = yaw_rad
        # The setpoint keeps to what the vehicle believes, which is late; else it would hurry after it.
        self._late_us = round(1e6 * airframe.estimate.delay_s) if airframe.estimate.kind == "markov" else 0

    @property
    def time_boot_us(self) -> int:
        """The vehicle's clock."""
        return self.plant.state.time_us

    def setpoint(self) -> TrajectorySetpoint:
        """Where the straight flight would be by now."""
        seconds = 1e-6 * (self.time_boot_us - self._late_us)
        (x, y, z), (vx, vy, vz) = self._from, self._velocity
        return TrajectorySetpoint(
            position_ned_m=(x + seconds * vx, y + seconds * vy, z + seconds * vz),
            velocity_ned_m_s=self._velocity,
            yaw_rad=self._yaw_rad,
        )

    def step(self, setpoint: TrajectorySetpoint | None = None) -> Estimate:
        """Fly one interval, straight on or to a setpoint of the caller's."""
        return self.plant.step(setpoint or self.setpoint(), armed=True)
