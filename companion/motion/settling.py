"""Has the vehicle come to rest at a place?"""

from companion.messages import LocalPosition, Vector3
from companion.strict_model import NotNegative, Positive, StrictModel


class SettledConfig(StrictModel):
    """When a recovery has ended."""

    distance_m: Positive = 0.10
    """Largest distance to the recovery setpoint."""
    speed_m_s: Positive = 0.10
    """Largest speed."""
    duration_s: Positive = 0.5
    """How long both must hold."""
    timeout_s: Positive = 10.0
    """A healthy recovery takes 2 to 4 s; after three times that the mission goes on without it."""
    smoothing_s: NotNegative = 0.1
    """Mean over about five samples at 50 Hz: brings a 0.03 m/s RMS velocity noise per axis to 0.01 m/s, so that
    the speed of a vehicle at rest stays clear of `speed_m_s` for the whole of `duration_s`."""


class SettlingMonitor:
    """Within a distance of the place and below a speed, without a break, for a duration.

    Position and velocity are smoothed first (exponential mean), because the noise of a good velocity estimate
    alone, 0.03 m/s on each axis, now and then makes a vehicle at rest look faster than 0.1 m/s.
    """

    __slots__ = ("_config", "_place", "_position", "_since_us", "_time_us", "_velocity")

    def __init__(self, place_ned_m: Vector3, config: SettledConfig) -> None:
        self._place = place_ned_m
        self._config = config
        self._position: Vector3 | None = None
        self._velocity: Vector3 = (0.0, 0.0, 0.0)
        self._time_us = 0
        self._since_us: int | None = None

    def settled_since(self, sample: LocalPosition) -> int | None:
        """Take one sample; the start (boot time) of an interval that is by now long enough, or None."""
        self._smooth(sample)
        if not self._is_at_rest():
            self._since_us = None
            return None
        if self._since_us is None:
            self._since_us = sample.time_boot_us
        elapsed_us = sample.time_boot_us - self._since_us
        return self._since_us if elapsed_us >= self._config.duration_s * 1e6 else None

    def _smooth(self, sample: LocalPosition) -> None:
        if self._position is None:
            self._position, self._velocity = sample.position_ned_m, sample.velocity_ned_m_s
        else:
            dt_s = (sample.time_boot_us - self._time_us) * 1e-6
            weight = dt_s / (self._config.smoothing_s + dt_s) if dt_s > 0.0 else 0.0
            self._position = _blend(self._position, sample.position_ned_m, weight)
            self._velocity = _blend(self._velocity, sample.velocity_ned_m_s, weight)
        self._time_us = sample.time_boot_us

    def _is_at_rest(self) -> bool:
        assert self._position is not None
        p, q, v = self._position, self._place, self._velocity
        distance2 = (p[0] - q[0]) ** 2 + (p[1] - q[1]) ** 2 + (p[2] - q[2]) ** 2
        speed2 = v[0] ** 2 + v[1] ** 2 + v[2] ** 2
        return distance2 <= self._config.distance_m**2 and speed2 < self._config.speed_m_s**2


def _blend(old: Vector3, new: Vector3, weight: float) -> Vector3:
    return (
        old[0] + weight * (new[0] - old[0]),
        old[1] + weight * (new[1] - old[1]),
        old[2] + weight * (new[2] - old[2]),
    )
