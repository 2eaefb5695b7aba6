"""Gains and limits of the position control that may be changed in flight."""

from dataclasses import dataclass

Vector3 = tuple[float, float, float]


@dataclass(frozen=True, slots=True)
class PositionGains:
    """Eq. 6's gains along north, east and down, and the limits of what it may ask for."""

    position_p_per_s: Vector3
    velocity_p_per_s: Vector3
    velocity_i_per_s2: Vector3
    velocity_d: Vector3
    tilt_max_rad: float
    speed_max_m_s: float
    climb_max_m_s: float
    descent_max_m_s: float
