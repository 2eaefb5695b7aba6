"""State recovering: from the hit to rest at the recovery setpoint."""

import math
from collections.abc import Sequence
from dataclasses import replace

from companion.estimate.impact import ImpactEstimate
from companion.estimate.rotation import body_to_ned
from companion.estimate.settling import SettlingMonitor
from companion.flight.after_hit import afterwards, take_back
from companion.flight.carried import CARRIED_EVERY_US, CLEAR_M_S, is_carried, overtaken
from companion.flight.collision import CollisionRecord, in_one_recovery
from companion.flight.confirming import Claim, Leap, claim_of
from companion.flight.context import FlightContext, Inputs, Move, Target, as_text
from companion.flight.doubt import half_way, is_believed
from companion.flight.pinned import Hanging, has_room_below, let_go
from companion.flight.rebound import agreed_normal, climb_of, lean_left, way_back
from companion.flight.remembering import remembered_surfaces
from companion.flight.spinning import Steering, coming_to_rest, is_spinning
from companion.flight.telling import tell_detection
from companion.messages import LocalPosition, Vector3
from companion.recovery.direction import away_from, plus, split
from companion.recovery.envelope import Envelope
from companion.recovery.height import BRAKED_US, NO_BRAKING, as_it_moves, brake, level
from companion.recovery.interface import Contact, Moving, RecoveryLaw
from companion.recovery.registry import RECOVERY_LAWS
from companion.recovery.room import Room, Surface
from companion.recovery.way import REST, Way, damped

# The motion after the contact is read this long after the hit's first sample. Head-on, spring arms push for 15 ms at
# 5 m/s, 50 ms at 3 m/s and 0.12 s at 1 m/s, most of it at the beginning, and the vehicle's estimate is some 20 ms late.
# Waiting for 120 ms made no better recoveries.
REBOUND_KNOWN_US = 80_000
# Where it is believed later than this, the vehicle has fallen meanwhile: of the hit only the level part is left.
REBOUND_LATEST_US = 200_000
# A vehicle's estimate is up to 0.02 s late (see estimate.approach).
HEIGHT_KNOWN_US = 15_000


class Recover:
    """Glide to the newest collision's setpoint, which is final once the rebound is known, and wait for rest there."""

    def __init__(self, flight: FlightContext, now_us: int) -> None:
        self._record = flight.collisions[-1]
        self._first_hit_us = in_one_recovery(flight.collisions)[-1].detected_at_us
        self._law = _law(flight)
        self._started_us = now_us
        self._contact = self._record.contact
        if flight.target is not None:
            flight.yaw_rad = flight.target.yaw_rad
        self._yaw_rad = flight.yaw_rad
        self._is_refined = not self._law.is_refined
        self._refined_boot_us = self._record.sample_time_boot_us
        self._braking = NO_BRAKING
        self._is_believed = not self._law.is_refined
        self._spins = False
        self._steering: Steering | None = None  # while it spins
        self._hanging, self._may_fall = Hanging(), True
        self._take(flight, self._law.expected(self._contact), now_us)

    def _take(self, flight: FlightContext, motion: Moving, now_us: int) -> None:
        """The way from this motion to the record's setpoint."""
        goal = self._record.setpoint_ned_m
        self._way: Way = self._law.way(motion, goal)
        self._way_began_us = now_us
        self._monitor = SettlingMonitor(goal, flight.mission.companion.settled)

    def target(self, now_us: int) -> Target | None:
        if self._hanging.since_us is not None:
            falls, reckons = self._may_fall and self._hanging.is_leant, not self._is_believed
            return let_go(self._record, self._contact.normal_ned, self._yaw_rad, falls, reckons)
        if self._steering is not None:
            a, b = self._steering.acceleration_m_s2
            leant = (a, b, self._braking.at(now_us))
            return Target(self._record.setpoint_ned_m, self._yaw_rad, REST, leant, leans_only=True)
        motion = self._way.at((now_us - self._way_began_us) * 1e-6)
        if not self._is_believed:
            climb = self._record.climb
            braking = climb.braking_m_s2() if climb.is_reckoned else 0.0
            is_new = now_us - self._started_us < BRAKED_US
            motion = level(motion, self._record.setpoint_ned_m[2], braking)
            a, b, _ = motion.acceleration_ned_m_s2 or REST
            besides = REST if self._spins else self._record.level_leans_m_s2
            expected = Moving(motion.position_ned_m, motion.velocity_ned_m_s or REST, besides)
            leant = (0.0, 0.0, braking) if self._spins else (a, b, braking)
            is_free = is_new or climb.is_reckoned
            velocity = as_it_moves(self._record.estimated_down_m_s) if is_free else REST
            return Target(motion.position_ned_m, self._yaw_rad, velocity, leant, True, is_free, expected)
        if self._law.holds_height and self._contact.normal_ned[2] == 0.0:
            motion = level(motion, self._record.setpoint_ned_m[2], self._braking.at(now_us))
        return Target(motion.position_ned_m, self._yaw_rad, motion.velocity_ned_m_s, damped(motion))

    def step(self, flight: FlightContext, inputs: Inputs, now_us: int) -> Move | None:
        record = self._record
        self._hang(flight, now_us)
        for sample in inputs.positions:
            noise_m = flight.mission.companion.estimate.position_noise_m
            if record.is_contradicted(sample.time_boot_us, flight.vehicle.history, noise_m):
                move = take_back(flight, now_us)
                if move is not None:
                    return move
            if not self._believes(flight, sample):
                continue
            record.follow_recovery(sample)
            self._hold_height(flight, sample, now_us)
            self._refine(flight, sample, now_us)
            since_us = self._monitor.settled_since(sample)
            if since_us is not None and self._steering is None:
                record.settled_at_boot_us, record.is_over = since_us, True
                figures = {"settled_after_s": record.settled_after_s(), "overshoot_m": record.overshoot_m}
                flight.tell(now_us, "recovered", record.recovered_text(), **figures)
                return self._leave(flight)
        timeout_s = flight.mission.companion.settled.timeout_s
        if now_us - self._first_hit_us > timeout_s * 1e6:
            record.is_over = True
            text = f"not settled within {timeout_s:g} s of the hit; the mission goes on"
            flight.tell(now_us, "recovered", text, settled_after_s=None)
            return self._leave(flight)
        return None

    def _hang(self, flight: FlightContext, now_us: int) -> None:
        """While the vehicle hangs on what it hit, it has not left it: the way off it begins after that."""
        attitude, normal = flight.vehicle.attitude, self._contact.normal_ned
        if attitude is None or not self._law.is_refined or normal[2] != 0.0:
            return
        self._may_fall = has_room_below(flight)
        was_us, since_us = self._hanging.since_us, now_us - self._record.detected_at_us
        if not self._hanging.step(attitude, normal, since_us, now_us) and was_us is not None:
            self._way_began_us += now_us - max(was_us, self._way_began_us)

    def _leave(self, flight: FlightContext) -> Move:
        """What follows begins at rest at the setpoint."""
        flight.target = Target(self._record.setpoint_ned_m, self._yaw_rad)
        return afterwards(flight)

    def _believes(self, flight: FlightContext, sample: LocalPosition) -> bool:
        """Whether the estimate is the vehicle's again; until then the motion expected is flown by its lean alone."""
        record = self._record
        if not self._law.is_refined or record.is_believed:
            return True
        if record.may_be_clipped:
            self._spins = is_spinning(flight)
            since_us = sample.time_boot_us - record.sample_time_boot_us
            normals = (self._contact.normal_ned, record.normal_ned)
            record.is_believed = since_us >= HEIGHT_KNOWN_US and is_believed(
                sample, self._contact.velocity_ned_m_s, normals, record.fixes, since_us
            )
        self._is_believed = record.is_believed or not record.may_be_clipped
        return self._is_believed

    def _refine(self, flight: FlightContext, sample: LocalPosition, now_us: int) -> None:
        """With the motion after the contact, and again where that has gone on since or while it is carried."""
        record, contact = self._record, self._contact
        since_us = sample.time_boot_us - record.sample_time_boot_us
        if not self._law.is_refined or since_us < REBOUND_KNOWN_US:
            return
        if self._steers(flight, sample):
            self._is_refined = False
            return
        carried = self._is_refined and self._is_carried(flight, sample, now_us)
        if self._is_refined and not carried and record.contact_ended_boot_us <= self._refined_boot_us:
            return
        u, v, w = sample.velocity_ned_m_s
        after = (u, v, w if since_us <= REBOUND_LATEST_US else contact.velocity_ned_m_s[2])
        normal = agreed_normal(record.normal_ned, contact.velocity_ned_m_s, after)
        place = sample.position_ned_m if carried else contact.position_ned_m
        self._contact = contact = replace(contact, position_ned_m=place, normal_ned=normal)
        self._is_refined, self._refined_boot_us = True, sample.time_boot_us
        lean = lean_left(record.fixes, sample.time_boot_us)
        # From what pushes it along a vehicle comes clear only if it flies faster.
        velocity = plus(sample.velocity_ned_m_s, CLEAR_M_S if carried else 0.0, normal)
        motion = Moving(sample.position_ned_m, velocity, lean)
        record.setpoint_ned_m = _setpoint(flight, self._law, contact, motion, flight.collisions[:-1])
        record.overshoot_m = 0.0  # that past the setpoint expected is none
        self._take(flight, motion, now_us)
        off_m_s, place = split(motion.velocity_ned_m_s, normal)[0], record.setpoint_ned_m
        text = f"off the obstacle at {off_m_s:.2f} m/s; recovery setpoint {as_text(flight.mission_ned_m(place))}"
        flight.tell(now_us, "rebound", text, speed_m_s=off_m_s, recovery_setpoint_ned_m=place)

    def _is_carried(self, flight: FlightContext, sample: LocalPosition, now_us: int) -> bool:
        if sample.time_boot_us - self._refined_boot_us < CARRIED_EVERY_US:
            return False
        asked = self._way.at((now_us - self._way_began_us) * 1e-6)
        return is_carried(flight, self._record, self._contact.normal_ned, sample, asked)

    def _hold_height(self, flight: FlightContext, sample: LocalPosition, now_us: int) -> None:
        """From the first estimate on that can show what the hit did; the accelerometer, which it clips, cannot."""
        since_us = sample.time_boot_us - self._record.sample_time_boot_us
        if HEIGHT_KNOWN_US <= since_us <= BRAKED_US:
            most_m_s2 = flight.mission.recovery.vertical_acceleration_m_s2
            self._braking = brake(sample.velocity_ned_m_s[2], most_m_s2, now_us)

    def _steers(self, flight: FlightContext, sample: LocalPosition) -> bool:
        """Gently to rest while the vehicle spins."""
        attitude, record = flight.vehicle.attitude, self._record
        if attitude is None or not is_spinning(flight):
            self._steering = None
            return False
        if self._steering is None:
            rest = coming_to_rest(sample.position_ned_m, sample.velocity_ned_m_s, self._contact.position_ned_m[2])
            record.setpoint_ned_m = _allowed(flight, self._law, self._contact, rest, flight.collisions[:-1])
            self._steering = Steering(record.setpoint_ned_m)
        self._steering.step(sample, attitude)
        return True


def record_collision(flight: FlightContext, estimate: ImpactEstimate, now_us: int) -> None:
    """A new collision: what was known just before it, and from that the setpoint."""
    mission, impact = flight.mission, estimate.impact
    behind = overtaken(flight, impact.specific_force_frd_m_s2, estimate.velocity_ned_m_s)
    normal = behind or away_from(estimate.normal_ned)
    law = _law(flight)
    contact = Contact(estimate.time_boot_us, estimate.position_ned_m, estimate.velocity_ned_m_s, normal)
    if law.is_refined and behind is None:
        contact = replace(contact, normal_ned=half_way(normal, way_back(contact.velocity_ned_m_s)))
    hit_boot_us = impact.sample_time_boot_us
    record = CollisionRecord(
        detected_at_us=now_us,
        sample_time_boot_us=hit_boot_us,
        detector=mission.companion.detector,
        contact=contact,
        setpoint_ned_m=_setpoint(flight, law, contact, law.expected(contact), flight.collisions),
        normal_ned=normal,
        peak_specific_force_m_s2=math.hypot(*impact.specific_force_frd_m_s2),
        contact_ended_boot_us=hit_boot_us,
        may_be_clipped=not estimate.is_final or estimate.may_be_clipped,
        climb=climb_of(flight, law, contact, hit_boot_us, estimate.time_boot_us - estimate.time_error_us),
        is_behind=behind is not None,
        claim=_claim(flight, estimate),
    )
    flight.collisions.append(record)
    tell_detection(flight, record, now_us)


def _claim(flight: FlightContext, estimate: ImpactEstimate) -> Claim | Leap | None:
    """What the first sample says alone; None where that is not known, or the vehicle recovers from another hit."""
    attitude = flight.vehicle.attitude
    if attitude is None or (flight.collisions and not flight.collisions[-1].is_over):
        return None
    force_ned = body_to_ned(attitude.attitude_wxyz, estimate.impact.specific_force_frd_m_s2)
    config = flight.mission.companion.estimate
    return claim_of(estimate, force_ned, config.imu_averaging_interval_s, config.guards)


def _law(flight: FlightContext) -> RecoveryLaw:
    return RECOVERY_LAWS[flight.mission.recovery.law](flight.mission.recovery)


def _setpoint(
    flight: FlightContext, law: RecoveryLaw, contact: Contact, motion: Moving, earlier: Sequence[CollisionRecord]
) -> Vector3:
    return _allowed(flight, law, contact, law.goal_ned_m(contact, motion), earlier)


def _allowed(
    flight: FlightContext, law: RecoveryLaw, contact: Contact, goal: Vector3, earlier: Sequence[CollisionRecord]
) -> Vector3:
    """The goal, as what is around lets it be."""
    assert flight.origin_ned_m is not None, "hits are detected only in flight"
    surfaces = [*_surfaces(law, earlier), *remembered_surfaces(flight, contact)]
    room = Room(Envelope(flight.origin_ned_m, flight.mission.fence), surfaces)
    return room.goal(contact.position_ned_m, contact.normal_ned, goal)


def _surfaces(law: RecoveryLaw, earlier: Sequence[CollisionRecord]) -> list[Surface]:
    """What was hit before in the same recovery, each with the distance that its own recovery wants."""
    surfaces: list[Surface] = []
    for record in in_one_recovery(earlier):
        contact = replace(record.contact, normal_ned=record.normal_ned)
        touched = Surface(contact.position_ned_m, contact.normal_ned, 0.0)
        wanted = law.goal_ned_m(contact, law.expected(contact))
        distance_m = max(0.0, touched.off_m(wanted), touched.off_m(record.setpoint_ned_m))
        surfaces.append(replace(touched, distance_m=distance_m))
    return surfaces
