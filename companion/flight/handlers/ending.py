"""What ends a flight from outside, in every state, and how the vehicle is handed over."""

import math
from typing import Literal

from companion.flight.context import FlightContext, FlightT, Handler, Inputs, Target, Transition
from companion.flight.states import State, Trigger
from companion.link.commands import ACK_TIMEOUT_US, ATTEMPTS, CommandOutcome
from companion.link.vehicle import OLD_NEWS_US
from companion.messages import DISARM, LandedState

ON_THE_GROUND = (State.CONNECT, State.READY)
ON_SETPOINTS = (State.TAKEOFF, State.MISSION, State.RECOVERING, State.HOLDING, State.RETURNING)

# After a hit the setpoint jumps, and the vehicle takes its time.
FOLLOWING = (State.MISSION, State.HOLDING, State.RETURNING)

LINK_RESTORED = "the vehicle was silent: its streams are asked for again"
# HEARTBEAT, which alone tells that the vehicle has disarmed, comes once a second; half a second for delays.
DISARM_NEWS_US = 1_500_000


def early_end(flight: FlightContext, state: State, inputs: Inputs, now_us: int) -> Transition | None:
    """The first reason to end, the pilot's before all others."""
    lost = _control_lost(flight, state)
    if lost is not None:
        return lost
    if inputs.refusal is not None:
        return Transition(Trigger.REFUSED, inputs.refusal)
    stop_reason = _stop_reason(flight, state, inputs.stop_reason, now_us)
    if stop_reason is not None:
        return Transition(Trigger.INTERRUPTED, stop_reason)
    silent = _link_silent(flight, state, now_us)
    if silent is not None or state not in ON_SETPOINTS:
        return silent
    reason = silent_position(flight)
    # The mission's own conditions are looked at with each new position, so that a silent link is not one of them.
    if reason is None and inputs.positions and flight.armed_at_us is not None:
        reason = _outside_fence(flight)
        if reason is None:
            reason = _once_clear(flight, state, _abort_reason(flight, state, now_us), now_us)
    return None if reason is None else Transition(Trigger.INTERRUPTED, reason)


def _stop_reason(flight: FlightContext, state: State, asked: str | None, now_us: int) -> str | None:
    """Why to stop now; asked for twice, in a recovery, too."""
    was_asked, flight.is_stop_asked = flight.is_stop_asked, flight.is_stop_asked or asked is not None
    if asked is not None and was_asked:
        return asked
    return _once_clear(flight, state, asked or flight.stop_put_off, now_us)


def _once_clear(flight: FlightContext, state: State, reason: str | None, now_us: int) -> str | None:
    """The reason to end. A hold at what was hit may touch it again: the recovery comes first."""
    if reason is None or state is not State.RECOVERING:
        return reason
    if flight.stop_put_off is None:
        flight.stop_put_off = reason
        text = f"{reason}: the vehicle is handed over once it is clear; after a second stop, at once"
        flight.report(now_us, "stopping", text)
    return None


def _control_lost(flight: FlightContext, state: State) -> Transition | None:
    vehicle = flight.vehicle
    if flight.armed_at_us is not None and vehicle.armed is False and state in ON_SETPOINTS:
        return Transition(Trigger.CONTROL_LOST, "the vehicle was disarmed, and not by the companion", is_left=True)
    taken = taken_by(flight, flight.command_client.requested_mode, "the pilot")
    if taken is None or (state is State.LANDING and _may_be_down(flight)):
        return None
    return Transition(Trigger.CONTROL_LOST, f"{taken}; setpoints stopped", is_left=True)


def _may_be_down(flight: FlightContext) -> bool:
    """PX4 leaves the land mode by itself when it has landed and disarms; the heartbeat that reports it may come later.

    Nothing is sent meanwhile: the setpoints ended when the land mode was confirmed.
    """
    vehicle = flight.vehicle
    if flight.expected_mode != vehicle.autopilot.land:
        return False
    if vehicle.armed is False or vehicle.landed is LandedState.ON_GROUND:
        return True
    if flight.foreign_mode_since_us is None:
        flight.foreign_mode_since_us = flight.trajectory_us
    return flight.trajectory_us - flight.foreign_mode_since_us <= DISARM_NEWS_US


def _link_silent(flight: FlightContext, state: State, now_us: int) -> Transition | None:
    if flight.vehicle.identity is None:
        return None
    if state in ON_THE_GROUND:
        silent_s, link = flight.silent_s(now_us), flight.mission.companion.link
        if silent_s > link.heartbeat_wait_s and not link.wait:
            return Transition(Trigger.REFUSED, f"the vehicle has been silent for {silent_s:.1f} s")
        flight.was_silent |= flight.is_silent(now_us)
        if flight.is_silent(now_us) or not flight.was_silent:
            return None
        flight.report(now_us, "link", LINK_RESTORED)
        return Transition(Trigger.LINK_RESTORED)
    text = silent_link(flight, now_us)
    if text is None:
        return None
    # A vehicle that has been told to land is already doing what is safe.
    is_landing = state is State.LANDING and flight.expected_mode == flight.vehicle.autopilot.land
    return Transition(Trigger.INTERRUPTED, text, is_left=is_landing)


def silent_link(flight: FlightContext, now_us: int) -> str | None:
    """What is wrong with a link on which nothing comes any more; None where something does."""
    return f"the link has been silent for {flight.silent_s(now_us):.1f} s" if flight.is_silent(now_us) else None


def silent_position(flight: FlightContext) -> str | None:
    """The same of positions, on a link that is alive. The delay of a late step does not count."""
    vehicle, heard_us = flight.vehicle, flight.vehicle.last_position_us
    silent_s = 0.0 if heard_us is None else (vehicle.last_received_us - heard_us - flight.missed_us) * 1e-6
    is_silent = silent_s > flight.mission.companion.link.position_silence_s
    return f"no LOCAL_POSITION_NED for {silent_s:.1f} s, though the link is alive" if is_silent else None


def _outside_fence(flight: FlightContext) -> str | None:
    """Two positions in a row have to say so: one forged or broken packet ends no flight."""
    most_m, latest = flight.mission.abort_when.outside_fence_by_m, flight.latest
    earlier = flight.vehicle.history.before(latest.time_boot_us)
    if most_m is None or earlier is None:
        return None
    places = [flight.mission_ned_m(flight.reflex.place_ned_m(one)) for one in (latest, earlier)]
    outside_m = min(map(flight.mission.fence.outside_by_m, places))
    return f"the vehicle is {outside_m:.2f} m outside the fence" if outside_m > most_m else None


def _abort_reason(flight: FlightContext, state: State, now_us: int) -> str | None:
    when = flight.mission.abort_when
    flown_s = (now_us - (flight.armed_at_us or now_us)) * 1e-6
    if when.flight_time_above_s is not None and flown_s > when.flight_time_above_s:
        return f"flight time above {when.flight_time_above_s:g} s"
    if when.blind_for_s is not None and flight.blind.lasts_us > when.blind_for_s * 1e6:
        return f"the detector has been blind for {when.blind_for_s:g} s"
    if when.setpoint_missed_by_m is not None and state in FOLLOWING and flight.target is not None:
        missed_m = math.dist(flight.reflex.place_ned_m(flight.latest), flight.target.position_ned_m)
        if missed_m > when.setpoint_missed_by_m:
            return f"the vehicle is {missed_m:.2f} m from its setpoint"
    return battery_complaint(flight)


def battery_complaint(flight: FlightContext) -> str | None:
    """What is wrong with the battery by the mission's condition; None where there is none."""
    least, percent = flight.mission.abort_when.battery_below_percent, flight.vehicle.battery_percent
    if least is None or percent is None or percent >= least:
        return None
    return f"battery at {percent} %, below abort_when.battery_below_percent = {least:g}"


def who_decided(flight: FlightContext, requested_mode: int | None) -> Literal["failsafe", "pilot"] | None:
    """Who has the vehicle by its newest report of the mode; None: the companion, or nobody knows.

    `requested_mode`: one that the companion has asked for and not yet seen. In a failsafe PX4 keeps the user's intended
    mode (CURRENT_MODE) and reports MAV_STATE_CRITICAL (HEARTBEAT); a pilot's change moves the intended mode too.
    """
    report, expected_mode = flight.vehicle.mode, flight.expected_mode
    if report is None or expected_mode is None or report.custom_mode in (expected_mode, requested_mode):
        return None
    intended_mode = report.intended_custom_mode
    still_intended = intended_mode is not None and intended_mode in (expected_mode, requested_mode)
    return "failsafe" if flight.vehicle.is_failsafe_mode or still_intended else "pilot"


# Where setpoints were late, or lost on the way, PX4 leaves OFFBOARD and takes it again by itself 0.09 s
# after the next one. Its mode is reported every 0.1 s. A failsafe that lasts for twice all that is for another reason.
RETURNS_US = 400_000


def taken_by(flight: FlightContext, requested_mode: int | None, others: str) -> str | None:
    """Who has taken the vehicle (see `who_decided`): not a failsafe for want of setpoints that may end by itself.

    One that has landed the vehicle does not, or nearly: nobody expects it to take off.
    """
    holder, report = who_decided(flight, requested_mode), flight.vehicle.mode
    if holder is None or report is None:
        flight.foreign_mode_since_us = None
        return None
    autopilot = flight.vehicle.autopilot
    is_late = autopilot.wants_setpoints_first and autopilot.setpoints in (flight.expected_mode, requested_mode)
    is_late &= report.intended_custom_mode in (None, autopilot.setpoints)
    is_low = flight.height_m is not None and flight.height_m < flight.mission.companion.min_detection_height_m
    if holder == "failsafe" and is_late and not is_low:
        if flight.foreign_mode_since_us is None:
            flight.foreign_mode_since_us = flight.trajectory_us
        if flight.trajectory_us - flight.foreign_mode_since_us < RETURNS_US:
            return None
    return f"{'a failsafe of the vehicle' if holder == 'failsafe' else others} took over in {flight.vehicle.mode_name}"


# As long as two modes take that are refused: a hand-over that does not end keeps nobody in OFFBOARD.
LONGEST_US = 2 * ATTEMPTS * ACK_TIMEOUT_US


def may_ask(flight: FlightContext, since_us: int, now_us: int) -> bool:
    """Whether a mode may be asked for: straight after a report of the present one. Without a report the wait ends."""
    vehicle = flight.vehicle
    is_told = vehicle.mode_received_us == now_us and vehicle.is_mode_known
    is_old = now_us - vehicle.last_received_us >= OLD_NEWS_US
    return is_told or is_old or (now_us - since_us) * 1e-6 >= flight.mission.companion.link.silence_s


class Released(Handler[FlightContext]):
    """Nothing more to do: somebody else has the vehicle, or it was never taken."""

    finished = True


class GiveAway(Handler[FlightT]):
    """Ask for a mode straight after a report of the present one; setpoints go on until it is seen.

    A person's earlier request shows in that report, and is not overruled. Without a report the wait ends.
    """

    def __init__(self, flight: FlightT, now_us: int) -> None:
        self._began_us, self._is_asked = now_us, False
        self._target = None if flight.target is None else flight.target.at_rest()

    def _ask_for(self, mode: int, flight: FlightT, inputs: Inputs, now_us: int) -> CommandOutcome | None:
        vehicle = flight.vehicle
        if not self._is_asked:
            if not may_ask(flight, self._began_us, now_us):
                return None
            self._is_asked = True
            flight.ask_for_mode(mode)
        return flight.command_outcome(inputs, vehicle.custom_mode == mode, now_us)


class HandOver(GiveAway[FlightContext]):
    """Disarm if the climb has not begun, then request the mode.

    A takeover before the request is seen first. A later one counts, too. A vehicle that refuses to hold is asked to
    land. The setpoints stop when the command client gives up (about 2.5 s without an answer), and after LONGEST_US at
    the latest. Then PX4's own loss-of-offboard action takes over.
    """

    is_active = has_floor = False

    def __init__(self, flight: FlightContext, now_us: int) -> None:
        super().__init__(flight, now_us)
        autopilot = flight.vehicle.autopilot
        self._mode = autopilot.land if flight.mission.on_interrupt == "land" else autopilot.hold
        self._asked_before = flight.command_client.requested_mode
        flight.command_client.cancel()
        # Asked to arm and not yet seen armed: it has not climbed, and may arm any moment.
        if flight.armed_at_us is None and flight.expected_mode == autopilot.setpoints:
            flight.command_client.begin(DISARM)

    def target(self, flight: FlightContext, now_us: int) -> Target | None:
        return None if self.finished or now_us - self._began_us >= LONGEST_US else self._target

    def step(self, flight: FlightContext, inputs: Inputs, now_us: int) -> None:
        if not self.finished and self._is_over(flight, inputs, now_us):
            self.finished = True
            flight.command_client.cancel()

    def _is_over(self, flight: FlightContext, inputs: Inputs, now_us: int) -> bool:
        """Whether there is nothing left to ask for, or another has taken the vehicle."""
        if self._asked_before is not None and flight.vehicle.custom_mode == self._asked_before:
            # Late: it was asked for, and given up.
            flight.expected_mode = self._asked_before
        if (holder := who_decided(flight, self._mode)) is not None:
            flight.report(now_us, "mode", f"{holder} took over in {flight.vehicle.mode_name}")
            return True
        if flight.command_client.pending == DISARM and flight.command_outcome(inputs, False, now_us) is None:
            return False
        outcome = self._ask_for(self._mode, flight, inputs, now_us)
        if outcome is None:
            return False
        if outcome.succeeded:
            flight.report(now_us, "mode", f"handed over to {flight.vehicle.autopilot.mode(self._mode).name}")
        elif outcome.refused and self._mode == flight.vehicle.autopilot.hold:
            # PX4 holds only with a global position; without one (motion capture alone) it still lands.
            self._mode = flight.vehicle.autopilot.land
            flight.report(now_us, "mode", "the vehicle does not hold: asking it to land")
            flight.ask_for_mode(self._mode)
            return False
        return True
