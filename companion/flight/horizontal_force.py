"""A sustained horizontal force: the vehicle tilts towards its setpoint, more and more, and does not get there.

A vehicle that meets an obstacle slowly shows no hit. Its loops tilt it by the position error and by the error's
integral, until it slips off or its own thrust pins it. A wall met at 0.2 m/s had it on the ground three seconds later.
In free air a tilted thrust is an acceleration, except for drag and wind. The missing acceleration is the external
force. The thrust is what the accelerometer shows along body z.
"""

import math
from dataclasses import dataclass, replace

from companion.messages import LocalPosition, Quaternion, Vector3
from companion.motion.rotation import body_to_ned
from companion.motion.strapdown import GRAVITY_M_S2

Flat = tuple[float, float]

# A setpoint nearer than this is reached: three times a good estimate's noise.
BESIDE_M = 0.1
# While it is, drag and wind are learnt: the mean of so long.
FOLLOWED_S = 1.0
# A vehicle that comes this much nearer to its setpoint is not held back.
NEARER_M = 0.05
# The motion is not steady where the velocity has changed by more: four times a good estimate's noise. With 0.15 a slow
# gust counted as steady.
STEADY_M_S = 0.12
# Lean and velocity alike: leaves 0.15 m/s^2 of what a good velocity's noise makes of an acceleration.
SMOOTHING_S = 0.2
# After a reset the low-pass filters still contain the vehicle's own acceleration; after 3 time constants less than 5 %
# is left.
SETTLED_US = 600_000
# An attitude loop of 12 rad/s and a velocity that is late by 20 ms: a lean that began just now moves nothing yet.
LEAST_US = 300_000
# What an external force takes of the lean, besides what drag and wind took before: 9 degrees. A gust of 5 m/s takes
# 1.1 m/s^2 of the paper's vehicle, and moves it. Arms that press on a wall carry a vehicle
# that leans by 15 degrees; from 22 on it is tipped over.
HELD_M_S2 = 1.5
# Less than this, three times the noise, is no push: of a vehicle that turns to another place the lean comes back first.
RELEASED_M_S2 = 0.5
# A vehicle that approaches its setpoint this fast is not held back.
NEARING_M_S = 0.1


@dataclass(frozen=True, slots=True)
class SustainedForce:
    """Something is in the way; local NED.

    `normal_ned` is away from it, `push_m_s2` what it takes of the lean's acceleration, since `since_boot_us`.
    """

    normal_ned: Vector3
    force_m_s2: float
    since_boot_us: int


@dataclass(slots=True)
class _Stretch:
    """An interval of steady motion, and the missing acceleration at its start: drag and wind."""

    since_us: int
    velocity_m_s: Vector3
    missing_m_s2: Flat
    error_m: float

    def follow(self, monitor: "HorizontalForceMonitor", now_us: int, weight: float) -> None:
        """At the setpoint all missing acceleration is drag and wind."""
        (u, v, w), (a, b, c) = self.velocity_m_s, monitor.velocity_m_s
        (n, e), (p, q) = self.missing_m_s2, monitor.missing_m_s2
        self.velocity_m_s = (u + weight * (a - u), v + weight * (b - v), w + weight * (c - w))
        self.missing_m_s2 = (n + weight * (p - n), e + weight * (q - e))
        self.since_us, self.error_m = now_us, 0.0


@dataclass(slots=True)
class HorizontalForceMonitor:
    """Updated with each position while setpoints are flown; reset by `forget`."""

    stretch: _Stretch | None = None
    began_us: int = 0
    time_us: int = 0
    thrust_m_s2: float = GRAVITY_M_S2
    imu_count: int = 0
    """IMU samples in the mean since the last position."""
    velocity_m_s: Vector3 = (0.0, 0.0, 0.0)
    tilt_m_s2: Flat = (0.0, 0.0)
    missing_m_s2: Flat = (0.0, 0.0)

    def forget(self) -> None:
        self.stretch, self.time_us = None, 0

    @property
    def is_settled(self) -> bool:
        return self.time_us - self.began_us >= SETTLED_US

    @property
    def wind_m_s2(self) -> Flat:
        """Acceleration that balances drag and wind, measured at the setpoint; NED."""
        return self.missing_m_s2 if self.stretch is None else self.stretch.missing_m_s2

    def add_imu(self, specific_force_frd_m_s2: Vector3) -> None:
        """Take one sample of the accelerometer; the mean of those between two positions counts."""
        self.imu_count += 1
        self.thrust_m_s2 += (-specific_force_frd_m_s2[2] - self.thrust_m_s2) / self.imu_count

    def step(self, sample: LocalPosition, attitude_wxyz: Quaternion, goal_ned_m: Vector3) -> SustainedForce | None:
        """Take one sample, the attitude and the setpoint as last sent."""
        elapsed_s = self._smooth(sample, tilt_acceleration(attitude_wxyz, self.thrust_m_s2))
        self.imu_count = 0
        if not self.is_settled:
            return None
        north, east = goal_ned_m[0] - sample.position_ned_m[0], goal_ned_m[1] - sample.position_ned_m[1]
        error_m = math.hypot(north, east)
        stretch, (u, v, _) = self.stretch, self.velocity_m_s
        comes_nearer = stretch is not None and error_m < stretch.error_m - NEARER_M and stretch.error_m > BESIDE_M
        if stretch is None or comes_nearer or math.dist(self.velocity_m_s, stretch.velocity_m_s) > STEADY_M_S:
            self.stretch = _Stretch(sample.time_boot_us, self.velocity_m_s, self.missing_m_s2, error_m)
            return None
        if error_m < BESIDE_M:
            stretch.follow(self, sample.time_boot_us, elapsed_s / (FOLLOWED_S + elapsed_s))
            return None
        stretch.error_m = max(stretch.error_m, error_m)
        n, e = north / error_m, east / error_m
        grown = (self.missing_m_s2[0] - stretch.missing_m_s2[0], self.missing_m_s2[1] - stretch.missing_m_s2[1])
        towards_m_s2 = grown[0] * n + grown[1] * e
        is_held_back = self.missing_m_s2[0] * n + self.missing_m_s2[1] * e > RELEASED_M_S2
        is_kept_off = is_held_back and u * n + v * e < NEARING_M_S
        if towards_m_s2 < HELD_M_S2 or not is_kept_off or sample.time_boot_us - stretch.since_us < LEAST_US:
            return None
        size, since_us = math.hypot(*grown), stretch.since_us
        # What it was in free air stays known.
        self.stretch = replace(stretch, since_us=sample.time_boot_us, velocity_m_s=self.velocity_m_s, error_m=0.0)
        return SustainedForce((-grown[0] / size, -grown[1] / size, 0.0), towards_m_s2, since_us)

    def _smooth(self, sample: LocalPosition, tilt_m_s2: Flat) -> float:
        """Low-pass velocity and tilt; missing acceleration: tilt's less velocity's. Returns the time step in s."""
        if self.time_us == 0:
            self.began_us = self.time_us = sample.time_boot_us
            self.velocity_m_s, self.tilt_m_s2 = sample.velocity_ned_m_s, tilt_m_s2
        elapsed_s = (sample.time_boot_us - self.time_us) * 1e-6
        weight = elapsed_s / (SMOOTHING_S + elapsed_s)
        (u, v, w), (a, b, c), (n, e) = self.velocity_m_s, sample.velocity_ned_m_s, self.tilt_m_s2
        self.velocity_m_s = (u + weight * (a - u), v + weight * (b - v), w + weight * (c - w))
        self.tilt_m_s2 = n, e = (n + weight * (tilt_m_s2[0] - n), e + weight * (tilt_m_s2[1] - e))
        u, v, _ = self.velocity_m_s
        self.missing_m_s2 = (n - (a - u) / SMOOTHING_S, e - (b - v) / SMOOTHING_S)
        self.time_us = sample.time_boot_us
        return elapsed_s


def tilt_acceleration(attitude_wxyz: Quaternion, thrust_m_s2: float | None = None) -> Flat:
    """Horizontal acceleration of a thrust at this attitude, NED. Without a thrust, the one that holds the height."""
    n, e, d = body_to_ned(attitude_wxyz, (0.0, 0.0, -1.0))
    if thrust_m_s2 is None:
        thrust_m_s2 = GRAVITY_M_S2 / max(-d, 0.05)
    return (thrust_m_s2 * n, thrust_m_s2 * e)
