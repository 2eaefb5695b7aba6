"""Whether the vehicle has crashed: tipped over, on the floor after a hit, or pressed to something for good."""

import math

from companion.flight.context import FlightContext, Handler, Inputs, Transition
from companion.flight.handlers.ending import DISARM_NEWS_US
from companion.flight.states import Trigger
from companion.messages import DISARM, DISARM_BY_FORCE
from companion.motion.rotation import tilt_rad
from companion.reflex.config import LIES_US, LOW_US, TIPPED_US


def crashed(flight: FlightContext, goes_down: bool, now_us: int) -> Transition | None:
    """Told with how, and what is known; None of a vehicle that flies, or stands."""
    watch, latest, attitude = flight.reflex.crash, flight.vehicle.history.latest, flight.vehicle.attitude
    if latest is None or attitude is None or not flight.may_crash:
        return None
    hits = flight.hits
    has_unsettled = bool(hits) and hits[-1].settled_after_s is None
    if watch.tipped.lasts_us >= TIPPED_US:
        how = "tipped over"
    elif has_unsettled and not goes_down and _is_to_be_higher(flight) and watch.low.lasts_us >= LOW_US:
        how = "on the floor after a hit"
    elif has_unsettled and _is_pressed(flight, now_us):
        how = "pressed to what was hit"
    else:
        return None
    tilt_deg = math.degrees(tilt_rad(attitude.attitude_wxyz))
    speed_m_s = hits[-1].report().impact_speed_m_s if hits else math.hypot(*latest.velocity_ned_m_s)
    place = latest.position_ned_m
    damage, height_m = flight.motors.damage, -flight.mission_ned_m(place)[2]
    motor = None if damage is None else damage.motor
    flight.flew_us = None
    flight.crashed = f"crashed: {how}, tilted by {tilt_deg:.0f} degrees"
    text = f"{flight.crashed}, {height_m:z.1f} m up, {'last hit' if hits else 'moving'} at {speed_m_s:.1f} m/s"
    text += "" if damage is None else f"; {damage.text}"
    flight.report(
        now_us, "crashed", text, how=how, tilt_deg=tilt_deg, position_ned_m=place, speed_m_s=speed_m_s, motor=motor
    )
    return Transition(Trigger.CRASHED)


def _is_to_be_higher(flight: FlightContext) -> bool:
    """Whether it is asked for more height than it has; where nobody knows, it may be."""
    if flight.target is None:
        return True
    higher_m = flight.latest.position_ned_m[2] - flight.target.position_ned_m[2]
    return higher_m > flight.mission.companion.settled.distance_m


def _is_pressed(flight: FlightContext, now_us: int) -> bool:
    """Whether the time for the recovery is over, and the vehicle is still where it touches."""
    hits, timeout_us = flight.reflex.in_one_recovery(), flight.mission.companion.settled.timeout_s * 1e6
    return bool(hits) and now_us - hits[-1].detected_at_us > timeout_us and hits[0].is_pressed


class Crashed(Handler[FlightContext]):
    """Until it is disarmed, or flies again in other hands. No setpoint is sent to a vehicle that lies or tumbles.

    One that lies is asked to disarm where `on_crash` says so, never one that may fly. PX4 refuses where it does not
    know that it has landed. Force is used only where something else than its thrust carries the vehicle: it lies on its
    side or on its back.
    """

    def __init__(self, flight: FlightContext, now_us: int) -> None:
        flight.command_client.cancel()
        flight.expected_mode, flight.is_wreck = None, True
        self._place_ned_m = flight.latest.position_ned_m
        self._ask_us, self._is_forced = 0, False

    def step(self, flight: FlightContext, inputs: Inputs, now_us: int) -> Transition | None:
        flight.is_wreck = flight.vehicle.armed is not False and not self._flies_again(flight)
        if flight.vehicle.armed is False:
            return Transition(Trigger.DISARMED, flight.crashed)
        if not flight.is_wreck:
            return Transition(Trigger.FLIES_AGAIN, f"{flight.crashed}; it flies again, in other hands")
        watch, client = flight.reflex.crash, flight.command_client
        if watch.lying.lasts_us < LIES_US:
            client.cancel()
        elif flight.mission.on_crash == "disarm" and client.pending is None and now_us >= self._ask_us:
            client.begin(DISARM_BY_FORCE if self._is_forced else DISARM)
        outcome = flight.command_outcome(inputs, False, now_us)
        if outcome is not None:
            self._ask_us, self._is_forced = now_us + DISARM_NEWS_US, watch.is_carried and not outcome.succeeded
        return None

    def _flies_again(self, flight: FlightContext) -> bool:
        """Whether it is upright, above the ground, and somewhere else."""
        height_m, tips = flight.height_m, flight.reflex.crash.tipped.since_us is not None
        if height_m is None or tips:
            return False
        away_m = math.dist(flight.latest.position_ned_m, self._place_ned_m)
        return min(away_m, height_m) > flight.mission.companion.min_detection_height_m
