"""The recovery of one collision: goal, law, touch and rest, from the companion's own belief.

Until the vehicle rests it is flown by attitude and thrust, then by a position.
"""

import math
from collections.abc import Sequence
from dataclasses import replace
from typing import NamedTuple, Protocol

from companion.messages import LocalPosition, Vector3
from companion.motion.config import SettledConfig
from companion.motion.settling import Lasting, SettlingMonitor
from companion.motion.vector import ZERO, along, minus, plus, unit
from companion.reflex import config as reflex
from companion.reflex.recovery.attitude_law import brakable_m_s
from companion.reflex.recovery.collision import CollisionRecord
from companion.reflex.recovery.laws import Contact, Law, MotionState
from companion.reflex.surface import Normal, Surface, projected


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
    settled_s: float | None  # the recovery is over


class Recovery:
    """Changed only by `take`. `earlier`: the surfaces hit before in the same recovery."""

    def __init__(
        self,
        record: CollisionRecord,
        law: Law,
        config: reflex.RecoveryConfig,
        settled: SettledConfig,
        room: Room,
        earlier: Sequence[Surface],
        keeps_trim: bool = False,
    ) -> None:
        self.record, self.law, self.leans = record, law, law.leans
        self._config, self._settled, self._room, self._earlier = config, settled, room, earlier
        # Where a tilt that still brakes would be kept, none is left by then.
        self.rests_s = settled.duration_s if keeps_trim else reflex.RESTS_S
        self._contact = record.contact  # as known now, at the vehicle's place while the obstacle goes along
        self.surfaces = self._around(self._contact)
        record.setpoint_ned_m = self._told_ned_m = self._goal(record.estimator.start)
        self._has_left = self._has_passed = False
        self._slow = Lasting()
        self._held_since_us = record.estimator.hit_boot_us  # by a position
        self._monitor = SettlingMonitor(settled)

    def take(self, sample: LocalPosition) -> Progress:
        """One position that the vehicle reports."""
        record = self.record
        is_rejected = record.is_rejected(sample.time_boot_us)
        self._touch(sample)
        rested_s = rebound_m_s = None
        if self.law.follows and (self.leans or not self.law.leans):
            rested_s, rebound_m_s = self._follow(sample)
        record.settled_after_s = self._settled_after_s(sample)
        return Progress(is_rejected, rested_s, rebound_m_s, record.settled_after_s)

    @property
    def is_pressed(self) -> bool:
        """Whether the vehicle has not left what it hit, by the belief: a report may be off by more than a metre."""
        off_m = self.surfaces[0].off_m(self.record.estimator.motion.position_ned_m)
        return not self._has_left and off_m < self._settled.distance_m

    @property
    def _is_known(self) -> bool:
        """Whether the motion after the hit is known, as far as the law asks for it."""
        return self.record.estimator.has_converged or not self.law.follows

    def _settled_after_s(self, sample: LocalPosition) -> float | None:
        """Time from the hit to the beginning of the present rest, s; None as long as that has not lasted."""
        record, motion, now_us = self.record, self.record.estimator.motion, sample.time_boot_us
        if self._is_known:
            record.follow_recovery(sample)
        distance_m, spread_m_s = math.dist(motion.position_ned_m, record.setpoint_ned_m), record.estimator.spread_m_s
        since_us = self._monitor.settled_since(now_us, distance_m, motion.velocity_ned_m_s, spread_m_s)
        is_held = not self.leans and now_us - self._held_since_us >= 1e6 * self._settled.duration_s
        if since_us is None or not is_held or not self._is_known:
            return None
        return max(0.0, 1e-6 * (since_us - record.estimator.hit_boot_us))

    def _follow(self, sample: LocalPosition) -> tuple[float | None, float | None]:
        """Set the goal again by contact and motion; hand over to it once the vehicle rests."""
        record, motion, rested_s = self.record, self.record.estimator.motion, None
        self.surfaces = self._around(self._contact)
        record.setpoint_ned_m = place = self._goal(motion)
        if self.leans and self._rests(sample):
            self.leans, self._held_since_us, record.overshoot_m = False, sample.time_boot_us, 0.0
            rested_s = 1e-6 * (sample.time_boot_us - record.estimator.hit_boot_us)
        elif not self._is_known:
            return None, None
        if math.dist(place, self._told_ned_m) <= self._settled.distance_m:
            return rested_s, None
        self._told_ned_m, record.overshoot_m = place, 0.0  # measured past the earlier setpoint
        return rested_s, along(motion.velocity_ned_m_s, self._contact.normal_ned)

    def _rests(self, sample: LocalPosition) -> bool:
        """Whether it rests as clear of all surfaces as its goal is, and the errors of the vehicle's own estimate are
        known.
        """
        estimator, motion = self.record.estimator, self.record.estimator.motion
        is_there = math.dist(motion.position_ned_m, self.record.setpoint_ned_m) <= reflex.PLACE_SPREAD_M
        # An error that PX4 corrects of a sudden makes it as fast: no more than it brakes within the clearance.
        most_m_s = brakable_m_s(self._config.clearance_m, reflex.LEAD_S)
        is_right = estimator.has_converged and math.hypot(*estimator.velocity_error_m_s) <= most_m_s
        is_slow = math.hypot(*motion.velocity_ned_m_s) <= reflex.RESTS_M_S
        self._slow.update(is_right and is_there and is_slow, sample.time_boot_us)
        return self._slow.lasts_us >= 1e6 * self.rests_s

    def _touch(self, sample: LocalPosition) -> None:
        """Update the surface. While it is touched it is where the vehicle is: frames and arms fold, obstacles move."""
        estimator, normal = self.record.estimator, self.record.normal
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
        place, normal = self._contact.position_ned_m, self.record.normal.direction_ned
        off_m, clearance_m = along(minus(here_ned_m, place), normal), self._config.clearance_m
        self._has_passed = self._has_passed or off_m < -reflex.BEHIND_M
        if self._has_passed and off_m < clearance_m:
            place = plus(here_ned_m, -clearance_m, normal)
        n, e, d = place
        return (n, e, max(d, here_ned_m[2] - clearance_m)) if normal[2] == 0.0 else place

    def _goal(self, motion: MotionState) -> Vector3:
        """The law's goal, moved clear of surfaces and into the fence. Off what was hit eq. 3 is as far as it says; of a
        ceiling it says nothing.
        """
        goal, is_steep = self.law.goal_ned_m(self._config, self._contact, motion), self._contact.normal_ned[2] != 0.0
        surfaces = self.surfaces if self.law.leans or is_steep else self.surfaces[1:]
        goal = projected(goal, [(one.normal_ned, one.level_m) for one in surfaces])
        return self._room.inside(self._contact.position_ned_m, goal)

    def _around(self, contact: Contact) -> list[Surface]:
        """The surface just hit first, then those hit before in the same recovery, then the room's.

        Between facing surfaces the clearance is at most half of the room. One that the vehicle is behind is ignored.
        """
        found = [Surface(contact.position_ned_m, contact.normal_ned, self._config.clearance_m)]
        for other in [*self._earlier, *self._room.surfaces(contact)]:
            room_m, most_m = other.off_m(contact.position_ned_m), other.distance_m
            if room_m < -reflex.BEHIND_M:
                continue
            if along(contact.normal_ned, other.normal_ned) < reflex.FACING_COSINE:
                most_m = min(most_m, 0.5 * max(0.0, room_m))
                found[0] = replace(found[0], distance_m=min(found[0].distance_m, most_m))
            found.append(replace(other, distance_m=most_m))
        return found
