"""Body and world of the simulated vehicle, with its motors in the hands of ArduPilot."""

from sim_vehicle.airframe import Airframe
from sim_vehicle.errors import AirframeError
from sim_vehicle.hil.vehicle import sampled_every
from sim_vehicle.json.messages import Pulses, state_line
from sim_vehicle.plant.plant import Plant
from sim_vehicle.plant.standing import check_start
from sim_vehicle.scene import Scene

# ArduPilot reads its inertial sensors a thousand times a second.
SAMPLE_INTERVAL_US = 1_000


def check_rotors(airframe: Airframe) -> None:
    """Raises AirframeError."""
    if airframe.rotors:
        raise AirframeError(f"{airframe.name} has rotors of its own: ArduPilot flies a quad-x of equal arms here.")


class JsonVehicle:
    """One sample of the inertial sensor a step; time begins at 0, as ArduPilot's clock does."""

    def __init__(self, airframe: Airframe, scene: Scene, seed: int) -> None:
        """Raises SceneError where the start is not free, AirframeError where it does not stand or for other motors."""
        check_start(airframe, scene)
        check_rotors(airframe)
        self._plant = Plant(sampled_every(airframe, SAMPLE_INTERVAL_US), scene, seed)
        self._motors = airframe.rotor_count
        self._body = self._plant.state.body
        self.truth = self._plant.truth
        """What really happened."""
        self.time_boot_us = 0

    def answer(self, pulses: Pulses) -> bytes:
        """Advance one sample and tell of it."""
        output = self._plant.drive(pulses.motor_fractions(self._motors))
        self.time_boot_us = output.time_boot_us
        north, east, down, v_north, v_east, v_down, w, x, y, z = self._body[:10].tolist()
        return state_line(
            output.time_boot_us,
            output.angular_velocity_frd_rad_s,
            output.specific_force_frd_m_s2,
            (north, east, down),
            (w, x, y, z),
            (v_north, v_east, v_down),
        )
