"""One collision, and the recovery from it: goal, law, touch and rest, from the companion's own belief.

Until the vehicle rests it is flown by attitude and thrust, then by a position.
"""

import math
from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from typing import NamedTuple, Protocol

from companion.messages import LocalPosition, Vector3
from companion.motion.config import LATEST_S, SHOWN_US, SettledConfig
from companion.motion.settling import Lasting, SettlingMonitor
from companion.motion.vector import ZERO, along, minus, plus, unit
from companion.reflex import config as reflex
from companion.reflex.belief.motion_estimator import MotionEstimator
from companion.reflex.detection.confirmation import Hypothesis
from companion.reflex.detection.detector import DetectorState, Phase
from companion.reflex.detection.impact import ImpactEstimator
from companion.reflex.recovery.attitude_law import brakable_m_s
from companion.reflex.recovery.laws import Law
from companion.reflex.surface import Contact, MotionState, Normal, Surface, away_from, projected, with_change


@dataclass(frozen=True, slots=True)
class CollisionReport:
    """One collision, as the companion measured it from telemetry. Positions are the vehicle's local NED."""

    detected_at_us: int
    sample_time_boot_us: int
    detector: str
    position_ned_m: Vector3
    impact_velocity_ned_m_s: Vector3  # v_c of the paper: just before contact
    impact_speed_m_s: float
    normal_ned: Vector3  # unit vector out of the obstacle, by the whole contact; horizontal unless that is steep
    peak_specific_force_m_s2: float  # of the contact alone, the largest in one IMU sample
    recovery_setpoint_ned_m: Vector3
    settled_after_s: float | None  # from the hit to the start of the interval in which it stayed settled; None: not
    overshoot_m: float  # largest distance past the setpoint, away from the obstacle, until the recovery ended
    rebound_speed_m_s: float | None
    """Largest speed along the normal until 0.1 s after the contact; 0 when it never moved back, None when the vehicle's
    velocity was not valid then (a clipped hit)."""


class Room(Protocol):
    """What is known of the space around by whoever flies; local NED."""

    def surfaces(self, contact: Contact) -> Sequence[Surface]:
        """What lies in front of a vehicle that has just been hit, besides what hit it."""
        ...

    def inside(self, contact_ned_m: Vector3, goal_ned_m: Vector3) -> Vector3:
        """The goal, or where the way to it ends."""
        ...


class Progress(NamedTuple):
    """What one position has shown, each None where it has not: seconds since the hit, and a speed off the obstacle."""

    is_rejected: bool  # the hit was none, as nothing but its first message shows it
    rested_s: float | None  # it rests, and is flown by a position from now on
    rebound_m_s: float | None  # the goal has moved


@dataclass(slots=True)
class Collision:
    """Changed only by its methods. Positions and velocities in local NED; boot times in the vehicle's clock."""

    detected_at_us: int
    detector: str
    peak_specific_force_m_s2: float
    source: ImpactEstimator
    estimator: MotionEstimator
    law: Law
    config: reflex.RecoveryConfig
    settled: SettledConfig
    room: Room
    earlier: Sequence[Surface] = ()  # what was hit before in the same recovery
    keeps_trim: bool = False  # see interface.Autopilot
    hypothesis: Hypothesis | None = None  # until it is confirmed or rejected
    settled_after_s: float | None = None  # from its first sample to the beginning of its rest; the recovery is over
    is_over: bool = False  # settled, or given up on
    overshoot_m: float = 0.0
    rebound_speed_m_s: float | None = None  # the largest along the normal, until the rebound is over
    setpoint_ned_m: Vector3 = field(init=False)  # where to rest, as known now
    leans: bool = field(init=False)  # it is flown by attitude
    surfaces: list[Surface] = field(init=False)
    _contact: Contact = field(init=False)  # as known now, at the vehicle's place while the obstacle goes along
    _told_ned_m: Vector3 = field(init=False)
    _held_since_us: int = field(init=False)  # by a position
    _monitor: SettlingMonitor = field(init=False)
    _slow: Lasting = field(default_factory=Lasting)
    _has_left: bool = False
    _has_passed: bool = False

    def __post_init__(self) -> None:
        self.leans, self._contact, self._held_since_us = self.law.leans, self.contact, self.estimator.hit_boot_us
        self.surfaces, self._monitor = self._around(self._contact), SettlingMonitor(self.settled)
        self.setpoint_ned_m = self._told_ned_m = self._goal(self.estimator.start)

    @property
    def rests_s(self) -> float:
        """How long it is slow before it rests. Where a tilt that still brakes would be kept, none is left by then."""
        return self.settled.duration_s if self.keeps_trim else reflex.RESTS_S

    @property
    def has_rested(self) -> bool:
        """Whether it came to rest by attitude, and is flown by a position since."""
        return self.law.leans and not self.leans

    @property
    def contact(self) -> Contact:
        return self.estimator.contact

    @property
    def normal(self) -> Normal:
        """The obstacle's normal by all that is known now."""
        before_m_s, estimator = self.contact.velocity_ned_m_s, self.estimator
        error_m_s = math.hypot(self.contact.velocity_error_m_s, estimator.after_error_m_s)
        normal = with_change(estimator.normal, before_m_s, estimator.after_ned_m_s, error_m_s)
        return Normal(away_from(normal.direction_ned), normal.error_rad)

    def follow(self, state: DetectorState) -> None:
        """Take the newest sample; the contact's largest force while it lasts."""
        strapdown, estimate, hit_us = self.source.strapdown, self.source.estimate, self.estimator.hit_boot_us
        # In these phases the state still describes the contact.
        is_in_contact = state.phase in (Phase.CONTACT, Phase.ARMED)
        # A velocity that shows it may have come before the sample of the same time.
        is_larger = state.peak_specific_force_m_s2 > self.peak_specific_force_m_s2
        is_seen_again = is_in_contact and (is_larger or state.last_loud_boot_us > hit_us)
        if self.hypothesis is not None:
            self.hypothesis.follow(strapdown.time_boot_us)
            is_turned = state.turn.value > state.turn.limit
            self.hypothesis = None if is_turned or is_seen_again else self.hypothesis
        if is_in_contact and estimate is not None and estimate.impact.sample_time_boot_us == hit_us:
            self.peak_specific_force_m_s2 = max(self.peak_specific_force_m_s2, state.peak_specific_force_m_s2)

    def is_rejected(self, now_boot_us: int) -> bool:
        """Whether the hit is rejected, once the time to the decision is over: only its first sample shows it."""
        if self.hypothesis is None or now_boot_us - self.estimator.hit_boot_us < SHOWN_US:
            return False
        hypothesis, source, self.hypothesis = self.hypothesis, self.source, None
        return hypothesis.is_rejected(source.strapdown.fixes, source.history, source.config.position_noise_m)

    def follow_recovery(self, sample: LocalPosition) -> None:
        """Update overshoot and rebound speed while the vehicle recovers."""
        estimator, normal = self.estimator, self.normal.direction_ned
        shown: MotionState | LocalPosition = estimator.motion if estimator.has_converged else sample
        away = unit(minus(self.setpoint_ned_m, self.contact.position_ned_m))
        past_m = along(minus(shown.position_ned_m, self.setpoint_ned_m), normal if away == ZERO else away)
        self.overshoot_m = max(self.overshoot_m, past_m)
        # A velocity, which may be late, shows the rebound; later the vehicle's own controller makes it.
        if sample.time_boot_us - estimator.pushed_boot_us <= LATEST_S * 1e6:
            self.rebound_speed_m_s = max(self.rebound_speed_m_s or 0.0, along(shown.velocity_ned_m_s, normal))

    def take(self, sample: LocalPosition) -> Progress:
        """One position that the vehicle reports."""
        is_rejected = self.is_rejected(sample.time_boot_us)
        self._touch(sample)
        rested_s = rebound_m_s = None
        if self.law.follows and not self.has_rested:
            rested_s, rebound_m_s = self._follow(sample)
        self.settled_after_s = self._settled_after_s(sample)
        return Progress(is_rejected, rested_s, rebound_m_s)

    @property
    def is_pressed(self) -> bool:
        """Whether the vehicle has not left what it hit, by the belief: a report may be off by more than a metre."""
        off_m = self.surfaces[0].off_m(self.estimator.motion.position_ned_m)
        return not self._has_left and off_m < self.settled.distance_m

    @property
    def _is_known(self) -> bool:
        """Whether the motion after the hit is known, as far as the law asks for it."""
        return self.estimator.has_converged or not self.law.follows

    def _settled_after_s(self, sample: LocalPosition) -> float | None:
        """Time from the hit to the beginning of the present rest, s; None as long as that has not lasted."""
        motion, now_us = self.estimator.motion, sample.time_boot_us
        if self._is_known:
            self.follow_recovery(sample)
        distance_m, spread_m_s = math.dist(motion.position_ned_m, self.setpoint_ned_m), self.estimator.spread_m_s
        since_us = self._monitor.settled_since(now_us, distance_m, motion.velocity_ned_m_s, spread_m_s)
        is_held = not self.leans and now_us - self._held_since_us >= 1e6 * self.settled.duration_s
        if since_us is None or not is_held or not self._is_known:
            return None
        return max(0.0, 1e-6 * (since_us - self.estimator.hit_boot_us))

    def _follow(self, sample: LocalPosition) -> tuple[float | None, float | None]:
        """Set the goal again by contact and motion; hand over to it once the vehicle rests."""
        motion, rested_s = self.estimator.motion, None
        self.surfaces = self._around(self._contact)
        self.setpoint_ned_m = place = self._goal(motion)
        if self.leans and self._rests(sample):
            self.leans, self._held_since_us, self.overshoot_m = False, sample.time_boot_us, 0.0
            rested_s = 1e-6 * (sample.time_boot_us - self.estimator.hit_boot_us)
        elif not self._is_known:
            return None, None
        if math.dist(place, self._told_ned_m) <= self.settled.distance_m:
            return rested_s, None
        self._told_ned_m, self.overshoot_m = place, 0.0  # measured past the earlier setpoint
        return rested_s, along(motion.velocity_ned_m_s, self._contact.normal_ned)

    def _rests(self, sample: LocalPosition) -> bool:
        """Whether it rests as clear of all surfaces as its goal is, and the errors of the vehicle's own estimate are
        known.
        """
        estimator, motion = self.estimator, self.estimator.motion
        is_there = math.dist(motion.position_ned_m, self.setpoint_ned_m) <= reflex.PLACE_SPREAD_M
        # An error that PX4 corrects of a sudden makes it as fast: no more than it brakes within the clearance.
        most_m_s = brakable_m_s(self.config.clearance_m, reflex.LEAD_S)
        is_right = estimator.has_converged and math.hypot(*estimator.velocity_error_m_s) <= most_m_s
        is_slow = math.hypot(*motion.velocity_ned_m_s) <= reflex.RESTS_M_S
        self._slow.update(is_right and is_there and is_slow, sample.time_boot_us)
        return self._slow.lasts_us >= 1e6 * self.rests_s

    def _touch(self, sample: LocalPosition) -> None:
        """Update the surface. While it is touched it is where the vehicle is: frames and arms fold, obstacles move."""
        estimator, normal = self.estimator, self.normal
        is_touched = sample.time_boot_us - estimator.pushed_boot_us < 1e6 * reflex.SMOOTHED_S
        if (pushed := estimator.contact_m_s2) != ZERO:
            # A vehicle that slides round a pole touches it on another side.
            is_touched, normal = True, Normal(unit(pushed), reflex.IMPULSE_RAD)
        off_m_s = along(estimator.motion.velocity_ned_m_s, normal.direction_ned)
        self._has_left = (self._has_left or off_m_s > 0.0) and not is_touched
        here, place = estimator.motion.position_ned_m, self._contact.position_ned_m
        if is_touched:
            place, self._has_passed = here, False
        elif self.law.leans:
            place = self._behind(here)
        self._contact = replace(
            self._contact, position_ned_m=place, normal_ned=normal.direction_ned, normal_error_rad=normal.error_rad
        )

    def _behind(self, here_ned_m: Vector3) -> Vector3:
        """Where the surface counts for a vehicle that does not touch it: not where the vehicle has passed its end, nor
        far above one that has fallen, which comes to rest before it climbs back.
        """
        place, normal = self._contact.position_ned_m, self.normal.direction_ned
        off_m, clearance_m = along(minus(here_ned_m, place), normal), self.config.clearance_m
        self._has_passed = self._has_passed or off_m < -reflex.BEHIND_M
        if self._has_passed and off_m < clearance_m:
            place = plus(here_ned_m, -clearance_m, normal)
        n, e, d = place
        return (n, e, max(d, here_ned_m[2] - clearance_m)) if normal[2] == 0.0 else place

    def _goal(self, motion: MotionState) -> Vector3:
        """The law's goal, moved clear of surfaces and into the fence. Off what was hit eq. 3 is as far as it says; of a
        ceiling it says nothing.
        """
        goal, is_steep = self.law.goal_ned_m(self.config, self._contact, motion), self._contact.normal_ned[2] != 0.0
        surfaces = self.surfaces if self.law.leans or is_steep else self.surfaces[1:]
        goal = projected(goal, [(one.normal_ned, one.level_m) for one in surfaces])
        return self.room.inside(self._contact.position_ned_m, goal)

    def _around(self, contact: Contact) -> list[Surface]:
        """The surface just hit first, then those hit before in the same recovery, then the room's.

        Between facing surfaces the clearance is at most half of the room. One that the vehicle is behind is ignored.
        """
        found = [Surface(contact.position_ned_m, contact.normal_ned, self.config.clearance_m)]
        for other in [*self.earlier, *self.room.surfaces(contact)]:
            room_m, most_m = other.off_m(contact.position_ned_m), other.distance_m
            if room_m < -reflex.BEHIND_M:
                continue
            if along(contact.normal_ned, other.normal_ned) < reflex.OPPOSITE_COSINE:
                most_m = min(most_m, 0.5 * max(0.0, room_m))
                found[0] = replace(found[0], distance_m=min(found[0].distance_m, most_m))
            found.append(replace(other, distance_m=most_m))
        return found

    def report(self) -> CollisionReport:
        velocity = self.contact.velocity_ned_m_s
        return CollisionReport(
            detected_at_us=self.detected_at_us,
            sample_time_boot_us=self.estimator.hit_boot_us,
            detector=self.detector,
            position_ned_m=self.contact.position_ned_m,
            impact_velocity_ned_m_s=velocity,
            impact_speed_m_s=math.hypot(*velocity),
            normal_ned=self.normal.direction_ned,
            peak_specific_force_m_s2=self.peak_specific_force_m_s2,
            recovery_setpoint_ned_m=self.setpoint_ned_m,
            settled_after_s=self.settled_after_s,
            overshoot_m=self.overshoot_m,
            rebound_speed_m_s=self.rebound_speed_m_s,
        )


def recoveries_from(hits: Sequence[Collision]) -> int:
    """How many recoveries they began: what is touched again before the vehicle has settled is the same hit."""
    return sum(hit.is_over for hit in hits[:-1]) + bool(hits)
