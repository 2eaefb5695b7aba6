"""Thresholds of the contact force in one accelerometer sample, horizontal and along the thrust.

They depend on this vehicle's noise in its own flight (see `fused`). The state is only read.
"""

import math

from companion.detection.fused_config import FusedConfig
from companion.detection.fused_state import FusedState
from companion.messages import Vector3

# On a vibrating vehicle a single sample below this many thresholds may be noise (once in four public logs, with 1.2):
# the next one must confirm it. Above MOST_THRESHOLD_M_S2 only larger forces count.
CLEAR = 1.3


def side_threshold_m_s2(s: FusedState, config: FusedConfig, rates_frd_rad_s: Vector3) -> float:
    """Horizontal threshold, m/s^2. On a turning vehicle drag changes direction faster than its mean follows."""
    v = s.velocity_ned_m_s
    if v is None:
        return s.threshold_m_s2
    turning = abs(rates_frd_rad_s[0]) + abs(rates_frd_rad_s[1]) + abs(rates_frd_rad_s[2])
    speed = math.sqrt(v[0] * v[0] + v[1] * v[1] + v[2] * v[2])
    return s.threshold_m_s2 + config.drag_per_s * speed * min(2.0, 0.25 * turning)


def vertical_threshold_m_s2(s: FusedState, config: FusedConfig) -> float:
    """Vertical threshold, m/s^2, beyond the force that propellers can make."""
    return max(config.vertical_threshold_m_s2, config.noise_factor * s.floor.vertical_m_s2)


def pushes_on(s: FusedState, force_frd_m_s2: Vector3) -> bool:
    """Whether the sample before had a force in the same direction, as in a contact; vibration alternates."""
    x, y, z = s.soft.last
    f_x, f_y, f_z = force_frd_m_s2
    return (x - s.floor.x) * f_x + (y - s.floor.y) * f_y + (z - s.floor.z) * f_z > 0.0
