"""The paper's eq. 2 on a wall that cannot pull: path and rebound in closed form."""

import math

import numpy as np

from rebound_cli.identification.hit import Floats


def restitution_of(damping_ratio: float) -> float:
    """Speed after over speed before of a linear spring and damper; a damping ratio below 1."""
    root = math.sqrt(1 - damping_ratio**2)
    return math.exp(-damping_ratio * _phase(damping_ratio) / root)


def contact_time(stiffness_per_s2: float, damping_per_s: float) -> float:
    """First touch until the force is back at zero, in seconds."""
    natural, ratio = natural_and_ratio(stiffness_per_s2, damping_per_s)
    return _phase(ratio) / (natural * math.sqrt(1 - ratio**2))


def natural_and_ratio(stiffness_per_s2: float, damping_per_s: float) -> tuple[float, float]:
    """Natural frequency (rad/s) and damping ratio, the latter kept below 1: more is not told apart."""
    natural = math.sqrt(stiffness_per_s2)
    return natural, min(damping_per_s / (2 * natural), 0.999)


def deepest(speed_m_s: float, stiffness_per_s2: float, damping_per_s: float) -> float:
    """How far a hit at this speed presses the spring, in metres."""
    natural, ratio = natural_and_ratio(stiffness_per_s2, damping_per_s)
    return speed_m_s / natural * math.exp(-ratio / math.sqrt(1 - ratio**2) * math.acos(ratio))


def path(since_touch_s: Floats, speed_m_s: float, natural_rad_s: float, damping_ratio: float) -> Floats:
    """Depth beyond the first touch, negative before it; free flight until the touch and after the release."""
    root = math.sqrt(1 - damping_ratio**2)
    damped = natural_rad_s * root
    release_s = _phase(damping_ratio) / damped
    pressed_s = np.clip(since_touch_s, 0.0, release_s)
    decay = np.exp(-damping_ratio * natural_rad_s * pressed_s)
    depth = speed_m_s / damped * decay * np.sin(damped * pressed_s)
    after_s = np.maximum(since_touch_s - release_s, 0.0)
    leaving = speed_m_s * restitution_of(damping_ratio)
    result: Floats = depth + speed_m_s * np.minimum(since_touch_s, 0.0) - leaving * after_s
    return result


def _phase(damping_ratio: float) -> float:
    root = math.sqrt(1 - damping_ratio**2)
    return math.atan2(2 * damping_ratio * root, 2 * damping_ratio**2 - 1)
