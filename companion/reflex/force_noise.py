"""Running mean and standard deviation of the specific force on each axis, learnt in the vehicle's own flight."""

import math
from dataclasses import dataclass

from companion.messages import Vector3
from companion.motion.vector import ZERO
from companion.reflex.config import EXCESS, MEAN_MEMORY_S, SPREAD_MEMORY_S


@dataclass(slots=True)
class ForceNoise:
    """Exponentially weighted mean and variance on body x, y, z. Changed only by `learn`."""

    mean_frd_m_s2: Vector3 = ZERO
    variance_m2_s4: Vector3 = ZERO
    known_s: float = 0.0
    side_m_s2: float = 0.0  # standard deviation on the noisier of x and y
    vertical_m_s2: float = 0.0  # standard deviation on z

    def learn(self, force_frd_m_s2: Vector3, step_s: float) -> None:
        """Take one sample, ``step_s`` after the last; the first ones count as a plain mean."""
        if self.known_s <= 0.0:
            self.mean_frd_m_s2 = force_frd_m_s2
        known_s = self.known_s = min(self.known_s + step_s, SPREAD_MEMORY_S)
        mean_share, share = step_s / min(known_s, MEAN_MEMORY_S), step_s / known_s
        (f_x, f_y, f_z), (m_x, m_y, m_z), (v_x, v_y, v_z) = force_frd_m_s2, self.mean_frd_m_s2, self.variance_m2_s4
        x, y, z = f_x - m_x, f_y - m_y, f_z - m_z
        v_x, v_y, v_z = v_x + share * (x * x - v_x), v_y + share * (y * y - v_y), v_z + share * (z * z - v_z)
        self.mean_frd_m_s2 = (m_x + mean_share * x, m_y + mean_share * y, m_z + mean_share * z)
        self.variance_m2_s4 = (v_x, v_y, v_z)
        self.side_m_s2 = EXCESS * math.sqrt(max(v_x, v_y))
        self.vertical_m_s2 = EXCESS * math.sqrt(v_z)
