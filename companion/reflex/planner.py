"""Plan a minimum-jerk stop from the present motion, within an acceleration.

    x(s T) = x_0 + v_0 T (s - s^3 + s^4 / 2) + a_0 T^2 (s^2 / 2 - 2 s^3 / 3 + s^4 / 4)
             + e (10 s^3 - 15 s^4 + 6 s^5),          e = x_1 - x_0 - v_0 T / 2 - a_0 T^2 / 12

The first part brakes, the second levels the present tilt, the last covers the remaining distance e. T is the shortest
duration within that acceleration. A plan made anew from any motion on it is the same plan.
"""

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass

from companion.messages import Vector3
from companion.reflex import config as reflex
from companion.reflex.config import PLAN_PARTS
from companion.reflex.halfspace import Surface, limited, plus, split

REST: Vector3 = (0.0, 0.0, 0.0)


@dataclass(frozen=True, slots=True)
class MotionState:
    """Position, velocity and acceleration, local NED. The acceleration is that of the vehicle's own thrust alone."""

    position_ned_m: Vector3
    velocity_ned_m_s: Vector3
    acceleration_ned_m_s2: Vector3 = REST


@dataclass(frozen=True, slots=True)
class Plan:
    """A trajectory from a motion to rest at the goal, within a duration."""

    start: MotionState
    goal_ned_m: Vector3
    duration_s: float

    def at(self, elapsed_s: float, lead_s: float = reflex.LEAD_S) -> MotionState:
        """The motion after `elapsed_s`, with the acceleration of `lead_s` later, because the thrust lags."""
        if elapsed_s >= self.duration_s:
            return MotionState(self.goal_ned_m, REST)
        s = max(0.0, elapsed_s) / self.duration_s
        leans = 0.5 * s**2 - 2.0 / 3.0 * s**3 + 0.25 * s**4
        moved = self._sum(s - s**3 + 0.5 * s**4, leans, 10.0 * s**3 - 15.0 * s**4 + 6.0 * s**5)
        moves = self._sum(1.0 - 3.0 * s**2 + 2.0 * s**3, s - 2.0 * s**2 + s**3, 30.0 * (s - s**2) ** 2)
        return MotionState(
            plus(self.start.position_ned_m, 1.0, moved),
            plus(REST, 1.0 / self.duration_s, moves),
            self._acceleration(min(1.0, s + lead_s / self.duration_s)),
        )

    def most_m_s2(self) -> float:
        """The plan's largest acceleration, m/s^2."""
        return max(math.hypot(*self._acceleration(part / PLAN_PARTS)) for part in range(1, PLAN_PARTS))

    def _acceleration(self, s: float) -> Vector3:
        bends = self._sum(6.0 * (s**2 - s), 1.0 - 4.0 * s + 3.0 * s**2, 60.0 * s - 180.0 * s**2 + 120.0 * s**3)
        return plus(REST, self.duration_s**-2, bends)

    def _sum(self, of_drift: float, of_lean: float, of_rest: float) -> Vector3:
        """Multiples of v_0 T, a_0 T^2 and e."""
        drift = plus(REST, self.duration_s, self.start.velocity_ned_m_s)
        lean = plus(REST, self.duration_s**2, self.start.acceleration_ned_m_s2)
        rest = plus(plus(plus(self.goal_ned_m, -1.0, self.start.position_ned_m), -0.5, drift), -1.0 / 12.0, lean)
        return plus(plus(plus(REST, of_drift, drift), of_lean, lean), of_rest, rest)


def shortest(state: MotionState, goal_ned_m: Callable[[float], Vector3], most_m_s2: float) -> Plan:
    """The shortest plan within an acceleration, to a goal that depends on its duration."""
    duration_s = reflex.SHORTEST_S
    while True:
        found = Plan(state, goal_ned_m(duration_s), duration_s)
        if not found.most_m_s2() > most_m_s2:  # nor one that is no number, which no duration mends
            return found
        duration_s *= reflex.DURATION_STEP


def holds(planned: MotionState, motion: MotionState, most_m_s2: float) -> bool:
    """Whether the vehicle follows the plan: it lags by LEAD_S, and its place by half of that over a plan."""
    within_m_s = reflex.LEAD_S * most_m_s2
    off_m_s = math.dist(planned.velocity_ned_m_s, motion.velocity_ned_m_s)
    off_m = math.dist(planned.position_ned_m, motion.position_ned_m)
    return off_m_s <= within_m_s and off_m <= 0.5 * within_m_s * reflex.SHORTEST_S


def with_feedback(planned: MotionState, motion: MotionState) -> Vector3:
    """The plan's acceleration, plus the feedback of PX4's loops for a vehicle that is off the plan."""
    slower = plus(planned.velocity_ned_m_s, -1.0, motion.velocity_ned_m_s)
    short = plus(planned.position_ned_m, -1.0, motion.position_ned_m)
    return plus(planned.acceleration_ned_m_s2, reflex.VELOCITY_PER_S, plus(slower, reflex.PLACE_PER_S, short))


def kept_off(
    acceleration_ned_m_s2: Vector3,
    state: MotionState,
    surfaces: Sequence[Surface],
    most_m_s2: float,
) -> Vector3:
    """The acceleration setpoint without any part that leads into a surface nearer than its clearance.

    `state` has the acceleration of the present tilt. Levelling takes 2 LEAD_S. The speed away from the surface then is
    not below zero: braking a vehicle that leaves is allowed, and one that tilts or flies into the surface tilts away.
    """
    for surface in surfaces:
        if not -reflex.BEHIND_M <= surface.off_m(state.position_ned_m) < surface.distance_m:
            continue
        normal = surface.normal_ned
        leaving_m_s = split(plus(state.velocity_ned_m_s, 2.0 * reflex.LEAD_S, state.acceleration_ned_m_s2), normal)[0]
        least_m_s2 = min(-leaving_m_s / reflex.LEAD_S, reflex.HARD_BRAKING * most_m_s2)
        short_m_s2 = least_m_s2 - split(acceleration_ned_m_s2, normal)[0]
        if short_m_s2 > 0.0:
            acceleration_ned_m_s2 = plus(acceleration_ned_m_s2, short_m_s2, normal)
    return acceleration_ned_m_s2


def safe_to_hold(acceleration_ned_m_s2: Vector3, velocity_ned_m_s: Vector3) -> Vector3:
    """The horizontal acceleration, limited so that PX4 can hold it until it notices the silence.

    Held for HELD_S + NOTICED_S it makes no vehicle faster than it is, or than HELD_TO_M_S.
    """
    was, held_s = (velocity_ned_m_s[0], velocity_ned_m_s[1], 0.0), reflex.HELD_S + reflex.NOTICED_S
    made = plus(was, held_s, (acceleration_ned_m_s2[0], acceleration_ned_m_s2[1], 0.0))
    made = limited(made, max(math.hypot(*was), reflex.HELD_TO_M_S))
    n, e, _ = plus(REST, 1.0 / held_s, plus(made, -1.0, was))
    return (n, e, acceleration_ned_m_s2[2])


def height_feedback(
    state: MotionState, spread_m_s: float, told_m_s: float, down_m: float, loops: float, most_m_s2: float
) -> float:
    """Vertical acceleration, m/s^2 down, back to a height: `loops` times the setpoint of PX4's own loops.

    The reported vertical speed is limited to the estimated one plus or minus its standard deviation.
    """
    reckoned_m_s = state.velocity_ned_m_s[2]
    speed_m_s = min(max(told_m_s, reckoned_m_s - spread_m_s), reckoned_m_s + spread_m_s)
    asked = loops * reflex.CLIMB_GAIN_PER_S * (reflex.HEIGHT_PER_S * (down_m - state.position_ned_m[2]) - speed_m_s)
    return min(max(asked, -most_m_s2), most_m_s2)
