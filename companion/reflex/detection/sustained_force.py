"""A sustained external force: thrust does not move the vehicle in its direction, or tips it over.

A vehicle that meets an obstacle slowly shows no hit. Its loops tilt it and raise its thrust by the position error and
by its integral, until it slips off or its own thrust tips it over. A wall met at 0.2 m/s had it on the ground three
seconds later, whether it stood there or slid along. In free air thrust is an acceleration, except for drag and wind.
The missing one is the external force, unless the vehicle moves: with the thrust, or against it, as a gust has it.
The thrust is the commanded one (ATTITUDE_TARGET): a ceiling cancels what the accelerometer would show of it. Without
that message the thrust is what the accelerometer shows along body z.

A vehicle that slides along a surface, or touches it below its centre, is tipped towards it by an external torque, and
more so by its own thrust. In free flight no lean is beyond all recent setpoints of its attitude control, in any
direction.
"""

import math
from collections import deque
from dataclasses import dataclass, field

import shapely

from companion.messages import AttitudeTarget, LocalPosition, Vector3
from companion.motion.config import GATE, GRAVITY_M_S2, KEPT_US, SAME_M_S
from companion.motion.rotation import body_to_ned, ned_to_body
from companion.motion.strapdown import Strapdown
from companion.motion.vector import ZERO, along, flat, minus, plus, split, towards, unit
from companion.reflex import config as reflex
from companion.reflex.detection.classify import hovers
from companion.reflex.detection.detector import Evidence, Impact, ImpactKind
from companion.reflex.detection.free_flight import ThrustGain
from companion.reflex.detection.impact import ImpactEstimate
from companion.reflex.surface import Normal, away_from

_UP_FRD = (0.0, 0.0, -1.0)


@dataclass(slots=True)
class SustainedForceMonitor:
    """Updated with each position, and with the setpoint while one is flown to; reset by `forget`. Vectors: NED."""

    gain: ThrustGain = field(default_factory=ThrustGain)  # learnt at the setpoint
    time_us: int = 0
    measured_frd_m_s2: Vector3 = (0.0, 0.0, -GRAVITY_M_S2)
    imu_count: int = 0  # IMU samples in the mean since the last position
    velocity_m_s: Vector3 = ZERO
    thrust_ned_m_s2: Vector3 = ZERO
    missing_m_s2: Vector3 = ZERO
    wind_m_s2: Vector3 = ZERO
    """Mean of the missing acceleration at the setpoint and in free motion: it balances drag and wind."""
    hover_wind_m_s2: Vector3 = ZERO
    """Horizontal specific force across the thrust when the vehicle hovered last: the wind's."""
    pushed_since_us: int = 0  # time since which half of a sustained force has been missing
    setpoints: deque[tuple[int, Vector3]] = field(default_factory=deque)
    """Direction of the thrust that the vehicle's attitude control was set to, with its time."""
    error_variance: float = 0.0  # mean square of the lean's error, beyond them
    error_known_s: float = 0.0
    error_us: int = 0  # when it was looked at last

    def forget(self) -> None:
        self.time_us = self.error_us = 0
        self.setpoints.clear()

    def set_attitude(self, sample: AttitudeTarget) -> None:
        """Take the setpoint of the vehicle's attitude control; those that it may still follow are kept."""
        self.gain.set_fraction(sample.time_boot_us, sample.thrust_fraction)
        kept, time_us = self.setpoints, sample.time_boot_us
        if kept and time_us <= kept[-1][0] - KEPT_US:
            kept.clear()
        if sample.attitude_wxyz is not None and not (kept and time_us <= kept[-1][0]):
            kept.append((time_us, body_to_ned(sample.attitude_wxyz, _UP_FRD)))
            while len(kept) > 1 and kept[1][0] < time_us - reflex.FOLLOWS_US:
                kept.popleft()

    def add_imu(self, specific_force_frd_m_s2: Vector3) -> None:
        """Take one sample of the accelerometer; the mean of those between two positions counts."""
        self.imu_count += 1
        (x, y, z), (a, b, c), share = self.measured_frd_m_s2, specific_force_frd_m_s2, 1.0 / self.imu_count
        self.measured_frd_m_s2 = (x + share * (a - x), y + share * (b - y), z + share * (c - z))

    def step(
        self, sample: LocalPosition, strapdown: Strapdown, goal_ned_m: Vector3 | None, is_free: bool, may_tip: bool
    ) -> ImpactEstimate | None:
        """Take one sample, the attitude and the setpoint as last sent; None while none is flown to.

        What is in the way, as an impact of a vehicle that hardly moves: its force is what it takes of the acceleration.
        `is_free`: nothing touches the vehicle, and wind may be learnt. `may_tip`: one that tips is looked for, too.
        """
        now_us, attitude_wxyz = sample.time_boot_us, strapdown.valid_wxyz
        if is_free and self.time_us and hovers(sample.velocity_ned_m_s):
            x, y, _ = self.measured_frd_m_s2
            across, elapsed_s = flat(body_to_ned(attitude_wxyz, (x, y, 0.0))), 1e-6 * (now_us - self.time_us)
            self.hover_wind_m_s2 = towards(self.hover_wind_m_s2, across, elapsed_s / (reflex.SMOOTHING_S + elapsed_s))
        thrust = self._held(sample, goal_ned_m, self._smooth(sample, strapdown))
        if thrust is None and may_tip:
            thrust = self._tipped(strapdown)
        if thrust is None:
            return None
        force_m_s2, since_us, self.pushed_since_us = math.hypot(*thrust), self.pushed_since_us, now_us
        normal = away_from(plus(ZERO, -1.0, thrust))
        force = ned_to_body(attitude_wxyz, plus(ZERO, force_m_s2, normal))
        return ImpactEstimate(
            impact=Impact(now_us, since_us, force, ImpactKind.STRUCK, Evidence.SUSTAINED),
            time_boot_us=now_us,
            time_error_us=now_us - since_us,
            position_ned_m=sample.position_ned_m,
            velocity_ned_m_s=sample.velocity_ned_m_s,
            normal=Normal(normal, reflex.IMPULSE_RAD),
            peak_specific_force_m_s2=force_m_s2,
            impulse_m_s=0.5e-6 * force_m_s2 * (now_us - since_us),
            is_fully_measured=True,
            is_lower_bound=False,
        )

    def _held(self, sample: LocalPosition, goal_ned_m: Vector3 | None, elapsed_s: float) -> Vector3 | None:
        """The thrust per mass that an external force has held for FOLLOWS_US, horizontal or not; None for none."""
        now_us, short = sample.time_boot_us, ZERO if goal_ned_m is None else minus(goal_ned_m, sample.position_ned_m)
        is_there = math.hypot(*short) < reflex.PLACE_SPREAD_M
        if goal_ned_m is None:
            self.gain.known_s = 0.0
        elif is_there or self.gain.known_s < reflex.MEMORY_S:
            self.gain.learn(now_us, -self.measured_frd_m_s2[2], elapsed_s)
        grown = minus(self.missing_m_s2, self.wind_m_s2)
        pushes = unit(grown)
        force_m_s2 = min(along(grown, pushes), along(self.missing_m_s2, pushes))
        along_m_s, across = split(self.velocity_m_s, pushes)
        across_m_s = math.hypot(*across)
        # One that slides moves along the force, too: friction and wind turn the force by up to 60 degrees.
        most_back_m_s = max(SAME_M_S, min(across_m_s, 2.0 * SAME_M_S))
        most_on_m_s = max(SAME_M_S, min(2.0 * across_m_s, reflex.SLOW_M_S))
        is_free = along_m_s >= most_on_m_s or along_m_s <= -most_back_m_s
        if is_there or is_free:
            share = 1.0 if abs(along_m_s) > reflex.SLOW_M_S else elapsed_s / (reflex.FOLLOWED_S + elapsed_s)
            self.wind_m_s2 = plus(self.wind_m_s2, share, grown)
        if is_free or force_m_s2 < reflex.PRESSES_M_S2 or along(short, pushes) <= 0.0:
            self.pushed_since_us = now_us
        # A lean that began just now moves nothing yet, and a motor that fails has not let the vehicle down yet.
        if force_m_s2 < reflex.HELD_M_S2 or now_us - self.pushed_since_us < reflex.FOLLOWS_US:
            return None
        return plus(ZERO, force_m_s2, pushes)

    def _tipped(self, strapdown: Strapdown) -> Vector3 | None:
        """The thrust per mass that is held where an external torque leans the vehicle to: beyond all setpoints of the
        last FOLLOWS_US. None for none. What is missing there is no wind, which does not turn it.
        """
        setpoints, fixes, now_us = self.setpoints, strapdown.fixes, strapdown.time_boot_us
        since_us = now_us - self.error_us
        n, e, _ = self.missing_m_s2
        # Where no force is missing, it is only learnt how well the vehicle follows.
        if since_us < reflex.FOLLOWS_US and math.hypot(n, e) < reflex.PRESSES_M_S2:
            return None
        # Some may be lost, and those of before a stall say nothing of the attitude after it.
        if not setpoints or now_us - setpoints[-1][0] >= reflex.LONGEST_STEP_US:
            return None
        if not reflex.FOLLOWS_US <= now_us - setpoints[0][0] < len(setpoints) * reflex.LONGEST_STEP_US:
            return None
        # After a silence or a reset the two do not compare.
        if not fixes or now_us - fixes[0].time_boot_us < reflex.FOLLOWS_US:
            return None
        # From what lies between the setpoints to the thrust's direction; zero for one amid them.
        amid = shapely.convex_hull(shapely.multipoints([each for _, each in setpoints]))
        up = shapely.points(body_to_ned(strapdown.attitude_wxyz, _UP_FRD))
        (from_n, from_e), (to_n, to_e) = shapely.get_coordinates(shapely.shortest_line(amid, up)).tolist()
        error = (to_n - from_n, to_e - from_e, 0.0)
        beyond, leant = math.hypot(*error), unit(error)
        limit = max(reflex.LEAN_ERROR, GATE * math.sqrt(self.error_variance))
        elapsed_s, self.error_us = 1e-6 * min(since_us, reflex.FOLLOWS_US), now_us
        known_s = self.error_known_s = min(self.error_known_s + elapsed_s, reflex.LEAN_ERROR_MEMORY_S)
        self.error_variance += elapsed_s / known_s * (min(beyond, limit) ** 2 - self.error_variance)
        if beyond <= limit or known_s < reflex.LEARNT_S:
            return None
        force_m_s2 = along(self.missing_m_s2, leant)
        is_free = along(self.velocity_m_s, leant) > reflex.SLOW_M_S
        return None if is_free or force_m_s2 < reflex.PRESSES_M_S2 else plus(ZERO, force_m_s2, leant)

    def _smooth(self, sample: LocalPosition, strapdown: Strapdown) -> float:
        """Low-pass velocity and thrust; missing: the thrust less the velocity's change. Returns the time step in s."""
        now_us, velocity, is_first = sample.time_boot_us, sample.velocity_ned_m_s, self.time_us == 0
        thrust_m_s2 = -self.gain.expected_m_s2(now_us, self.measured_frd_m_s2[2])
        thrust = plus((0.0, 0.0, GRAVITY_M_S2), 1.0, body_to_ned(strapdown.valid_wxyz, (0.0, 0.0, -thrust_m_s2)))
        if is_first:
            self.velocity_m_s, self.thrust_ned_m_s2, self.time_us = velocity, thrust, now_us
        elapsed_s, self.time_us, self.imu_count = (now_us - self.time_us) * 1e-6, now_us, 0
        weight = elapsed_s / (reflex.SMOOTHING_S + elapsed_s)
        self.velocity_m_s = towards(self.velocity_m_s, velocity, weight)
        self.thrust_ned_m_s2 = towards(self.thrust_ned_m_s2, thrust, weight)
        changes = minus(velocity, self.velocity_m_s)
        self.missing_m_s2 = plus(self.thrust_ned_m_s2, -1.0 / reflex.SMOOTHING_S, changes)
        if is_first:
            self.wind_m_s2 = self.missing_m_s2
        return elapsed_s
