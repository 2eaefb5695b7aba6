"""The force of a sample beside the thresholds of a contact, and whether a weak one may be a hand.

Thresholds depend on this vehicle's noise in its own flight (see `force_noise`). The state is only read.

A person's hand and a soft strike on a hovering vehicle differ in how the force begins. An arm takes 80 ms and more to
push; a hand that grips stops the small speed of a hover. An obstacle strikes with its own speed, and its force is there
from one sample to the next. So a force is observed for a moment, and is a strike as soon as it jumps.
"""

import math

from companion.detection.fused_config import FusedConfig
from companion.detection.fused_state import FusedState
from companion.detection.interface import Phase
from companion.messages import Vector3

# A vehicle vibrates when its threshold is this many times the least one: four public logs have four to nine times. On
# any other the least threshold is that of a force that lasts, as of a gust, and two samples together are no more.
SHAKING = 2.0
# On a vibrating vehicle one sample below this many thresholds may be noise (once in four public logs, with 1.2).
CLEAR = 1.3
# A vehicle counts as hovering for this time after it hovered: pushed by a hand with 2 m/s^2 it soon moves.
HOVERED_US = 500_000
# Least jump, in thresholds of at least 1.75 m/s^2. A grip of 30 N s/m stops a kilogram that drifts at 0.1 m/s with
# 2.7 m/s^2, plus noise.
JUMP = 2.4


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


def _shakes(s: FusedState, config: FusedConfig) -> bool:
    """Whether noise decides if a sample begins a contact: two samples together then show more than one.

    Within a contact each sample speaks for itself: the one after a forged sample does not confirm it.
    """
    return s.phase is Phase.ARMED and s.threshold_m_s2 > SHAKING * config.side_threshold_m_s2


def side_force(s: FusedState, config: FusedConfig, force_frd_m_s2: Vector3) -> tuple[float, float, bool]:
    """Horizontal force, m/s^2; how many thresholds are a hit; whether it is that of two samples together.

    Of one sample or two on a vehicle that vibrates: what is nearer to a hit.
    """
    x, y = force_frd_m_s2[0] - s.floor.x, force_frd_m_s2[1] - s.floor.y
    alone = math.sqrt(x * x + y * y)
    if not _shakes(s, config):
        return alone, 1.0, False
    together = _together_m_s2(s, force_frd_m_s2)
    return (together, 1.0, True) if together > alone / CLEAR else (alone, CLEAR, False)


def _together_m_s2(s: FusedState, force_frd_m_s2: Vector3) -> float:
    """Horizontal force of a sample and the one before it, as of one: their sum over the root of two, by which the
    noise of a sum grows. Vibration alternates, a contact does not.

    Compared with zero, too: a slow swing that the mean has not followed is none.
    """
    (f_x, f_y, _), (g_x, g_y, _), mean = force_frd_m_s2, s.last_frd_m_s2, s.floor
    x, y = f_x + g_x, f_y + g_y
    return math.sqrt(0.5 * min((x - 2.0 * mean.x) ** 2 + (y - 2.0 * mean.y) ** 2, x * x + y * y))


def may_be_hand(s: FusedState, time_us: int) -> bool:
    """Whether the vehicle hovers, or just did."""
    return s.hovered_boot_us is not None and time_us - s.hovered_boot_us < HOVERED_US


def jumps(s: FusedState, force_frd_m_s2: Vector3) -> bool:
    """Whether the force changed over one sample, or over two, by more than a hand's does."""
    return any(math.dist(force_frd_m_s2, f) >= JUMP * s.threshold_m_s2 for f in (s.last_frd_m_s2, s.before_frd_m_s2))
