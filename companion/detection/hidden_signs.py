"""What a contact that fell between the samples leaves: a velocity that jumped.

The state is only read; what is known of an impact found so is the gap it fell into and the mean push over that gap.
"""

import math
from typing import NamedTuple

from companion.detection.fused_config import FusedConfig
from companion.detection.fused_state import FusedState
from companion.messages import Vector3
from companion.motion.rotation import ned_to_body


class Hidden(NamedTuple):
    """A contact that no sample showed: free until then, and the mean push since (body FRD)."""

    free_until_boot_us: int
    specific_force_frd_m_s2: Vector3
    confidence: float
    velocity_before_ned_m_s: Vector3


def velocity_jump(
    s: FusedState,
    config: FusedConfig,
    time_us: int,
    velocity_ned_m_s: Vector3,
    step_m_s: Vector3,
    spread_m_s: float,
    caution: float,
) -> Hidden | None:
    """A velocity that is off by `step_m_s` from where the accelerometer leads; `caution` times the step is asked for
    of a velocity that may jump by itself."""
    aftermath = s.aftermath
    size = math.sqrt(step_m_s[0] * step_m_s[0] + step_m_s[1] * step_m_s[1] + step_m_s[2] * step_m_s[2])
    threshold = _step_asked_for_m_s(s, config, time_us, spread_m_s, caution)
    if size < threshold:
        return None
    free_until_us = aftermath.contact_gap_us(time_us, config.rate_step_rad_s)
    over_s = max(max(time_us, s.last_sample_boot_us) - free_until_us, 1) * 1e-6
    push = (step_m_s[0] / over_s, step_m_s[1] / over_s, step_m_s[2] / over_s)
    force = ned_to_body(aftermath.strapdown.attitude_wxyz, push)
    v = velocity_ned_m_s
    before = (v[0] - step_m_s[0], v[1] - step_m_s[1], v[2] - step_m_s[2])
    return Hidden(free_until_us, force, min(1.0, 0.5 * size / threshold), before)


def _step_asked_for_m_s(s: FusedState, config: FusedConfig, time_us: int, spread_m_s: float, caution: float) -> float:
    aftermath = s.aftermath
    turned = aftermath.rate_step_near(time_us) >= config.rate_step_rad_s
    least = config.velocity_step_turned_m_s if turned else config.velocity_step_m_s
    p, q, _ = aftermath.strapdown.rates_frd_rad_s
    shaking = max(0.0, s.floor.side_m_s2 - config.side_threshold_m_s2 / config.noise_factor)
    noise_m_s, room = config.noise_factor * spread_m_s, config.velocity_per_rate_m * (abs(p) + abs(q))
    room += aftermath.unseen_m_s(shaking, abs(s.soft.last[2] - s.floor.z))
    return caution * max(least, noise_m_s) + room
