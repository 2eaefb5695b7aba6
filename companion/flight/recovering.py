"""State recovering: the flight from the hit to rest clear of the obstacle, on a plan from the present motion."""

import math
from collections.abc import Sequence
from dataclasses import replace

from companion.flight.after_hit import afterwards, take_back
from companion.flight.collision import CollisionRecord, in_one_recovery, level
from companion.flight.context import FlightContext, Inputs, Target, Transition, as_text
from companion.flight.obstacle_map import remembered_surfaces
from companion.messages import LocalPosition, Vector3
from companion.motion.config import SAME_M_S
from companion.motion.rotation import body_to_ned, yaw_rad
from companion.motion.settling import SettlingMonitor
from companion.reflex import config as reflex
from companion.reflex.confirmation import hypothesis_of
from companion.reflex.halfspace import Surface, clear_goal, inside_fence, limited, plus, split
from companion.reflex.impact import ImpactEstimate
from companion.reflex.laws import RECOVERY_LAWS, Contact, Law
from companion.reflex.motion_estimator import MotionEstimator
from companion.reflex.planner import (
    REST,
    MotionState,
    Plan,
    height_feedback,
    holds,
    kept_off,
    safe_to_hold,
    shortest,
    with_feedback,
)
from companion.report import CollisionReport


class Recover:
    """Fly to rest at the recovery setpoint of the newest collision, and wait until the vehicle has settled."""

    def __init__(self, flight: FlightContext, now_us: int) -> None:
        self._flight, self._record = flight, flight.collisions[-1]
        self._law, self._config = _law(flight), flight.mission.recovery
        self._contact = self._record.contact  # as known now, at the vehicle's place while the obstacle goes along
        *_, first = in_one_recovery(flight.collisions)
        self._first_hit_us = first.detected_at_us
        if flight.target is not None and first is self._record:
            flight.yaw_rad = flight.target.yaw_rad
        self._surfaces = _surfaces(flight, self._contact)
        self._has_left = False
        self._has_hung = False  # was pressed on the obstacle, and has not left it since
        self._planned_for: object = None  # the state of the contact that the plan was made for
        self._plan, self._plan_began_us = self._plan_from(self._state()), now_us
        self._monitor = SettlingMonitor(flight.mission.companion.settled)

    def target(self, now_us: int) -> Target | None:
        if not self._law.follows:
            return Target(self._record.setpoint_ned_m, self._yaw_rad)
        is_steady = self._is_known and not (self._lets_go or self._tilts_into_surface())
        planned = self._plan.at(1e-6 * (now_us - self._plan_began_us))
        return self._by_plan(planned) if is_steady else self._by_acceleration(planned)

    def _by_plan(self, planned: MotionState) -> Target:
        """A setpoint of position, velocity and acceleration: PX4's own loops follow the plan."""
        record, estimator = self._record, self._record.estimator
        a, b, c = self._kept_off(planned.acceleration_ned_m_s2)
        if self._is_level:
            (n, e, _), (u, v, _) = planned.position_ned_m, planned.velocity_ned_m_s
            planned, c = MotionState((n, e, record.setpoint_ned_m[2]), (u, v, 0.0)), self._height_m_s2(1.0)
        # The estimate's known errors of position, velocity and tilt are added, because PX4 controls its own estimate.
        place = plus(planned.position_ned_m, 1.0, estimator.position_error_m)
        velocity = plus(planned.velocity_ned_m_s, 1.0, estimator.velocity_error_m_s)
        asked = (reflex.ACCELERATION_GAIN * a, reflex.ACCELERATION_GAIN * b, c)
        return Target(place, self._yaw_rad, velocity, plus(asked, -1.0, record.level_acceleration_m_s2))

    def _by_acceleration(self, planned: MotionState) -> Target:
        """A setpoint of acceleration alone: PX4's estimate is wrong, or its loops would harm this motion."""
        goal, record, state = self._record.setpoint_ned_m, self._record, self._state()
        a, b, c = safe_to_hold(with_feedback(planned, state), self._tilted_motion.velocity_ned_m_s)
        is_free = self._lets_go or (self._is_level and not self._is_known)
        # Where the height is free, PX4's own loop adds nothing.
        a, b, c = self._kept_off((a, b, self._height_m_s2(2.0 if is_free else 1.0) if self._is_level else c))
        if self._lets_go:
            c = reflex.DESCENT_M_S2 if self._tilts_into_surface() else max(c, 0.0)
        # The velocity of the vehicle's own estimate: PX4's vertical loop then adds nothing to the acceleration.
        velocity = (0.0, 0.0, record.estimated_down_m_s) if is_free else REST
        expected = MotionState(state.position_ned_m, state.velocity_ned_m_s, record.level_acceleration_m_s2)
        return Target(goal, self._yaw_rad, velocity, (a, b, c), True, is_free, None if self._is_known else expected)

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
        if attitude is None or wanted_rad is None:
            return wanted_rad
        heading_rad = yaw_rad(attitude.attitude_wxyz)
        short_rad = math.remainder(wanted_rad - heading_rad, math.tau)
        is_near = abs(short_rad) <= reflex.YAW_LEAD_RAD
        return wanted_rad if is_near else heading_rad + math.copysign(reflex.YAW_LEAD_RAD, short_rad)

    @property
    def _is_level(self) -> bool:
        """Whether the obstacle is upright: the height is then held separately."""
        return self._contact.normal_ned[2] == 0.0

    @property
    def _lets_go(self) -> bool:
        """Whether it lets go of an upright obstacle that it hung on: no more thrust than in hover until it leaves.

        Only as long as a fall can still be stopped above the ground.
        """
        height_m, down_m_s = self._flight.height_m, max(0.0, self._record.estimator.motion.velocity_ned_m_s[2])
        least_m = self._config.clearance_m + 0.5 * down_m_s**2 / reflex.STOPPING_M_S2
        return self._has_hung and self._is_level and height_m is not None and height_m > least_m

    def _height_m_s2(self, loops: float) -> float:
        record, most_m_s2 = self._record, self._config.vertical_acceleration_m_s2
        spread_m_s, told_m_s = record.estimator.spread_m_s, record.estimated_down_m_s
        return height_feedback(self._state(), spread_m_s, told_m_s, record.setpoint_ned_m[2], loops, most_m_s2)

    def _kept_off(self, acceleration_ned_m_s2: Vector3) -> Vector3:
        return kept_off(acceleration_ned_m_s2, self._tilted_motion, self._surfaces, self._config.acceleration_m_s2)

    @property
    def _tilted_motion(self) -> MotionState:
        """The present motion, with the acceleration of the present tilt."""
        return replace(self._record.estimator.motion, acceleration_ned_m_s2=self._record.estimator.tilt_m_s2)

    def _tilts_into_surface(self) -> bool:
        """Whether the vehicle tilts into a surface that it touches: its own thrust presses it on."""
        motion = self._tilted_motion
        return any(
            -reflex.BEHIND_M <= surface.off_m(motion.position_ned_m) < reflex.PLACE_SPREAD_M
            and split(motion.acceleration_ned_m_s2, surface.normal_ned)[0] < -reflex.PRESSING_TILT_M_S2
            for surface in self._surfaces
        )

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
            if self._law.follows:
                self._follow(sample, now_us)
            settled_s = self._settled_after_s(sample) if self._is_known else None
            if settled_s is not None:
                past_m, speed_m_s, record.settled_after_s = record.overshoot_m, record.rebound_speed_m_s, settled_s
                text = f"recovered: settled {settled_s:.2f} s after the hit, overshoot {past_m * 100:.1f} cm"
                text += "" if speed_m_s is None else f", rebound {speed_m_s:.2f} m/s"
                flight.report(now_us, "recovered", text, settled_after_s=settled_s, overshoot_m=past_m)
                return self._leave(flight)
        off_m_s = split(record.estimator.motion.velocity_ned_m_s, self._contact.normal_ned)[0]
        self._has_hung = self._tilts_into_surface() or (self._has_hung and off_m_s < 0.0)
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
        """The present motion as the start of a plan.

        During the contact it has no velocity into the obstacle. Its acceleration is limited to a plan's.
        """
        motion, normal = self._record.estimator.motion, self._contact.normal_ned
        velocity, acceleration, place = motion.velocity_ned_m_s, motion.acceleration_ned_m_s2, motion.position_ned_m
        if not self._has_left:
            off_m_s, along = split(velocity, normal)
            velocity = plus(along, max(0.0, off_m_s), normal)
        return MotionState(place, velocity, limited(acceleration, self._config.acceleration_m_s2))

    def _follow(self, sample: LocalPosition, now_us: int) -> None:
        """Update goal and plan from what is known by now; the plan alone where the vehicle is off it."""
        self._touch(sample)
        known = (self._contact.position_ned_m, self._contact.normal_ned, self._has_left, self._is_known)
        state, elapsed_s = self._state(), 1e-6 * (now_us - self._plan_began_us)
        is_on = holds(self._plan.at(elapsed_s), state, self._config.acceleration_m_s2)
        if known != self._planned_for or not (self._is_known or is_on):
            self._planned_for = known
            self._aim(state, now_us)
        elif is_on or not self._law.plans:
            return
        self._plan, self._plan_began_us = self._plan_from(state), now_us

    def _aim(self, state: MotionState, now_us: int) -> None:
        """Set the recovery setpoint again, from the present contact and motion."""
        flight, record, before = self._flight, self._record, self._record.setpoint_ned_m
        self._surfaces = _surfaces(flight, self._contact)
        record.setpoint_ned_m = place = _setpoint(flight, self._contact, state, self._surfaces)
        if math.dist(place, before) > flight.mission.companion.settled.distance_m:
            record.overshoot_m = 0.0  # measured past the earlier setpoint
            off_m_s = split(state.velocity_ned_m_s, self._contact.normal_ned)[0]
            text = f"off the obstacle at {off_m_s:.2f} m/s; recovery setpoint {as_text(flight.mission_ned_m(place))}"
            flight.report(now_us, "rebound", text, speed_m_s=off_m_s, recovery_setpoint_ned_m=place)

    def _plan_from(self, state: MotionState) -> Plan:
        goal = self._record.setpoint_ned_m
        if not self._law.plans:
            return Plan(state, goal, 0.0)
        return shortest(state, lambda _: goal, self._config.acceleration_m_s2)

    def _touch(self, sample: LocalPosition) -> None:
        """Update the surface. One that pushes the vehicle along, or that it hangs on, is where the vehicle is."""
        is_touched = sample.time_boot_us - self._record.estimator.pushed_boot_us < 1e6 * reflex.SMOOTHED_S
        estimator, contact = self._record.estimator, self._contact
        if self._record.after_ned_m_s is not None:
            known = self._record.normal
            contact = replace(contact, normal_ned=known.direction_ned, normal_error_rad=known.error_rad)
        normal = contact.normal_ned
        off_m_s = split(estimator.motion.velocity_ned_m_s, normal)[0]
        is_pushed = split(estimator.external_m_s2, normal)[0] > reflex.PRESSING_TILT_M_S2
        is_carried = self._is_known and is_pushed and off_m_s > SAME_M_S
        self._has_left = (self._has_left or off_m_s > 0.0) and not (is_touched or is_carried)
        # Before its motion is known, a touched surface is there too: frames and arms fold.
        goes_along = self._has_hung or is_carried or (is_touched and not self._is_known)
        place = estimator.motion.position_ned_m if goes_along else contact.position_ned_m
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
        setpoint_ned_m=_setpoint(flight, contact, expected, _surfaces(flight, contact)),
        contact_normal=normal,
        peak_specific_force_m_s2=math.hypot(*impact.specific_force_frd_m_s2),
        estimator=MotionEstimator(contact, first_us, expected, mission.companion.estimate, is_second),
    )
    if before is None and attitude is not None:
        force_ned = body_to_ned(attitude.attitude_wxyz, impact.specific_force_frd_m_s2)
        record.hypothesis = hypothesis_of(estimate, force_ned, mission.companion.estimate.imu_averaging_interval_s)
    record.estimator.note_contact(estimate.is_fully_measured, first_us)
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


def _law(flight: FlightContext) -> Law:
    return RECOVERY_LAWS[flight.mission.recovery.law]


def _setpoint(flight: FlightContext, contact: Contact, motion: MotionState, surfaces: Sequence[Surface]) -> Vector3:
    """The law's goal, moved clear of surfaces and into the fence."""
    assert flight.origin_ned_m is not None, "hits are detected only in flight"
    goal = _law(flight).goal_ned_m(flight.mission.recovery, contact, motion)
    goal = clear_goal(surfaces[1:], contact.position_ned_m, contact.normal_ned, goal)
    return inside_fence(flight.mission.fence, flight.origin_ned_m, contact.position_ned_m, goal)


def _surfaces(flight: FlightContext, contact: Contact) -> list[Surface]:
    """The surface just hit first, then those hit before in the same recovery, then the obstacle map's."""
    surfaces = [Surface(contact.position_ned_m, contact.normal_ned, flight.mission.recovery.clearance_m)]
    for record in in_one_recovery(flight.collisions):
        if record.contact.time_boot_us < contact.time_boot_us:
            touched = Surface(record.contact.position_ned_m, record.normal.direction_ned, 0.0)
            surfaces.append(replace(touched, distance_m=max(0.0, touched.off_m(record.setpoint_ned_m))))
    return surfaces + remembered_surfaces(flight, contact)
