"""Has the vehicle come to rest at a place?"""

import math

from companion.messages import Vector3
from companion.strict_model import Positive, StrictModel


class SettledConfig(StrictModel):
    """When a recovery has ended."""

    retired = frozenset({"smoothing_s"})

    distance_m: Positive = 0.10
    """Largest distance to the recovery setpoint."""
    speed_m_s: Positive = 0.10
    """Largest speed."""
    duration_s: Positive = 0.5
    """How long both must hold."""
    timeout_s: Positive = 10.0
    """A healthy recovery takes 2 to 4 s; after three times that the mission goes on without it."""


class SettlingMonitor:
    """Within a distance of the place and below a speed, without a break, for a duration."""

    __slots__ = ("_config", "_place", "_since_us")

    def __init__(self, place_ned_m: Vector3, config: SettledConfig) -> None:
        self._place, self._config = place_ned_m, config
        self._since_us: int | None = None

    def settled_since(self, time_boot_us: int, place_ned_m: Vector3, velocity_ned_m_s: Vector3) -> int | None:
        """Take one motion; the start (boot time) of an interval that is by now long enough, or None."""
        config = self._config
        is_there = math.dist(place_ned_m, self._place) <= config.distance_m
        if not is_there or math.hypot(*velocity_ned_m_s) >= config.speed_m_s:
            self._since_us = None
        elif self._since_us is None:
            self._since_us = time_boot_us
        if self._since_us is None or time_boot_us - self._since_us < config.duration_s * 1e6:
            return None
        return self._since_us
