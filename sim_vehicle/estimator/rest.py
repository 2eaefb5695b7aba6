"""Whether the vehicle stands still, from its own motors' state and its inertial sensor."""

import numpy as np

from sim_vehicle.estimator.strapdown import FORCE, RATES
from sim_vehicle.physics.layout import GRAVITY_M_S2
from sim_vehicle.quantities import Floats

# Still for as long as this, and the rates of this long are averaged: their noise is down to a fifth.
WINDOW_S = 0.1
# Six standard deviations of one sample's noise (0.25 m/s^2, 0.01 rad/s) and the biases' share.
STILL_FORCE_M_S2 = 1.5
STILL_RATE_RAD_S = 0.1
# Feet are soft: what is left of a touchdown when the sensor no longer shows it.
STILL_SPEED_M_S = 0.02


class RestDetector:
    """Collects windows in which nothing moved while the motors did not fly."""

    def __init__(self, interval_us: int) -> None:
        self._window = max(round(1e6 * WINDOW_S / interval_us), 1)
        self._count = 0
        self._sum = np.zeros(3)

    @property
    def samples(self) -> int:
        """How many samples a mean is made of."""
        return self._window

    def update(self, sample: Floats, flies: bool) -> Floats | None:
        """Take one inertial sample; the mean rates of the window that it completes, if any."""
        if flies:
            self._count = 0
            return None
        x, y, z, p, q, r = sample[FORCE : RATES + 3].tolist()
        force = (x * x + y * y + z * z) ** 0.5
        if abs(force - GRAVITY_M_S2) > STILL_FORCE_M_S2 or p * p + q * q + r * r > STILL_RATE_RAD_S**2:
            self._count = 0
            return None
        if self._count == 0:
            self._sum[:] = 0.0
        self._sum += sample[RATES : RATES + 3]
        self._count += 1
        if self._count < self._window:
            return None
        self._count = 0
        return self._sum / self._window
