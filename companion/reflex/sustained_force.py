"""A sustained external force: thrust towards the setpoint, more and more, does not bring the vehicle there.

A vehicle that meets an obstacle slowly shows no hit. Its loops tilt it and raise its thrust by the position error and
by its integral, until it slips off or its own thrust pins it. A wall met at 0.2 m/s had it on the ground three
seconds later. In free air thrust is an acceleration, except for drag and wind. The missing one is the external force.
The thrust is the commanded one (ATTITUDE_TARGET): a ceiling cancels what the accelerometer would show of it. Without
that message the thrust is what the accelerometer shows along body z.
"""

import math
from dataclasses import dataclass, field

from companion.messages import LocalPosition, Quaternion, Vector3
from companion.motion.config import GRAVITY_M_S2
from companion.motion.rotation import body_to_ned, ned_to_body
from companion.motion.strapdown import ZERO
from companion.reflex.config import FOLLOWED_S, HELD_M_S2, IMPULSE_RAD, LEAD_S, PLACE_SPREAD_M, SMOOTHING_S, STEADY_M_S
from companion.reflex.detector import Impact, ImpactKind
from companion.reflex.halfspace import away_from, plus, split
from companion.reflex.impact import ImpactEstimate
from companion.reflex.normal import Normal
from companion.reflex.thrust import ThrustGain


@dataclass(slots=True)
class SustainedForceMonitor:
    """Updated with each position, and with the setpoint while one is flown to; reset by `forget`. Vectors: NED."""

    gain: ThrustGain = field(default_factory=ThrustGain)
    """Learnt at the setpoint."""
    time_us: int = 0
    measured_m_s2: float = GRAVITY_M_S2
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
        self.measured_m_s2 += (-specific_force_frd_m_s2[2] - self.measured_m_s2) / self.imu_count

    def step(
        self, sample: LocalPosition, attitude_wxyz: Quaternion, goal_ned_m: Vector3 | None
    ) -> ImpactEstimate | None:
        """Take one sample, the attitude and the setpoint as last sent; None while none is flown to.

        What is in the way, as an impact of a vehicle that hardly moves: its force is what it takes of the acceleration.
        """
        now_us, elapsed_s = sample.time_boot_us, self._smooth(sample, attitude_wxyz)
        short = ZERO if goal_ned_m is None else plus(goal_ned_m, -1.0, sample.position_ned_m)
        error_m, since_us = math.hypot(*short), self.steady_since_us
        if goal_ned_m is None:
            self.gain.known_s = 0.0
        elif error_m < PLACE_SPREAD_M or not self.gain.is_known:
            self.gain.learn(now_us, self.measured_m_s2, elapsed_s)
        is_new = since_us is None or math.dist(self.velocity_m_s, self.steady_m_s) > STEADY_M_S
        if since_us is None or is_new or error_m < PLACE_SPREAD_M:
            share, self.steady_since_us = 1.0 if is_new else elapsed_s / (FOLLOWED_S + elapsed_s), now_us
            self.steady_m_s = plus(self.steady_m_s, share, plus(self.velocity_m_s, -1.0, self.steady_m_s))
            self.wind_m_s2 = plus(self.wind_m_s2, share, plus(self.missing_m_s2, -1.0, self.wind_m_s2))
            return None
        towards, grown = plus(ZERO, 1.0 / error_m, short), plus(self.missing_m_s2, -1.0, self.wind_m_s2)
        force_m_s2 = min(split(grown, towards)[0], split(self.missing_m_s2, towards)[0])
        # A lean that began just now moves nothing yet, and a motor that fails has not let the vehicle down yet.
        is_early = now_us - since_us < 2.0 * 1e6 * LEAD_S
        if force_m_s2 < HELD_M_S2 or split(self.velocity_m_s, towards)[0] > STEADY_M_S or is_early:
            return None
        # What it was in free air stays known.
        self.steady_since_us, self.steady_m_s = now_us, self.velocity_m_s
        normal = away_from(plus(ZERO, -1.0, grown))
        force = ned_to_body(attitude_wxyz, plus(ZERO, force_m_s2, normal))
        return ImpactEstimate(
            impact=Impact(now_us, since_us, force, ImpactKind.STRUCK),
            time_boot_us=now_us,
            time_error_us=now_us - since_us,
            position_ned_m=sample.position_ned_m,
            velocity_ned_m_s=sample.velocity_ned_m_s,
            velocity_error_m_s=0.0,
            normal=Normal(normal, IMPULSE_RAD),
            peak_specific_force_m_s2=force_m_s2,
            impulse_m_s=0.5e-6 * force_m_s2 * (now_us - since_us),
            is_fully_measured=True,
            is_lower_bound=False,
            is_final=True,
        )

    def _smooth(self, sample: LocalPosition, attitude_wxyz: Quaternion) -> float:
        """Low-pass velocity and thrust; missing: the thrust less the velocity's change. Returns the time step in s."""
        now_us, velocity = sample.time_boot_us, sample.velocity_ned_m_s
        thrust_m_s2 = -self.gain.expected_m_s2(now_us, -self.measured_m_s2)
        thrust = plus((0.0, 0.0, GRAVITY_M_S2), 1.0, body_to_ned(attitude_wxyz, (0.0, 0.0, -thrust_m_s2)))
        if self.time_us == 0:
            self.velocity_m_s, self.thrust_ned_m_s2, self.time_us = velocity, thrust, now_us
        elapsed_s, self.time_us, self.imu_count = (now_us - self.time_us) * 1e-6, now_us, 0
        weight = elapsed_s / (SMOOTHING_S + elapsed_s)
        self.velocity_m_s = plus(self.velocity_m_s, weight, plus(velocity, -1.0, self.velocity_m_s))
        self.thrust_ned_m_s2 = plus(self.thrust_ned_m_s2, weight, plus(thrust, -1.0, self.thrust_ned_m_s2))
        changes = plus(velocity, -1.0, self.velocity_m_s)
        self.missing_m_s2 = plus(self.thrust_ned_m_s2, -1.0 / SMOOTHING_S, changes)
        return elapsed_s
