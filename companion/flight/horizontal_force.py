"""A sustained horizontal force: the vehicle tilts towards its setpoint, more and more, and does not get there.

A vehicle that meets an obstacle slowly shows no hit. Its loops tilt it by the position error and by the error's
integral, until it slips off or its own thrust pins it. A wall met at 0.2 m/s had it on the ground three seconds later.
In free air a tilted thrust is an acceleration, except for drag and wind. The missing acceleration is the external
force. The thrust is what the accelerometer shows along body z.
"""

import math
from dataclasses import dataclass

from companion.messages import LocalPosition, Quaternion, Vector3
from companion.motion.rotation import body_to_ned
from companion.motion.strapdown import GRAVITY_M_S2, ZERO
from companion.reflex.halfspace import plus, split

# A setpoint nearer than this is reached: three times a good estimate's noise.
BESIDE_M = 0.1
# While it is, drag and wind are learnt: the mean of so long.
FOLLOWED_S = 1.0
# Four times a good estimate's noise. The motion is not steady where the velocity has changed by more. A vehicle that
# approaches its setpoint faster is not held back. With 0.15 a slow gust counted as steady.
STEADY_M_S = 0.12
# Lean and velocity alike: leaves 0.15 m/s^2 of what a good velocity's noise makes of an acceleration.
SMOOTHING_S = 0.2
# An attitude loop of 12 rad/s and a velocity that is late by 20 ms: a lean that began just now moves nothing yet.
LEAST_US = 300_000
# What an external force takes of the lean, besides what drag and wind took before: 9 degrees. A gust of 5 m/s takes
# 1.1 m/s^2 of the paper's vehicle, and moves it. Arms that press on a wall carry a vehicle
# that leans by 15 degrees; from 22 on it is tipped over.
HELD_M_S2 = 1.5


@dataclass(frozen=True, slots=True)
class SustainedForce:
    """Something is in the way; local NED.

    `normal_ned` is away from it, `push_m_s2` what it takes of the lean's acceleration, since `since_boot_us`.
    """

    normal_ned: Vector3
    force_m_s2: float
    since_boot_us: int


@dataclass(slots=True)
class HorizontalForceMonitor:
    """Updated with each position, and with the setpoint while one is flown to; reset by `forget`. Vectors: NED."""

    time_us: int = 0
    thrust_m_s2: float = GRAVITY_M_S2
    imu_count: int = 0
    """IMU samples in the mean since the last position."""
    velocity_m_s: Vector3 = ZERO
    thrust_ned_m_s2: Vector3 = ZERO
    missing_m_s2: Vector3 = ZERO
    steady_since_us: int | None = None
    steady_m_s: Vector3 = ZERO
    """Velocity at the start of the steady motion away from the setpoint."""
    wind_m_s2: Vector3 = ZERO
    """Missing acceleration at that start: it balances drag and wind."""

    def forget(self) -> None:
        self.steady_since_us, self.time_us = None, 0

    def add_imu(self, specific_force_frd_m_s2: Vector3) -> None:
        """Take one sample of the accelerometer; the mean of those between two positions counts."""
        self.imu_count += 1
        self.thrust_m_s2 += (-specific_force_frd_m_s2[2] - self.thrust_m_s2) / self.imu_count

    def step(
        self, sample: LocalPosition, attitude_wxyz: Quaternion, goal_ned_m: Vector3 | None
    ) -> SustainedForce | None:
        """Take one sample, the attitude and the setpoint as last sent; None while none is flown to."""
        elapsed_s = self._smooth(sample, body_to_ned(attitude_wxyz, (0.0, 0.0, -self.thrust_m_s2)))
        self.imu_count = 0
        north, east, _ = ZERO if goal_ned_m is None else plus(goal_ned_m, -1.0, sample.position_ned_m)
        error_m, since_us = math.hypot(north, east), self.steady_since_us
        is_new = since_us is None or math.dist(self.velocity_m_s, self.steady_m_s) > STEADY_M_S
        if since_us is None or is_new or error_m < BESIDE_M:
            share, self.steady_since_us = 1.0 if is_new else elapsed_s / (FOLLOWED_S + elapsed_s), sample.time_boot_us
            self.steady_m_s = plus(self.steady_m_s, share, plus(self.velocity_m_s, -1.0, self.steady_m_s))
            self.wind_m_s2 = plus(self.wind_m_s2, share, plus(self.missing_m_s2, -1.0, self.wind_m_s2))
            return None
        towards, grown = (north / error_m, east / error_m, 0.0), plus(self.missing_m_s2, -1.0, self.wind_m_s2)
        force_m_s2 = min(split(grown, towards)[0], split(self.missing_m_s2, towards)[0])
        is_early = sample.time_boot_us - since_us < LEAST_US
        if force_m_s2 < HELD_M_S2 or split(self.velocity_m_s, towards)[0] > STEADY_M_S or is_early:
            return None
        # What it was in free air stays known.
        self.steady_since_us, self.steady_m_s = sample.time_boot_us, self.velocity_m_s
        return SustainedForce(plus(ZERO, -1.0 / math.hypot(*grown), grown), force_m_s2, since_us)

    def _smooth(self, sample: LocalPosition, thrust_ned_m_s2: Vector3) -> float:
        """Low-pass velocity and thrust; missing: the thrust less the velocity's change. Returns the time step in s."""
        velocity = sample.velocity_ned_m_s
        if self.time_us == 0:
            self.velocity_m_s, self.thrust_ned_m_s2, self.time_us = velocity, thrust_ned_m_s2, sample.time_boot_us
        elapsed_s, self.time_us = (sample.time_boot_us - self.time_us) * 1e-6, sample.time_boot_us
        weight = elapsed_s / (SMOOTHING_S + elapsed_s)
        self.velocity_m_s = plus(self.velocity_m_s, weight, plus(velocity, -1.0, self.velocity_m_s))
        self.thrust_ned_m_s2 = plus(self.thrust_ned_m_s2, weight, plus(thrust_ned_m_s2, -1.0, self.thrust_ned_m_s2))
        changes = plus(velocity, -1.0, self.velocity_m_s)
        n, e, _ = plus(self.thrust_ned_m_s2, -1.0 / SMOOTHING_S, changes)
        self.missing_m_s2 = (n, e, 0.0)
        return elapsed_s
