"""States connecting, standing by and watching: nothing is commanded, at most it is made ready to be."""

from collections.abc import Sequence

from companion.autopilot.interface import Pilot
from companion.flight.context import Handler, Inputs, Target, Transition
from companion.flight.envelope import unattended_text
from companion.flight.handlers.connecting import Meet
from companion.flight.vehicle_update import update_vehicle
from companion.guard.context import GuardContext
from companion.guard.states import Trigger
from companion.link.vehicle import OLD_NEWS_US
from companion.messages import (
    LandedState,
    MessageId,
    PositionTarget,
    Sample,
    Sticks,
    VehicleCommand,
    set_message_interval,
)
from companion.motion.config import SAME_M_S
from companion.reflex.detection.detector import NO_POSITION, ON_THE_GROUND

# Another's setpoints are noticed in a few tens of milliseconds: two streams of setpoints shake the vehicle.
ECHO_HZ = 50.0
# The pilot is noticed within a twentieth of a second.
STICKS_HZ = 20.0
THROTTLE = 2
# MAVSDK repeats its setpoint at 20 Hz, others at 2 Hz at least: after this somebody has stopped.
OTHERS_STOPPED_US = 1_000_000
# OFFBOARD that lasts so long has a sender elsewhere: PX4 holds the guard's own last setpoint for a second, by default,
# and notices late.
OTHERS_STREAM_US = 2 * OTHERS_STOPPED_US
# A vehicle that was restarted has forgotten what it was asked for; three of its heartbeats tell that it is up again.
STREAMS_GONE_US = 3_000_000


def observe(guard: GuardContext, samples: Sequence[Sample], now_us: int) -> str | None:
    """Update what is known of the vehicle; why it is refused, or None.

    The fence and the heights begin where the vehicle stood last. Of one met in the air only the zero of its own local
    frame is known, which is where its estimator began.
    """
    refusal = update_vehicle(guard, samples, now_us)
    for sample in samples:
        if isinstance(sample, PositionTarget):
            guard.sinks_m_s, guard.sinks_us = sample.velocity_down_m_s or 0.0, now_us
        elif isinstance(sample, Sticks):
            guard.sticks_now, guard.sticks_us = sample, now_us
    # Where the mode needs no stream, one that has left it may have been sent somewhere once.
    streams = guard.vehicle.flies_setpoints and guard.vehicle.autopilot.wants_setpoints_first
    guard.others_stream.update(streams and guard.expected_mode is None, now_us)
    guard.program_elsewhere |= guard.others_stream.lasts_us > OTHERS_STREAM_US and not guard.keeps_others_out
    latest = guard.vehicle.history.latest
    if guard.vehicle.armed is False:
        guard.program_elsewhere = guard.is_wreck = False
    guard.has_stood |= guard.vehicle.armed is False or guard.vehicle.landed is LandedState.ON_GROUND
    # Not while the guard has the vehicle: one forged report would move the fence.
    stands = guard.vehicle.stands and guard.expected_mode is None
    if guard.vehicle.armed is False or stands:
        guard.origin_ned_m = None if latest is None else latest.position_ned_m
    elif guard.origin_ned_m is None and latest is not None:
        guard.origin_ned_m = (latest.position_ned_m[0], latest.position_ned_m[1], 0.0)
    return refusal


def goes_down(guard: GuardContext, now_us: int) -> bool:
    """Whether the vehicle is meant to: by its mode, by what its position control is asked for, or by hand.

    A pilot who flies by attitude or rates has the thrust in hand: what lets the vehicle down is meant. So it is where
    the sticks ask for velocities, and nothing has ever told which.
    """
    vehicle, sticks, asked_us = guard.vehicle, guard.sticks_now, guard.sinks_us
    descends = vehicle.custom_mode in vehicle.autopilot.descents
    if vehicle.landed is LandedState.LANDING or descends or vehicle.pilot is Pilot.HAND:
        return True
    deadzone = vehicle.autopilot.stick_deadzone
    sinks = asked_us is None if sticks is None else sticks.deflections[THROTTLE] < -deadzone
    if vehicle.pilot is Pilot.STICKS and sinks:
        return True
    return asked_us is not None and now_us - asked_us < OLD_NEWS_US and guard.sinks_m_s > SAME_M_S


def not_flying(guard: GuardContext) -> str | None:
    """Why there is nothing to watch, whoever flies, or None."""
    vehicle = guard.vehicle
    if not vehicle.armed:
        return "disarmed"
    if vehicle.landed is LandedState.ON_GROUND:
        return ON_THE_GROUND
    return None if vehicle.custom_mode is not None and guard.height_m is not None else NO_POSITION


def why_not(guard: GuardContext) -> str | None:
    """Why the vehicle is not to be taken over now, or None."""
    reason = not_flying(guard)
    if reason is not None:
        return reason
    if guard.vehicle.failsafe:
        return "a failsafe flies"
    name = guard.vehicle.mode_name
    return None if name in guard.config.modes else f"{name} is not among the modes that may be taken over"


class GuardConnect(Meet[GuardContext]):
    """The vehicle may be flying.

    A guard that was connected before goes on asking: a vehicle that was restarted has no position at first.
    """

    def _commands(self, guard: GuardContext) -> list[VehicleCommand]:
        echoes = set_message_interval(MessageId.POSITION_TARGET_LOCAL_NED, round(1e6 / ECHO_HZ))
        sticks = set_message_interval(guard.vehicle.autopilot.sticks_message, round(1e6 / STICKS_HZ))
        return [*super()._commands(guard), echoes, sticks]

    def _judge(self, guard: GuardContext, now_us: int) -> Transition | None:
        complaint = self._missing(guard) or guard.round_trip.complaint()
        if complaint is not None and (guard.mission.companion.link.wait or guard.was_met):
            self._ask_again(guard, f"not guarded by now: {complaint}", now_us)
            return None
        self._report_streams(guard, now_us)
        guard.report(now_us, "unattended", unattended_text(guard.vehicle.autopilot))
        return Transition(Trigger.CONNECTED) if complaint is None else Transition(Trigger.REFUSED, complaint)


class StandBy(Handler[GuardContext]):
    """Nothing to guard; the reason is reported when it changes."""

    def __init__(self, guard: GuardContext, now_us: int) -> None:
        guard.was_met = True
        self._told: str | None = None

    def step(self, guard: GuardContext, inputs: Inputs, now_us: int) -> Transition | None:
        vehicle = guard.vehicle
        position_us = vehicle.last_position_us
        if position_us is not None and vehicle.last_received_us - position_us > STREAMS_GONE_US:
            return Transition(Trigger.STREAMS_GONE, "streams ended, asking for them again")
        reason = why_not(guard)
        if reason is None and guard.round_trip.complaint() is not None:
            reason = "the round trip to the vehicle takes too long"
        if reason is None:
            return Transition(Trigger.WORTH_GUARDING, f"watching {vehicle.mode_name}")
        if reason != self._told:
            self._told = reason
            guard.report(now_us, "standing_by", f"standing by: {reason}", reason=reason)
        return None


class Watching(Handler[GuardContext]):
    """Until a hit. Setpoints are sent in advance, so that PX4 takes OFFBOARD at once; never beside somebody else's."""

    def target(self, guard: GuardContext, now_us: int) -> Target | None:
        """A setpoint at the present position. PX4 uses it in OFFBOARD alone, and then somebody else's stream counts."""
        streams_elsewhere = guard.program_elsewhere or now_us - guard.others_setpoint_us < OTHERS_STOPPED_US
        is_wanted = guard.vehicle.autopilot.wants_setpoints_first and not guard.vehicle.flies_setpoints
        return Target(guard.latest.position_ned_m, None) if is_wanted and not streams_elsewhere else None

    def step(self, guard: GuardContext, inputs: Inputs, now_us: int) -> Transition | None:
        reason = why_not(guard)
        return None if reason is None else Transition(Trigger.NOT_TO_GUARD)
