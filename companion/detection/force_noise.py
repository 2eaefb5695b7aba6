"""Running mean and standard deviation of the specific force on each axis, learnt in the vehicle's own flight."""

import math
from dataclasses import dataclass

# Memory of the mean. It follows drag as the speed changes, and a gust that builds up in a few tenths of a second.
MEAN_MEMORY_S = 0.25
# Memory of the standard deviation: good to 5 % with 200 samples, to 12 % at the slowest useful rates.
SPREAD_MEMORY_S = 2.0
# The noise is known after this time: 50 samples at 50 Hz make a standard deviation good to a tenth.
LEARNT_S = 1.0
# After take-off the rotors' vibration is not learnt yet: the time that a rising standard deviation needs.
SETTLED_US = 300_000
# The standard deviation is told larger by this factor: vibration grows with the throttle, sooner than it is learnt.
EXCESS = 1.5


@dataclass(slots=True)
class ForceNoise:
    """Exponentially weighted mean and variance on body x, y, z. Changed only by `learn`."""

    x: float = 0.0
    y: float = 0.0
    z: float = 0.0
    variance_x: float = 0.0
    variance_y: float = 0.0
    variance_z: float = 0.0
    known_s: float = 0.0
    side_m_s2: float = 0.0  # standard deviation on the noisier of x and y
    vertical_m_s2: float = 0.0  # standard deviation on z

    @property
    def is_known(self) -> bool:
        return self.known_s >= LEARNT_S

    def learn(self, f_x: float, f_y: float, f_z: float, step_s: float) -> None:
        """Take one sample, m/s^2, ``step_s`` after the last; the first ones count as a plain mean."""
        if self.known_s <= 0.0:
            self.x, self.y, self.z = f_x, f_y, f_z
        known_s = self.known_s = min(self.known_s + step_s, SPREAD_MEMORY_S)
        mean_share = step_s / (known_s if known_s < MEAN_MEMORY_S else MEAN_MEMORY_S)
        share = step_s / known_s
        x, y, z = f_x - self.x, f_y - self.y, f_z - self.z
        self.x += mean_share * x
        self.y += mean_share * y
        self.z += mean_share * z
        self.variance_x += share * (x * x - self.variance_x)
        self.variance_y += share * (y * y - self.variance_y)
        self.variance_z += share * (z * z - self.variance_z)
        self.side_m_s2 = EXCESS * math.sqrt(max(self.variance_x, self.variance_y))
        self.vertical_m_s2 = EXCESS * math.sqrt(self.variance_z)
