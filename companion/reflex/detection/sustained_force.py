"""A sustained external force: thrust does not move the vehicle in its direction, or tips it over.

A vehicle that meets an obstacle slowly shows no hit. Its loops tilt it and raise its thrust by the position error and
by its integral, until it slips off or its own thrust tips it over. A wall met at 0.2 m/s had it on the ground three
seconds later, whether it stood there or slid along. In free air thrust is an acceleration, except for drag and wind.
The missing one is the external force, unless the vehicle moves: with the thrust, or against it, as a gust has it.
The thrust is the commanded one (ATTITUDE_TARGET): a ceiling cancels what the accelerometer would show of it. Without
that message the thrust is what the accelerometer shows along body z.

A vehicle that slides along a surface, or touches it below its centre, tips towards it. Its thrust then presses it on,
and tips it more. In free flight its tilt is one that its own control has asked for lately, or lies between two of them.
"""

import math
from collections import deque
from dataclasses import dataclass, field
from itertools import pairwise

from companion.messages import AttitudeTarget, LocalPosition, Quaternion, Vector3
from companion.motion.config import GRAVITY_M_S2
from companion.motion.rotation import body_to_ned, ned_to_body
from companion.motion.strapdown import Strapdown
from companion.motion.vector import ZERO, along, flat, minus, plus, split, towards, unit
from companion.reflex import config as reflex
from companion.reflex.detection.classify import hovers
from companion.reflex.detection.detector import Impact, ImpactKind
from companion.reflex.detection.free_flight import ThrustGain
from companion.reflex.detection.impact import ImpactEstimate
from companion.reflex.surface import Normal, away_from


@dataclass(slots=True)
class SustainedForceMonitor:
    """Updated with each position, and with the setpoint while one is flown to; reset by `forget`. Vectors: NED."""

    gain: ThrustGain = field(default_factory=ThrustGain)
    """Learnt at the setpoint."""
    time_us: int = 0
    measured_frd_m_s2: Vector3 = (0.0, 0.0, -GRAVITY_M_S2)
    imu_count: int = 0
    """IMU samples in the mean since the last position."""
    velocity_m_s: Vector3 = ZERO
    thrust_ned_m_s2: Vector3 = ZERO
    missing_m_s2: Vector3 = ZERO
    wind_m_s2: Vector3 = ZERO
    """Mean of the missing acceleration at the setpoint and in free motion: it balances drag and wind."""
    hover_wind_m_s2: Vector3 = ZERO
    """Horizontal specific force across the thrust when the vehicle hovered last: the wind's."""
    pushed_since_us: int = 0
    """Time since which half of a sustained force has been missing."""
    asked: deque[tuple[int, tuple[float, float]]] = field(default_factory=deque)
    """Leans that the vehicle's own control asked for, in its own frame, with their times."""
    tips_variance: float = 0.0
    """Mean square of the lean beyond them."""
    tips_known_s: float = 0.0
    looked_us: int = 0

    def forget(self) -> None:
        self.time_us = self.looked_us = 0
        self.asked.clear()

    def ask(self, sample: AttitudeTarget) -> None:
        """Take what the vehicle's own control asks for; what it may still follow is kept."""
        self.gain.set_fraction(sample.time_boot_us, sample.thrust_fraction)
        if sample.attitude_wxyz is None or (self.asked and sample.time_boot_us <= self.asked[-1][0]):
            return
        self.asked.append((sample.time_boot_us, _lean(sample.attitude_wxyz)))
        while len(self.asked) > 1 and self.asked[1][0] < sample.time_boot_us - reflex.FOLLOWS_US:
            self.asked.popleft()

    def add_imu(self, specific_force_frd_m_s2: Vector3) -> None:
        """Take one sample of the accelerometer; the mean of those between two positions counts."""
        self.imu_count += 1
        self.measured_frd_m_s2 = towards(self.measured_frd_m_s2, specific_force_frd_m_s2, 1.0 / self.imu_count)

    def learn_wind(self, sample: LocalPosition, attitude_wxyz: Quaternion) -> None:
        """Take one sample, before `step` does, of a vehicle that nothing touches."""
        if self.time_us and hovers(sample.velocity_ned_m_s):
            x, y, _ = self.measured_frd_m_s2
            across = flat(body_to_ned(attitude_wxyz, (x, y, 0.0)))
            elapsed_s = 1e-6 * (sample.time_boot_us - self.time_us)
            self.hover_wind_m_s2 = towards(self.hover_wind_m_s2, across, elapsed_s / (reflex.SMOOTHING_S + elapsed_s))

    def step(
        self, sample: LocalPosition, strapdown: Strapdown, goal_ned_m: Vector3 | None, may_tip: bool = True
    ) -> ImpactEstimate | None:
        """Take one sample, the attitude and the setpoint as last sent; None while none is flown to.

        What is in the way, as an impact of a vehicle that hardly moves: its force is what it takes of the acceleration.
        `may_tip`: a vehicle that tips is looked for, too.
        """
        now_us, attitude_wxyz, elapsed_s = sample.time_boot_us, strapdown.valid_wxyz, self._smooth(sample, strapdown)
        presses = self._presses(sample, goal_ned_m, elapsed_s)
        if presses == ZERO and may_tip:
            presses = self._tips(strapdown, now_us)
        if presses == ZERO:
            return None
        force_m_s2, since_us, self.pushed_since_us = math.hypot(*presses), self.pushed_since_us, now_us
        normal = away_from(plus(ZERO, -1.0, presses))
        force = ned_to_body(attitude_wxyz, plus(ZERO, force_m_s2, normal))
        return ImpactEstimate(
            impact=Impact(now_us, since_us, force, ImpactKind.STRUCK),
            time_boot_us=now_us,
            time_error_us=now_us - since_us,
            position_ned_m=sample.position_ned_m,
            velocity_ned_m_s=sample.velocity_ned_m_s,
            normal=Normal(normal, reflex.IMPULSE_RAD),
            peak_specific_force_m_s2=force_m_s2,
            impulse_m_s=0.5e-6 * force_m_s2 * (now_us - since_us),
            is_fully_measured=True,
            is_lower_bound=False,
            is_final=True,
        )

    def _presses(self, sample: LocalPosition, goal_ned_m: Vector3 | None, elapsed_s: float) -> Vector3:
        """The force per mass with which the vehicle has long pressed on something; zero while it has not."""
        now_us, short = sample.time_boot_us, ZERO if goal_ned_m is None else minus(goal_ned_m, sample.position_ned_m)
        is_there = math.hypot(*short) < reflex.PLACE_SPREAD_M
        if goal_ned_m is None:
            self.gain.known_s = 0.0
        elif is_there or not self.gain.is_known:
            self.gain.learn(now_us, -self.measured_frd_m_s2[2], elapsed_s)
        grown = minus(self.missing_m_s2, self.wind_m_s2)
        pushes = unit(grown)
        force_m_s2 = min(along(grown, pushes), along(self.missing_m_s2, pushes))
        along_m_s, across = split(self.velocity_m_s, pushes)
        is_free = _is_free(along_m_s, math.hypot(*across))
        if is_there or is_free:
            share = 1.0 if abs(along_m_s) > reflex.FREE_M_S else elapsed_s / (reflex.FOLLOWED_S + elapsed_s)
            self.wind_m_s2 = plus(self.wind_m_s2, share, grown)
        if is_free or force_m_s2 < 0.5 * reflex.HELD_M_S2 or along(short, pushes) <= 0.0:
            self.pushed_since_us = now_us
        # A lean that began just now moves nothing yet, and a motor that fails has not let the vehicle down yet.
        if force_m_s2 < reflex.HELD_M_S2 or now_us - self.pushed_since_us < reflex.FOLLOWS_US:
            return ZERO
        return plus(ZERO, force_m_s2, pushes)

    def _tips(self, strapdown: Strapdown, now_us: int) -> Vector3:
        """The force per mass with which the vehicle presses to where it leans beyond all that its own control has asked
        for of late; zero for none. What is missing there is no wind, which does not turn it.
        """
        asked, fixes, since_us = self.asked, strapdown.fixes, now_us - self.looked_us
        half_m_s2 = 0.5 * reflex.HELD_M_S2
        # Where nothing presses, it is only learnt how well the vehicle follows.
        if since_us < reflex.FOLLOWS_US and math.hypot(*flat(self.missing_m_s2)) < half_m_s2:
            return ZERO
        if not asked or not reflex.FOLLOWS_US <= now_us - asked[0][0] < len(asked) * reflex.LONGEST_STEP_US:
            return ZERO
        # After a silence or a reset the two do not compare.
        if not fixes or now_us - fixes[0].time_boot_us < reflex.FOLLOWS_US:
            return ZERO
        place = _lean(strapdown.attitude_wxyz)
        square, beyond = min(_beyond(place, start, end) for (_, start), (_, end) in pairwise(asked))
        limit = max(reflex.TIPS, reflex.TIPS_GATE * math.sqrt(self.tips_variance))
        elapsed_s, self.looked_us = 1e-6 * min(since_us, reflex.FOLLOWS_US), now_us
        known_s = self.tips_known_s = min(self.tips_known_s + elapsed_s, reflex.TIPS_MEMORY_S)
        self.tips_variance += elapsed_s / known_s * (min(square, limit * limit) - self.tips_variance)
        pushes = unit(beyond)
        force_m_s2, along_m_s = along(self.missing_m_s2, pushes), along(self.velocity_m_s, pushes)
        is_pressed = force_m_s2 >= half_m_s2 and along_m_s <= reflex.FREE_M_S
        tips = square > limit * limit and known_s >= reflex.LEARNT_S
        return plus(ZERO, force_m_s2, pushes) if is_pressed and tips else ZERO

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


def _lean(attitude_wxyz: Quaternion) -> tuple[float, float]:
    """North and east of the unit vector along the thrust."""
    w, x, y, z = attitude_wxyz
    return -2.0 * (x * z + w * y), 2.0 * (w * x - y * z)


def _beyond(place: tuple[float, float], start: tuple[float, float], end: tuple[float, float]) -> tuple[float, Vector3]:
    """How far north and east a lean is from the nearest one between start and end: the square, and the way."""
    (n, e), (a, b), (c, d) = place, start, end
    n, e, c, d = n - a, e - b, c - a, d - b
    whole = c * c + d * d
    share = min(max((n * c + e * d) / whole, 0.0), 1.0) if whole > 0.0 else 0.0
    n, e = n - share * c, e - share * d
    return n * n + e * e, (n, e, 0.0)


def _is_free(along_m_s: float, across_m_s: float) -> bool:
    """Whether a vehicle with this velocity along a force, and across it, is not held by a surface.

    One that slides moves along the force, too: friction and wind turn the force by up to 60 degrees.
    """
    most_back_m_s = max(reflex.STEADY_M_S, min(across_m_s, 2.0 * reflex.STEADY_M_S))
    most_on_m_s = max(reflex.STEADY_M_S, min(2.0 * across_m_s, reflex.FREE_M_S))
    return along_m_s >= most_on_m_s or along_m_s <= -most_back_m_s
