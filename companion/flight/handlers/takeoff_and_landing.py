"""State takeoff: setpoints, OFFBOARD, arm, climb. State landing: PX4's own land mode."""

import math

from companion.flight.context import FlightContext, Handler, Inputs, Target, Transition, as_text
from companion.flight.handlers.ending import may_ask
from companion.flight.states import Trigger
from companion.memory.patch import mean_of
from companion.messages import ARM, LandedState, Vector3, take_off
from companion.mission.items import TakeoffItem
from companion.mission.trajectory import LineProfile
from companion.motion.settling import Lasting
from companion.motion.vector import plus

# The arming position is a mean over this: it takes the noise out of the zero of all mission coordinates.
ORIGIN_MEAN_US = 1_000_000


# Largest error of a boot clock that was not restarted. SITL's runs up to 1 % off (measured); the wall clock may be set
# by a second or two.
BOOT_CLOCK_DRIFT = 0.02
BOOT_CLOCK_SLACK_US = 3_000_000
# The setpoint waits while the motors spin up: PX4 takes two seconds from arming to lift-off. A vehicle half a metre
# behind its setpoint climbs 0.65 m/s faster than commanded, into whatever is above.
MOST_AHEAD_M = 0.15
# A vehicle that was told to take off has done so when it is at the top, and slower than this.
ARRIVES_M_S = 0.2


class TakeOff(Handler[FlightContext]):
    """In OFFBOARD from the start, so that the same setpoint stream carries the whole flight."""

    is_active = has_floor = False

    def __init__(self, flight: FlightContext, now_us: int) -> None:
        item = flight.steps[0].action
        assert isinstance(item, TakeoffItem), "the mission model sees to it"
        self._item = item
        # Streaming setpoints, switching to OFFBOARD, arming, climbing: one after the other.
        self._now = self._switch
        self._is_told = flight.vehicle.autopilot.is_told_to_take_off
        self._started_us = now_us
        self._profile: LineProfile | None = None
        self._climbing_s = 0.0  # along the profile
        flight.yaw_rad = flight.vehicle.heading_rad
        self._target = Target(mean_position(flight), flight.yaw_rad)
        flight.report(now_us, "takeoff", f"streaming setpoints for take-off to {item.height_m:g} m")

    def target(self, flight: FlightContext, now_us: int) -> Target | None:
        if self._profile is None or self._is_told:
            return self._target
        place, velocity, acceleration = self._profile.at(self._climbing_s)
        target = Target(place, flight.yaw_rad, velocity, acceleration)
        return target if flight.has_position else target.at_rest()

    def step(self, flight: FlightContext, inputs: Inputs, now_us: int) -> Transition | None:
        return self._now(flight, inputs, now_us)

    def _switch(self, flight: FlightContext, inputs: Inputs, now_us: int) -> Transition | None:
        if flight.vehicle.armed:
            text = "the vehicle was armed, and not by the companion"
            return Transition(Trigger.CONTROL_LOST, text, is_left=True)
        if flight.command_client.pending is None:
            if now_us - self._started_us < flight.mission.companion.flight.setpoint_lead_s * 1e6:
                return None
            flight.expected_mode = flight.vehicle.custom_mode
            flight.ask_for_mode(flight.vehicle.autopilot.setpoints)
        outcome = flight.command_outcome(inputs, flight.vehicle.flies_setpoints, now_us)
        if outcome is None:
            return None
        if not outcome.succeeded:
            return Transition(Trigger.REFUSED, f"no OFFBOARD: {outcome.text}")
        flight.expected_mode = flight.vehicle.autopilot.setpoints
        self._now = self._arm
        flight.vehicle.said = ""  # what it warned of before may have another reason
        flight.command_client.begin(ARM)
        return self._arm(flight, Inputs(), now_us)

    def _arm(self, flight: FlightContext, inputs: Inputs, now_us: int) -> Transition | None:
        outcome = flight.command_outcome(inputs, flight.vehicle.armed is True, now_us)
        if outcome is None:
            return None
        if not outcome.succeeded:
            why = flight.vehicle.said or flight.vehicle.autopilot.remedy_not_armed
            return Transition(Trigger.REFUSED, f"not armed: {outcome.text}; {why}")
        self._now = self._climb
        self.is_active = True
        if self._is_told:
            flight.target = self._target = None  # a setpoint ends its take-off
            flight.command_client.begin(take_off(self._item.height_m))
        self._started_us = flight.armed_at_us = now_us
        self._climbed_until_us = flight.trajectory_us  # on the clock of ways
        ground, boot_us = mean_position(flight), flight.latest.time_boot_us
        flight.origin_ned_m = origin_of(flight, ground, boot_us, now_us)
        self._profile = flight.mission.climb(ground, self._item.height_m - ground[2])
        text = f"armed at {as_text(ground)}, climbing to {self._item.height_m:g} m"
        flight.report(now_us, "armed", text, origin_ned_m=flight.origin_ned_m, time_boot_us=boot_us)
        return None

    def _climb(self, flight: FlightContext, inputs: Inputs, now_us: int) -> Transition | None:
        profile, latest, limits = self._profile, flight.latest, flight.mission.companion.flight
        assert profile is not None, "it is armed"
        # A vehicle that takes off by itself has to agree to it.
        outcome = None if flight.command_client.pending is None else flight.command_outcome(inputs, False, now_us)
        if outcome is not None and not outcome.succeeded:
            return Transition(Trigger.REFUSED, f"no take-off: {outcome.text}")
        if latest.position_ned_m[2] - profile.at(self._climbing_s)[0][2] < MOST_AHEAD_M:
            self._climbing_s += (flight.trajectory_us - self._climbed_until_us) * 1e-6
        self._climbed_until_us = flight.trajectory_us
        is_up = math.dist(latest.position_ned_m, profile.target_m) <= limits.acceptance_radius_m
        if self._is_told and is_up and math.hypot(*latest.velocity_ned_m_s) < ARRIVES_M_S:
            # The mission's first way begins here.
            flight.target = Target(profile.target_m, flight.yaw_rad)
            return Transition(Trigger.TAKEN_OFF)
        if not self._is_told and is_up and self._climbing_s >= profile.duration_s:
            return Transition(Trigger.TAKEN_OFF)
        if (now_us - self._started_us) * 1e-6 > profile.duration_s + limits.arrival_timeout_s:
            return Transition(Trigger.INTERRUPTED, "the take-off height was not reached in time")
        return None


def origin_of(flight: FlightContext, ground_ned_m: Vector3, boot_us: int, now_us: int) -> Vector3:
    """The zero of mission coordinates: where the vehicle stands, or where the flight that is resumed was armed.

    The latter only where the vehicle's boot clock has gone on since then, so that its local frame is still the same.
    """
    resume = flight.mission.resume
    if resume is None:
        return ground_ned_m
    passed_us = now_us - resume.armed_at_us
    drift_us = abs(boot_us - resume.armed_boot_us - passed_us)
    same_frame = drift_us <= BOOT_CLOCK_DRIFT * passed_us + BOOT_CLOCK_SLACK_US
    which = "the first flight's arming position" if same_frame else "this arming position: the vehicle was restarted"
    flight.report(now_us, "resume", f"coordinates count from {which}")
    return resume.origin_ned_m if same_frame else ground_ned_m


def mean_position(flight: FlightContext) -> Vector3:
    """Mean of the last second's positions, local NED."""
    boot_us = flight.latest.time_boot_us
    samples = flight.vehicle.history.between(boot_us - ORIGIN_MEAN_US, boot_us + 1)
    return mean_of([sample.position_ned_m for sample in samples])


# From 12 m at PX4's 0.7 m/s it takes under 30 s with detection and disarming. This allows for its
# lowest value, 0.6 m/s, from 60 m.
LANDING_TIMEOUT_US = 120_000_000


# A Copter that was asked to land at 0.8 m/s stood up to 0.9 m beside its goal: about a second of its speed.
BRAKES_S = 1.0
# PX4 brakes from 12 m/s with 3 m/s^2, both its defaults, and comes back; what never rests lands all the same.
RESTS_WITHIN_US = 6_000_000


def rests(flight: FlightContext, near: Lasting, goal_ned_m: Vector3) -> bool:
    """Whether it stays at a place, `near` it for long enough: one that turns round is slow for a moment, too."""
    config, latest = flight.mission.companion, flight.latest
    place = flight.reflex.place_ned_m(latest)
    off_m = max(math.dist(each, goal_ned_m) for each in (place, plus(place, BRAKES_S, latest.velocity_ned_m_s)))
    near.update(off_m <= config.flight.acceptance_radius_m, latest.time_boot_us)
    return near.lasts_us >= config.settled.duration_s * 1e6


class Land(Handler[FlightContext]):
    """Rest at the last setpoint, ask for the mode, keep the setpoints going until the vehicle has it, then wait.

    One that is asked to land in motion lands where it comes to rest, be it outside the fence. One that is hurt, or near
    the ground, or does not know where it is, is asked at once.
    """

    has_floor = False

    def __init__(self, flight: FlightContext, now_us: int) -> None:
        self._started_us = now_us
        self._target = flight.target and flight.target.at_rest()
        self._is_asked = self._landing = False
        self._near = Lasting()
        self._ready_us: int | None = None
        flight.is_landing = True

    def _waits(self, flight: FlightContext, now_us: int) -> bool:
        hits = flight.hits
        is_hurt = flight.motors.damage is not None or (bool(hits) and hits[-1].settled_after_s is None)
        if self._target is None or is_hurt or not _is_high(flight):
            return False
        is_moving = not rests(flight, self._near, self._target.position_ned_m)
        return is_moving and now_us - self._started_us < RESTS_WITHIN_US

    def step(self, flight: FlightContext, inputs: Inputs, now_us: int) -> Transition | None:
        if flight.vehicle.armed is False:
            if _is_high(flight) and flight.vehicle.landed is not LandedState.ON_GROUND:
                return Transition(Trigger.CONTROL_LOST, "the vehicle was disarmed in the air", is_left=True)
            return Transition(Trigger.DISARMED)
        if not self._is_asked:
            if self._ready_us is None and self._waits(flight, now_us):
                return None
            self._ready_us = self._ready_us or now_us
            if not may_ask(flight, self._ready_us, now_us):
                return None
            self._is_asked = True
            flight.count_asked_mode()
            flight.ask_for_mode(flight.vehicle.autopilot.land)
        if not self._landing:
            vehicle = flight.vehicle
            outcome = flight.command_outcome(inputs, vehicle.custom_mode == vehicle.autopilot.land, now_us)
            if outcome is None:
                return None
            if not outcome.succeeded:
                return Transition(Trigger.INTERRUPTED, f"no landing: {outcome.text}")
            self._landing, self._target = True, None
            flight.expected_mode = flight.vehicle.autopilot.land
            flight.report(now_us, "landing", "landing here")
        if now_us - self._started_us > LANDING_TIMEOUT_US:
            seconds = LANDING_TIMEOUT_US // 1_000_000
            return Transition(Trigger.INTERRUPTED, f"not disarmed {seconds} s after the order to land", is_left=True)
        return None


def _is_high(flight: FlightContext) -> bool:
    return flight.height_m is not None and flight.height_m >= flight.mission.companion.min_detection_height_m
