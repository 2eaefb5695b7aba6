"""Body, world and sensors of the simulated vehicle, with its motors in the hands of PX4."""

import math
import random

from sim_vehicle.airframe import Airframe, Imu
from sim_vehicle.estimator.sensors import CaptureSensor, downward_sensors
from sim_vehicle.geography import Origin
from sim_vehicle.hil import sensors
from sim_vehicle.hil.messages import HilSensor, ToPx4
from sim_vehicle.hil.sensors import air_at
from sim_vehicle.plant.plant import Plant
from sim_vehicle.plant.standing import check_start
from sim_vehicle.scene import Scene

# PX4 integrates samples by the trapezoidal rule: at 4 ms every HIGHRES_IMU would be the mean of two of them
# and show a hit a sample late. A quarter of its interval comes near the 8 kHz of a real sensor.
SAMPLE_INTERVAL_US = 1_000
# Of PX4's first simulated sensor: 16 bits for +-16 g and +-2000 deg/s, in which what is larger wraps round
# (SimulatorMavlink.cpp). Its largest numbers.
RANGE_M_S2, RANGE_RAD_S = 16 * 9.80665 * 32_767 / 32_768, math.radians(2000) * 32_767 / 32_768


def sampled_every(airframe: Airframe, interval_us: int) -> Airframe:
    """The airframe with an inertial sensor that is read out so often, its noise as white as before, in PX4's range."""
    imu = airframe.imu
    factor = math.sqrt(imu.integration_interval_us / interval_us)
    values = imu.model_dump() | {
        "integration_interval_us": interval_us,
        "accelerometer_range_m_s2": min(imu.accelerometer_range_m_s2, RANGE_M_S2),
        "accelerometer_noise_m_s2": factor * imu.accelerometer_noise_m_s2,
        "gyroscope_noise_rad_s": factor * imu.gyroscope_noise_rad_s,
    }
    return airframe.model_copy(update={"imu": Imu.model_validate(values)})


class HilVehicle:
    """One sample of the inertial sensor a step; time begins at 0, as PX4's clock does."""

    def __init__(
        self, airframe: Airframe, scene: Scene, seed: int, sample_interval_us: int = SAMPLE_INTERVAL_US
    ) -> None:
        """Raises SceneError where the start is not free, AirframeError where the vehicle does not stand."""
        check_start(airframe, scene)
        self._plant = Plant(sampled_every(airframe, sample_interval_us), scene, seed)
        rng = random.Random(seed)
        self._magnetometer = sensors.Magnetometer(rng)
        self._rng, self._origin = rng, Origin()
        self._gps = sensors.Gps(airframe, rng, self._origin)
        self.interval_us = self._plant.interval_us
        cameras = CaptureSensor(airframe.sensors.motion_capture, self.interval_us, rng)
        self._aids = cameras, *downward_sensors(airframe.sensors, self.interval_us, random.Random(~seed))
        # Taken once: looking a record's field up costs microseconds.
        self._body = self._plant.state.body
        self.truth = self._plant.truth
        """What really happened, never sent."""
        self.time_boot_us = 0

    def step(self, motor_fractions: tuple[float, ...]) -> tuple[ToPx4, ...]:
        """Advance one sample; the inertial sensor's sample comes last, because it sets PX4's clock going."""
        output = self._plant.drive(motor_fractions)
        now_us = self.time_boot_us = output.time_boot_us
        px, py, pz, vx, vy, vz, qw, qx, qy, qz = self._body[:10].tolist()
        messages: list[ToPx4] = []
        if self._is_due(sensors.GPS_PERIOD_US) and not self._plant.faults.gps_is_lost(now_us / 1e6):
            messages.append(self._gps.sample(now_us, (px, py, pz), (vx, vy, vz)))
        faces = self._plant.around.flat_faces
        seen = (aid.observe(now_us, self._body, faces) for aid in self._aids)
        messages += [sample for sample in seen if sample is not None]
        field, air = None, None
        if self._is_due(sensors.MAGNETOMETER_PERIOD_US):
            field = self._magnetometer.sample((qw, qx, qy, qz))
        if self._is_due(sensors.BAROMETER_PERIOD_US):
            air = air_at(self._origin.place.altitude_m - pz, self._rng.gauss(0, sensors.BAROMETER_NOISE_PA))
        p, q, r = (min(max(rate, -RANGE_RAD_S), RANGE_RAD_S) for rate in output.angular_velocity_frd_rad_s)
        messages.append(HilSensor(now_us, output.specific_force_frd_m_s2, (p, q, r), field, air))
        return tuple(messages)

    def _is_due(self, period_us: int) -> bool:
        """Whether the interval just simulated contains a multiple of the period."""
        return self.time_boot_us % period_us < self.interval_us
