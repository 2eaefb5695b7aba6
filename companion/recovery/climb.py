"""A climb or a fall after a hit that the vehicle's own estimate does not know: reckoned, and ended."""

import math
from collections.abc import Iterable, Sequence
from dataclasses import dataclass, field

from companion.estimate.rotation import turned
from companion.estimate.strapdown import Strapdown
from companion.messages import Attitude, LocalPosition, Vector3
from companion.mission.config import GuardsConfig
from companion.recovery.thrown import FOLDED_RESTITUTION, FOLDS_US, STIFF_RESTITUTION, Approach, Throw, thrown
from companion.recovery.unseen import Unseen
from companion.recovery.way import REST

# PX4 falls with 8.3 m/s^2 at most: its MPC_THR_MIN, 0.12, of a hover at 0.78.
FALLING_MOST_M_S2 = 8.0
# The attitude's loop takes the turn of a hit away within 0.1 s; a second guard swings in after 0.03 s.
THROWN_US = 30_000
# Of a hit of which no turn is known: walls in simulation throw by as much.
UNTURNED = Throw(0.0, 0.2)
# Touches are no more alike than this: obstacles lean, and rims are round.
SPREAD_TIMES, LEAST_SPREAD_M_S = 1.5, 0.08
# An estimate is 0.02 s late (see estimate.approach).
ESTIMATE_LATE_US = 20_000
# Above a third of the usual range parts of a push may be clipped.
LOUD_M_S2 = 50.0
# Motors follow with 0.02 s, and what is asked waits 0.01 s for the vehicle's position loop.
LAG_S = 0.03
# What is left of a climb is to end within this, at first a setpoint's interval. A throw is braked after 0.12 s; to end
# so fast what is left then would ask for far more than is to be kept up, should nothing come any more.
WITHIN_S, AT_FIRST_US, LATER_WITHIN_S = 0.03, 120_000, 0.1
# As PX4's MPC_Z_P.
HEIGHT_PER_S = 1.0


@dataclass(slots=True)
class Climb:
    """How a vehicle moves up or down after a hit that its estimate does not know, down positive; SI.

    The hit itself, of which the accelerometer clips most, by how it turned the vehicle (`recovery.thrown`); what
    follows, by the accelerometer; both by how the estimate is put right (`recovery.unseen`). Changed only by `hear` and
    by `braking_m_s2` or `hold`, one of them whenever a setpoint leaves.
    """

    hit_boot_us: int  # its first sample
    free_until_boot_us: int
    velocity_ned_m_s: Vector3  # of the approach
    guards: GuardsConfig
    upwards_m_s2: float
    speed_m_s: float = 0.0
    height_down_m: float | None = None  # of the place that the estimate had told before the hit
    fallen_m: float = 0.0
    asked_m_s2: float = 0.0
    coming_m_s: float = 0.0  # of what was asked, what has not come about yet
    was_loud: bool = True  # the sample before
    time_boot_us: int = 0
    sum_m_s: float = 0.0
    throw: Throw = UNTURNED
    unseen: Unseen = field(init=False)
    _approach: Approach | None = None
    _turned_frd_rad_s: Vector3 = (0.0, 0.0, 0.0)
    _normal_ned: Vector3 = (0.0, 0.0, 0.0)
    _summed_m_s: float = 0.0
    _summed_m: float = 0.0
    _told_boot_us: int = 0

    def __post_init__(self) -> None:
        self.unseen = Unseen(self.speed_m_s, self.speed_m_s, LEAST_SPREAD_M_S)
        self._expect()

    @property
    def is_reckoned(self) -> bool:
        return self.upwards_m_s2 > 0.0

    def hear(
        self, strapdown: Strapdown, turns: Sequence[Attitude], pushed_us: int, normal_ned: Vector3, told: LocalPosition
    ) -> None:
        """What the newest sample adds; `turns`: the latest attitudes; `pushed_us`: how long the contact has lasted."""
        time_us, sum_m_s = strapdown.time_boot_us, strapdown.sum_ned_m_s[2]
        if time_us == self.time_boot_us or not self.is_reckoned:
            return
        if self.time_boot_us == 0:
            self.time_boot_us, self.sum_m_s = time_us, sum_m_s
            self._approach = self._came(turns)
        elapsed_s = 1e-6 * (time_us - self.time_boot_us)
        self._turn(strapdown, turns, pushed_us, normal_ned)
        is_loud = math.hypot(*strapdown.acceleration_ned_m_s2) >= LOUD_M_S2
        added_m_s = 0.0 if is_loud or self.was_loud else sum_m_s - self.sum_m_s  # half of it is the sample before's
        self._summed_m += elapsed_s * (self._summed_m_s + 0.5 * added_m_s)
        self._summed_m_s += added_m_s
        self.was_loud = is_loud
        self._take(told, time_us, 0.0 if is_loud else strapdown.acceleration_ned_m_s2[2])
        after_m_s = self.unseen.speed_m_s
        self.speed_m_s = after_m_s + self._summed_m_s
        self.fallen_m = 1e-6 * (time_us - self.hit_boot_us) * after_m_s + self._summed_m
        self.coming_m_s += elapsed_s * (self.asked_m_s2 - self.coming_m_s / LAG_S)
        self.time_boot_us, self.sum_m_s = time_us, sum_m_s

    def _came(self, turns: Sequence[Attitude]) -> Approach | None:
        """As of the last attitude before the contact."""
        before = [turn for turn in turns if turn.time_boot_us <= self.free_until_boot_us]
        if not before:
            return None
        last = before[-1]
        rates = last.angular_velocity_frd_rad_s or REST
        attitude = turned(last.attitude_wxyz, rates, 1e-6 * (self.free_until_boot_us - last.time_boot_us))
        return Approach(attitude, rates, self.velocity_ned_m_s)

    def _turn(self, strapdown: Strapdown, turns: Iterable[Attitude], pushed_us: int, normal_ned: Vector3) -> None:
        """The throw anew where a sample shows more of the turn, or the normal is known better."""
        approach, until_us, radii = self._approach, self.hit_boot_us + THROWN_US, self.guards.gyration_frd_m
        if approach is None or normal_ned[:2] == (0.0, 0.0):
            return
        told = ((turn.time_boot_us, turn.angular_velocity_frd_rad_s) for turn in turns)
        heard = [*told, (strapdown.time_boot_us, strapdown.rates_frd_rad_s)]
        p, q, r = approach.rates_frd_rad_s
        changes = [
            (w[0] - p, w[1] - q, w[2] - r)
            for time_us, w in heard
            if w is not None and self.free_until_boot_us < time_us <= until_us
        ]
        changes.append(self._turned_frd_rad_s)
        most = max(changes, key=lambda change: math.hypot(*(k * k * w for k, w in zip(radii, change, strict=True))))
        if (most, normal_ned) == (self._turned_frd_rad_s, self._normal_ned):
            return
        self._turned_frd_rad_s, self._normal_ned = most, normal_ned
        restitution = FOLDED_RESTITUTION if pushed_us >= FOLDS_US else STIFF_RESTITUTION
        self.throw = thrown(approach, normal_ned, most, restitution, self.guards) or UNTURNED
        self._expect()

    def _expect(self) -> None:
        unseen = self.unseen
        unseen.expected_m_s = unseen.before_m_s + self.throw.down_m_s
        unseen.spread_m_s = max(LEAST_SPREAD_M_S, SPREAD_TIMES * self.throw.spread_m_s)

    def _take(self, told: LocalPosition, now_us: int, acceleration_m_s2: float) -> None:
        """An estimate of after the hit."""
        at_us = told.time_boot_us - ESTIMATE_LATE_US
        if told.time_boot_us == self._told_boot_us or at_us <= self.hit_boot_us:
            return
        self._told_boot_us = told.time_boot_us
        behind_s = 1e-6 * (now_us - at_us)
        speed_m_s = told.velocity_ned_m_s[2] - self._summed_m_s + behind_s * acceleration_m_s2
        way_m = None
        if self.height_down_m is not None:
            way_m = told.position_ned_m[2] - self.height_down_m - self._summed_m + behind_s * self._summed_m_s
        self.unseen.told(1e-6 * (at_us - self.hit_boot_us), speed_m_s, way_m)

    def _wanted_m_s2(self) -> float:
        within_s = WITHIN_S if self.time_boot_us - self.hit_boot_us <= AT_FIRST_US else LATER_WITHIN_S
        wanted = -(self.speed_m_s + self.coming_m_s + HEIGHT_PER_S * self.fallen_m) / within_s
        return min(max(wanted, -self.upwards_m_s2), FALLING_MOST_M_S2)

    def braking_m_s2(self) -> float:
        """The acceleration to ask for now, which ends the climb and brings the height back."""
        self.asked_m_s2 = self._wanted_m_s2()
        return self.asked_m_s2

    def hold(self, asked_m_s2: float) -> None:
        """Another acceleration is asked for."""
        self.asked_m_s2 = asked_m_s2
