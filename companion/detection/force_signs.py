"""What one sample of the accelerometer shows of a contact: a push sideways or along the thrust.

Each against what this vehicle shows in its own flight (see `fused`); the state is only read.
"""

import math

from companion.detection.fused_config import FusedConfig
from companion.detection.fused_state import FusedState
from companion.messages import Vector3

# On a vehicle that shakes one sample below so many thresholds may be the sensor's own (once in four public logs, 1.2):
# the next one must show it, too. Where it shakes until the detector is told to be blind, only what is clear counts.
CLEAR = 1.3


def side_threshold_m_s2(s: FusedState, config: FusedConfig, rates_frd_rad_s: Vector3) -> float:
    """What a push sideways must reach: drag goes round with a vehicle that turns while its mean stays behind."""
    v = s.velocity_ned_m_s
    if v is None:
        return s.threshold_m_s2
    turning = abs(rates_frd_rad_s[0]) + abs(rates_frd_rad_s[1]) + abs(rates_frd_rad_s[2])
    speed = math.sqrt(v[0] * v[0] + v[1] * v[1] + v[2] * v[2])
    return s.threshold_m_s2 + config.drag_per_s * speed * min(2.0, 0.25 * turning)


def vertical_threshold_m_s2(s: FusedState, config: FusedConfig) -> float:
    """What a push along the thrust must be beyond what propellers can do."""
    return max(config.vertical_threshold_m_s2, config.noise_factor * s.floor.vertical_m_s2)


def pushes_on(s: FusedState, force_frd_m_s2: Vector3) -> bool:
    """Whether the sample before was pushed the same way, as by a contact; what shakes goes to and fro."""
    x, y, z = s.soft.last
    f_x, f_y, f_z = force_frd_m_s2
    return (x - s.floor.x) * f_x + (y - s.floor.y) * f_y + (z - s.floor.z) * f_z > 0.0
