"""The sensors that only telemetry shows: GPS, magnetometer and barometer. The built-in control does without them."""

import random

from sim_vehicle.airframe import Airframe
from sim_vehicle.geography import Origin
from sim_vehicle.hil.messages import Air, HilGps
from sim_vehicle.hil.sensors import BAROMETER_NOISE_PA, Gps, Magnetometer, air_at
from sim_vehicle.quantities import Floats, Vector3

# SENS_MAG_RATE 15 Hz and SENS_BARO_RATE 20 Hz, in whole intervals of 4 ms; PX4's simulated receiver gives 8 fixes a
# second.
MAGNETOMETER_PERIOD_US = 64_000
BAROMETER_PERIOD_US = 48_000
GPS_PERIOD_US = 124_000
# How late a receiver's fix is, less than a period: PX4's default EKF2_GPS_DELAY.
GPS_DELAY_US = 110_000
NEVER_US = 1 << 62


class SlowSensors:
    """Newest samples; each is a new object when it is renewed."""

    def __init__(self, airframe: Airframe, seed: int, origin: Origin) -> None:
        """``origin``: where local NED (0, 0, 0) lies."""
        rng = random.Random(seed)
        self._magnetometer, self._gps, self._rng = Magnetometer(rng, origin.place), Gps(airframe, rng, origin), rng
        self._altitude_m = origin.place.altitude_m
        self._due_us = [0, 0, 0, NEVER_US]
        self._fix: HilGps | None = None
        self.due_us = 0
        """When any of them has its next sample."""
        self.magnetic_field_frd_gauss: Vector3 = (0.0, 0.0, 0.0)
        self.air: Air | None = None
        self.gps: HilGps | None = None

    def update(self, now_us: int, body: Floats, gps_is_blocked: bool) -> None:
        """Renew what is due; ``body`` (13,): true position and velocity NED, attitude (w, x, y, z), rates, SI units.

        ``gps_is_blocked``: the receiver goes on without a fix.
        """
        due_us = self._due_us
        north, east, down, v_north, v_east, v_down, w, x, y, z = body[:10].tolist()
        if now_us >= due_us[0]:
            due_us[0] = now_us + MAGNETOMETER_PERIOD_US
            self.magnetic_field_frd_gauss = self._magnetometer.sample((w, x, y, z))
        if now_us >= due_us[1]:
            due_us[1] = now_us + BAROMETER_PERIOD_US
            self.air = air_at(self._altitude_m - down, self._rng.gauss(0, BAROMETER_NOISE_PA))
        if now_us >= due_us[3]:
            due_us[3] = NEVER_US
            self.gps = None if gps_is_blocked else self._fix
        if now_us >= due_us[2]:
            due_us[2], due_us[3] = now_us + GPS_PERIOD_US, now_us + GPS_DELAY_US
            self._fix = self._gps.sample(now_us, (north, east, down), (v_north, v_east, v_down))
        self.due_us = min(due_us)
