"""State recovering: asks the reflex for the way to rest, and tells how it goes."""

from companion.flight.after_hit import take_back
from companion.flight.context import LEAD_US, FlightContext, FlightT, Handler, Inputs, Target, Transition, as_text
from companion.flight.obstacle_map import FlightRoom
from companion.flight.states import Trigger
from companion.reflex.detection.impact import ImpactEstimate
from companion.reflex.recovery.collision import Progress


def record_collision(flight: FlightContext, estimate: ImpactEstimate, now_us: int) -> None:
    record, reason = flight.reflex.begin(estimate, FlightRoom(flight), now_us), flight.reflex.why_by_position
    if reason is not None:
        flight.report(now_us, "by_position", f"recovery by position, as law paper has it: {reason}", reason=reason)
    hit = record.report()
    force_m_s2, v_c, speed_m_s = hit.peak_specific_force_m_s2, hit.impact_velocity_ned_m_s, hit.impact_speed_m_s
    place = as_text(flight.mission_ned_m(hit.position_ned_m))
    setpoint = as_text(flight.mission_ned_m(hit.recovery_setpoint_ned_m))
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


class Recover(Handler[FlightT]):
    """Fly to rest after the newest collision, and wait until the vehicle has settled."""

    def __init__(self, flight: FlightT, now_us: int) -> None:
        assert flight.reflex.newest is not None, "a collision begins a recovery"
        self._hit = flight.reflex.newest
        self._first_hit = flight.reflex.in_one_recovery()[-1]

    def target(self, flight: FlightT, now_us: int) -> Target | None:
        """Attitude and thrust until it rests; then its place."""
        place = self._hit.setpoint_ned_m
        yaw_rad = flight.heading_towards()
        # A tilt that no sample renews leads away for as long as it is repeated.
        if not self._hit.leans or flight.reflex.is_without_imu(now_us):
            return Target(place, yaw_rad)
        acceleration, lean = flight.reflex.lean()
        return Target(place, yaw_rad, None, acceleration, lean)

    def step(self, flight: FlightT, inputs: Inputs, now_us: int) -> Transition | None:
        for sample in inputs.positions:
            shown = self._hit.take(sample)
            transition = take_back(flight, now_us) if shown.is_rejected else None
            if transition is not None:
                return transition
            self._tell(flight, shown, now_us)
            if self._hit.settled_after_s is not None:
                return self._leave(flight)
        timeout_s = flight.mission.companion.settled.timeout_s
        if now_us - self._first_hit.detected_at_us > timeout_s * 1e6:
            text = f"not settled within {timeout_s:g} s of the hit; the mission goes on"
            flight.report(now_us, "recovered", text, settled_after_s=None)
            return self._leave(flight)
        return None

    def _tell(self, flight: FlightT, shown: Progress, now_us: int) -> None:
        place, settled_s = self._hit.setpoint_ned_m, self._hit.settled_after_s
        if shown.rested_s is not None:
            text = f"at rest; by position from here on, {shown.rested_s:.2f} s after the hit"
            flight.report(now_us, "hand_over", text, after_s=shown.rested_s, recovery_setpoint_ned_m=place)
        if shown.rebound_m_s is not None:
            goal, off_m_s = as_text(flight.mission_ned_m(place)), shown.rebound_m_s
            way = "away from" if round(off_m_s, 2) >= 0.0 else "towards"
            text = f"{way} the obstacle at {abs(off_m_s):.2f} m/s; recovery setpoint {goal}"
            flight.report(now_us, "rebound", text, speed_m_s=off_m_s, recovery_setpoint_ned_m=place)
        if settled_s is not None:
            past_m, speed_m_s = self._hit.overshoot_m, self._hit.rebound_speed_m_s
            text = f"recovered: settled {settled_s:.2f} s after the hit, overshoot {past_m * 100:.1f} cm"
            text += "" if speed_m_s is None else f", rebound {speed_m_s:.2f} m/s"
            flight.report(now_us, "recovered", text, settled_after_s=settled_s, overshoot_m=past_m)

    def _leave(self, flight: FlightT) -> Transition:
        """What follows begins at rest at the setpoint."""
        self._hit.is_over = True
        flight.target = Target(self._hit.setpoint_ned_m, flight.yaw_rad)
        return flight.after_recovery


class RecoverInOffboard(Recover[FlightContext]):
    """A recovery. Out of the land mode its setpoints come first, then OFFBOARD, in which alone they are flown.

    A vehicle that does not take the mode goes on landing by itself, and is left to it.
    """

    def __init__(self, flight: FlightContext, now_us: int) -> None:
        super().__init__(flight, now_us)
        offboard = flight.vehicle.autopilot.setpoints
        # Of a second hit the first one's request may be on its way.
        is_asked = flight.command_client.requested_mode == offboard
        self._ask_us = now_us + (0 if is_asked or flight.expected_mode == offboard else LEAD_US)
        if not is_asked:
            flight.count_asked_mode()

    def step(self, flight: FlightContext, inputs: Inputs, now_us: int) -> Transition | None:
        offboard = flight.vehicle.autopilot.setpoints
        is_taken = flight.own_modes == (offboard, None)  # it flies setpoints, and nothing else is asked for
        if not is_taken and now_us >= self._ask_us:
            if flight.command_client.requested_mode != offboard:
                flight.ask_for_mode(offboard)
            outcome = flight.command_outcome(inputs, flight.vehicle.flies_setpoints, now_us)
            if outcome is not None and not outcome.succeeded:
                text = f"no recovery from a hit in the landing: {outcome.text}"
                return Transition(Trigger.INTERRUPTED, text, is_left=True)
            if outcome is not None:
                flight.expected_mode = offboard
        return super().step(flight, inputs, now_us)
