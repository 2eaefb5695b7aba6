"""State recovering: the flight from the hit to rest clear of the obstacle.

Until it rests the vehicle is flown by attitude and thrust from the companion's belief, then by a position.
"""

import math
from collections.abc import Sequence
from dataclasses import replace

from companion.flight.after_hit import afterwards, take_back
from companion.flight.collision import CollisionRecord, in_one_recovery, level
from companion.flight.context import FlightContext, Inputs, Target, Transition, as_text
from companion.flight.obstacle_map import remembered_surfaces
from companion.messages import LocalPosition, Vector3
from companion.motion.rotation import body_to_ned, yaw_rad
from companion.motion.settling import SettlingMonitor
from companion.motion.vector import ZERO, along, plus, split
from companion.reflex import config as reflex
from companion.reflex.attitude_law import Lean, wanted
from companion.reflex.confirmation import hypothesis_of
from companion.reflex.halfspace import Surface, inside_fence, projected
from companion.reflex.impact import ImpactEstimate
from companion.reflex.laws import RECOVERY_LAWS, Contact, Law, MotionState
from companion.reflex.motion_estimator import MotionEstimator
from companion.report import CollisionReport


class Recover:
    """Fly to rest at the recovery setpoint of the newest collision, and wait until the vehicle has settled."""

    def __init__(self, flight: FlightContext, now_us: int) -> None:
        self._flight, self._record = flight, flight.collisions[-1]
        self._law = _law(flight)
        self._contact = self._record.contact  # as known now, at the vehicle's place while the obstacle goes along
        *_, first = in_one_recovery(flight.collisions)
        self._first_hit_us = first.detected_at_us
        if flight.target is not None and first is self._record:
            flight.yaw_rad = flight.target.yaw_rad
        self._surfaces = _surfaces(flight, self._contact)
        self._has_left = False
        self._leans = self._law.leans
        self._told_ned_m = self._record.setpoint_ned_m
        self._slow_since_us: int | None = None
        self._monitor = SettlingMonitor(flight.mission.companion.settled)

    def target(self, now_us: int) -> Target | None:
        """Attitude and thrust until it rests; then its place."""
        flight, record = self._flight, self._record
        if not self._leans:
            return Target(record.setpoint_ned_m, self._yaw_rad)
        assert flight.loss_s is not None, "only a known one lets it lean"
        belief = record.estimator.belief
        lean = Lean(
            belief, self._surfaces, flight.thrust.full_m_s2, self._yaw_rad or 0.0, flight.loss_s + reflex.NOTICED_S
        )
        acceleration = wanted(belief, self._surfaces, record.setpoint_ned_m[2])
        return Target(record.setpoint_ned_m, self._yaw_rad, None, acceleration, lean)

    @property
    def _is_known(self) -> bool:
        """Whether the motion after the hit is known, as far as the law asks for it."""
        return self._record.estimator.has_converged or not self._law.follows

    @property
    def _yaw_rad(self) -> float | None:
        """The heading to ask for on the way back to the wanted one: it leads the vehicle's own by YAW_LEAD_RAD at most.

        Motors that turn a vehicle as fast as they can have no thrust left to climb with.
        """
        attitude, wanted_rad = self._flight.vehicle.attitude, self._flight.yaw_rad
        if attitude is None:
            return wanted_rad
        heading_rad = yaw_rad(attitude.attitude_wxyz)
        if wanted_rad is None:
            return heading_rad if self._leans else None
        short_rad = math.remainder(wanted_rad - heading_rad, math.tau)
        is_near = abs(short_rad) <= reflex.YAW_LEAD_RAD
        return wanted_rad if is_near else heading_rad + math.copysign(reflex.YAW_LEAD_RAD, short_rad)

    def step(self, flight: FlightContext, inputs: Inputs, now_us: int) -> Transition | None:
        record, companion = self._record, flight.mission.companion
        for sample in inputs.positions:
            noise_m = companion.estimate.position_noise_m
            if record.is_rejected(sample.time_boot_us, flight.vehicle.history, noise_m):
                transition = take_back(flight, now_us)
                if transition is not None:
                    return transition
            record.estimator.update(sample)
            self._learn(sample)
            if self._law.follows and (self._leans or not self._law.leans):
                self._follow(sample, now_us)
            settled_s = self._settled_after_s(sample) if self._is_known else None
            if settled_s is not None and not self._leans:
                past_m, speed_m_s, record.settled_after_s = record.overshoot_m, record.rebound_speed_m_s, settled_s
                text = f"recovered: settled {settled_s:.2f} s after the hit, overshoot {past_m * 100:.1f} cm"
                text += "" if speed_m_s is None else f", rebound {speed_m_s:.2f} m/s"
                flight.report(now_us, "recovered", text, settled_after_s=settled_s, overshoot_m=past_m)
                return self._leave(flight)
        timeout_s = companion.settled.timeout_s
        if now_us - self._first_hit_us > timeout_s * 1e6:
            text = f"not settled within {timeout_s:g} s of the hit; the mission goes on"
            flight.report(now_us, "recovered", text, settled_after_s=None)
            return self._leave(flight)
        return None

    def _leave(self, flight: FlightContext) -> Transition:
        """What follows begins at rest at the setpoint."""
        self._record.is_over = True
        flight.target = Target(self._record.setpoint_ned_m, flight.yaw_rad)
        return afterwards(flight)

    def _settled_after_s(self, sample: LocalPosition) -> float | None:
        """Time from the hit to the beginning of the present rest, s; None as long as that has not lasted."""
        record, right = self._record, self._record.estimator.corrected(sample)
        record.follow_recovery(right)
        distance_m = math.dist(right.position_ned_m, record.setpoint_ned_m)
        since_us = self._monitor.settled_since(sample.time_boot_us, distance_m, right.velocity_ned_m_s)
        return None if since_us is None else max(0.0, 1e-6 * (since_us - record.sample_time_boot_us))

    def _learn(self, sample: LocalPosition) -> None:
        """Take the velocity after the hit once the vehicle's estimate shows it. Until then the estimated one counts."""
        record, estimator = self._record, self._record.estimator
        is_shown = record.after_ned_m_s is None or record.is_rebound(sample.time_boot_us)
        # Of a hit that follows another the velocity before it is an estimate, and turns a good normal round.
        if estimator.has_converged and is_shown and not estimator.is_second:
            record.after_ned_m_s = estimator.corrected(sample).velocity_ned_m_s

    def _state(self) -> MotionState:
        """The present motion. During the contact it has no velocity into the obstacle."""
        motion, normal = self._record.estimator.motion, self._contact.normal_ned
        velocity = motion.velocity_ned_m_s
        if not self._has_left:
            off_m_s, sideways = split(velocity, normal)
            velocity = plus(sideways, max(0.0, off_m_s), normal)
        return MotionState(motion.position_ned_m, velocity)

    def _follow(self, sample: LocalPosition, now_us: int) -> None:
        """Set the recovery setpoint again by contact and motion; hand over to it once the vehicle rests."""
        self._touch(sample)
        flight, record, state = self._flight, self._record, self._state()
        self._surfaces = _surfaces(flight, self._contact)
        record.setpoint_ned_m = place = _setpoint(flight, self._contact, state, self._surfaces, self._law)
        if self._leans and self._rests(sample):
            self._leans, record.overshoot_m = False, 0.0
            since_s = 1e-6 * (sample.time_boot_us - record.sample_time_boot_us)
            text = f"at rest {since_s:.2f} s after the hit; from here on by position"
            flight.report(now_us, "hand_over", text, after_s=since_s, recovery_setpoint_ned_m=place)
        elif not self._is_known:
            return
        if math.dist(place, self._told_ned_m) > flight.mission.companion.settled.distance_m:
            self._told_ned_m, record.overshoot_m = place, 0.0  # measured past the earlier setpoint
            off_m_s = along(state.velocity_ned_m_s, self._contact.normal_ned)
            text = f"off the obstacle at {off_m_s:.2f} m/s; recovery setpoint {as_text(flight.mission_ned_m(place))}"
            flight.report(now_us, "rebound", text, speed_m_s=off_m_s, recovery_setpoint_ned_m=place)

    def _rests(self, sample: LocalPosition) -> bool:
        """Whether it rests, clear of all surfaces, and the errors of the vehicle's own estimate are known."""
        estimator, motion = self._record.estimator, self._record.estimator.motion
        is_clear = all(
            one.off_m(motion.position_ned_m) >= reflex.CLEAR_SHARE * one.distance_m for one in self._surfaces
        )
        if not estimator.has_converged or not is_clear or math.hypot(*motion.velocity_ned_m_s) > reflex.RESTS_M_S:
            self._slow_since_us = None
            return False
        self._slow_since_us = self._slow_since_us or sample.time_boot_us
        return sample.time_boot_us - self._slow_since_us >= 1e6 * reflex.RESTS_S

    def _touch(self, sample: LocalPosition) -> None:
        """Update the surface. While it is touched it is where the vehicle is: frames and arms fold, obstacles move."""
        estimator, contact = self._record.estimator, self._contact
        is_touched = sample.time_boot_us - estimator.pushed_boot_us < 1e6 * reflex.SMOOTHED_S
        is_touched = is_touched or along(estimator.external_m_s2, contact.normal_ned) > reflex.HELD_M_S2
        if self._record.after_ned_m_s is not None:
            known = self._record.normal
            contact = replace(contact, normal_ned=known.direction_ned, normal_error_rad=known.error_rad)
        off_m_s = along(estimator.motion.velocity_ned_m_s, contact.normal_ned)
        self._has_left = (self._has_left or off_m_s > 0.0) and not is_touched
        place = estimator.motion.position_ned_m if is_touched else contact.position_ned_m
        self._contact = replace(contact, position_ned_m=place)


def record_collision(flight: FlightContext, estimate: ImpactEstimate, now_us: int) -> None:
    """Record and report a new collision: the motion just before it, and the recovery setpoint from that."""
    mission, impact, normal = flight.mission, estimate.impact, level(estimate.normal)
    place, velocity, attitude = estimate.position_ned_m, estimate.velocity_ned_m_s, flight.vehicle.attitude
    before = next(iter(in_one_recovery(flight.collisions)), None)
    is_second = (
        _law(flight).follows
        and before is not None
        and not (before.estimator.has_converged or before.estimator.is_fully_measured)
    )
    if before is not None and is_second:
        # The vehicle's estimate is still wrong from the hit before.
        place, velocity = before.estimator.motion.position_ned_m, before.estimator.motion.velocity_ned_m_s
    contact = Contact(estimate.time_boot_us, place, velocity, normal.direction_ned, normal.error_rad)
    expected, first_us = contact.rebound(mission.recovery.restitution), impact.sample_time_boot_us
    record = CollisionRecord(
        detected_at_us=now_us,
        sample_time_boot_us=first_us,
        detector=mission.companion.detector,
        contact=contact,
        setpoint_ned_m=_setpoint(flight, contact, expected, _surfaces(flight, contact), _law(flight)),
        contact_normal=normal,
        peak_specific_force_m_s2=math.hypot(*impact.specific_force_frd_m_s2),
        estimator=MotionEstimator(contact, first_us, expected, mission.companion.estimate, is_second),
    )
    if before is None and attitude is not None:
        force_ned = body_to_ned(attitude.attitude_wxyz, impact.specific_force_frd_m_s2)
        record.hypothesis = hypothesis_of(estimate, force_ned, mission.companion.estimate.imu_averaging_interval_s)
    record.estimator.note_contact(estimate.is_fully_measured, first_us)
    reason = why_no_lean(flight)
    if RECOVERY_LAWS[mission.recovery.law].leans and reason is not None and not flight.told_by_position:
        flight.told_by_position = True
        flight.report(now_us, "by_position", f"recovery by position, as law paper has it: {reason}", reason=reason)
    flight.collisions.append(record)
    _report_detection(flight, record.report())


def _report_detection(flight: FlightContext, hit: CollisionReport) -> None:
    force_m_s2, v_c, speed_m_s = hit.peak_specific_force_m_s2, hit.impact_velocity_ned_m_s, hit.impact_speed_m_s
    place, setpoint = (
        as_text(flight.mission_ned_m(each)) for each in (hit.position_ned_m, hit.recovery_setpoint_ned_m)
    )
    flight.report(
        hit.detected_at_us,
        "detection",
        f"hit {len(flight.collisions)}: {force_m_s2:.1f} m/s^2, v_c {as_text(v_c)} ({speed_m_s:.2f} m/s) at {place}; "
        f"recovery setpoint {setpoint}",
        detector=hit.detector,
        sample_time_boot_us=hit.sample_time_boot_us,
        impact_velocity_ned_m_s=v_c,
        impact_speed_m_s=speed_m_s,
        normal_ned=hit.normal_ned,
        specific_force_m_s2=force_m_s2,
        position_ned_m=hit.position_ned_m,
        recovery_setpoint_ned_m=hit.recovery_setpoint_ned_m,
    )


def as_the_vehicle_has_it(flight: FlightContext, target: Target, time_boot_us: int) -> Target:
    """A position with the errors that a hit has left in the vehicle's estimate and tilt, and with what its integrators
    have forgotten while it was flown by attitude. It fades out, as PX4 puts all of it right by itself.
    """
    record = flight.collisions[-1] if flight.collisions else None
    if record is None or target.lean is not None or not (_law(flight).leans and record.estimator.has_converged):
        return target
    left_us = record.sample_time_boot_us + reflex.FADED_US - time_boot_us
    if left_us <= 0:
        return target
    estimator, share = record.estimator, min(1.0, left_us / (reflex.FADED_US - reflex.FADES_FROM_US))
    pushed = plus(estimator.external_m_s2, 1.0, estimator.level_m_s2)
    return replace(
        target,
        position_ned_m=plus(target.position_ned_m, share, estimator.position_error_m),
        velocity_ned_m_s=plus(target.velocity_ned_m_s or ZERO, share, estimator.velocity_error_m_s),
        acceleration_ned_m_s2=plus(target.acceleration_ned_m_s2 or ZERO, -share, pushed),
    )


def why_no_lean(flight: FlightContext) -> str | None:
    """Why the vehicle cannot be flown by attitude, for people; None where it can."""
    if flight.loss_s is None or flight.loss_s > reflex.MOST_HELD_S:
        told = "is not known" if flight.loss_s is None else f"is {flight.loss_s:g} s"
        return f"COM_OF_LOSS_T {told}; an attitude is safe to hold for {reflex.MOST_HELD_S:g} s"
    if flight.thrust.known_s < reflex.THRUST_LEARNT_S:
        return "the thrust is not known yet"
    return "no attitude is heard" if flight.vehicle.attitude is None else None


def _law(flight: FlightContext) -> Law:
    law = RECOVERY_LAWS[flight.mission.recovery.law]
    return RECOVERY_LAWS["paper"] if law.leans and why_no_lean(flight) is not None else law


def _setpoint(
    flight: FlightContext, contact: Contact, motion: MotionState, surfaces: Sequence[Surface], law: Law
) -> Vector3:
    """The law's goal, moved clear of surfaces and into the fence."""
    assert flight.origin_ned_m is not None, "hits are detected only in flight"
    goal = law.goal_ned_m(flight.mission.recovery, contact, motion)
    goal = projected(goal, [(one.normal_ned, one.level_m) for one in surfaces[1:]])
    return inside_fence(flight.mission.fence, flight.origin_ned_m, contact.position_ned_m, goal)


def _surfaces(flight: FlightContext, contact: Contact) -> list[Surface]:
    """The surface just hit first, then those hit before in the same recovery, then the obstacle map's.

    Between facing surfaces the clearance is at most half of the room. One that the vehicle is behind is ignored.
    """
    hit = Surface(contact.position_ned_m, contact.normal_ned, flight.mission.recovery.clearance_m)
    others = [
        Surface(record.contact.position_ned_m, record.normal.direction_ned, hit.distance_m)
        for record in in_one_recovery(flight.collisions)
        if record.contact.time_boot_us < contact.time_boot_us
    ]
    found = [hit]
    for other in others + remembered_surfaces(flight, contact):
        room_m, most_m = other.off_m(contact.position_ned_m), other.distance_m
        if room_m < -reflex.BEHIND_M:
            continue
        if along(contact.normal_ned, other.normal_ned) < reflex.FACING_COSINE:
            most_m = min(most_m, 0.5 * max(0.0, room_m))
            found[0] = replace(found[0], distance_m=min(found[0].distance_m, most_m))
        found.append(replace(other, distance_m=most_m))
    return found
