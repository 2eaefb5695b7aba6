"""States connecting, standing by and watching: nothing is commanded, at most it is made ready to be."""

from companion.flight.connecting import request_streams
from companion.flight.context import FlightContext, Inputs, Target
from companion.flight.held import unattended_text
from companion.guard.context import GuardContext, GuardInputs, Move
from companion.guard.states import Trigger
from companion.messages import LandedState, MessageId, SetMessageInterval, VehicleCommand
from companion.px4_mode import OFFBOARD, mode_name

# Another's setpoints are noticed in a few tens of milliseconds: two streams that fight throw the vehicle about.
ECHO_HZ = 50.0
# The pilot is noticed within a twentieth of a second.
STICKS_HZ = 20.0
# MAVSDK repeats its setpoint at 20 Hz, others at 2 Hz at least: after this somebody has stopped.
OTHERS_STOPPED_US = 1_000_000
# A vehicle that was restarted has forgotten what it was asked for; three of its heartbeats tell that it is up again.
STREAMS_GONE_US = 3_000_000


def why_not(guard: GuardContext) -> str | None:
    """Why the vehicle is not to be taken over now, or None."""
    flight, vehicle = guard.flight, guard.flight.vehicle
    if not vehicle.armed:
        return "disarmed"
    if vehicle.landed in (LandedState.ON_GROUND, LandedState.LANDING):
        return "on the ground" if vehicle.landed is LandedState.ON_GROUND else "landing"
    if vehicle.failsafe:
        return "a failsafe flies"
    if vehicle.custom_mode is None or vehicle.history.latest() is None:
        return "no position yet"
    name = mode_name(vehicle.custom_mode)
    if name not in guard.config.modes:
        return f"{name} is not among the modes that may be taken over"
    return None if flight.origin_ned_m is not None else "no position yet"


class Connect:
    """Who is there, and does it send what is needed? The vehicle may be flying.

    A guard that was connected before goes on asking: a vehicle that was restarted has no position at first.
    """

    def __init__(self, now_us: int, is_first: bool = True) -> None:
        self._started_us, self._is_first = now_us, is_first
        self._is_told = False
        self._commands: list[VehicleCommand] | None = None
        self._measuring_since_us: int | None = None

    def target(self, now_us: int) -> Target | None:
        return None

    def step(self, guard: GuardContext, inputs: GuardInputs, now_us: int) -> Move | None:
        flight, companion = guard.flight, guard.config.companion
        identity = flight.vehicle.identity
        if identity is None:
            wait_s = companion.link.heartbeat_wait_s
            if now_us - self._started_us < wait_s * 1e6:
                return None
            return Move(Trigger.REFUSED, f"no HEARTBEAT from an autopilot within {wait_s:g} s; is the address right?")
        if self._commands is None:
            self._commands, flight.was_silent = _requests(flight), False
            text = f"connected to a PX4 {identity.vehicle_type}, system {identity.system_id}"
            flight.tell(now_us, "connected", text, system_id=identity.system_id)
        if self._measuring_since_us is None:
            self._ask(guard, self._commands, inputs, now_us)
            return None
        if flight.is_silent(now_us) or now_us - self._measuring_since_us < companion.streams.window_s * 1e6:
            return None
        return self._judge(guard, now_us)

    def _ask(self, guard: GuardContext, commands: list[VehicleCommand], inputs: GuardInputs, now_us: int) -> None:
        """A refused stream is no reason to stop: what counts is what then arrives."""
        flight = guard.flight
        if flight.command_client.busy:
            flight.command_outcome(inputs.flight, False, now_us)
        if flight.command_client.busy:
            return
        if commands:
            flight.command_client.begin(commands.pop(0))
            flight.command_outcome(Inputs(), False, now_us)
        else:
            self._measuring_since_us = now_us
            flight.streams.start(now_us)

    def _judge(self, guard: GuardContext, now_us: int) -> Move | None:
        flight = guard.flight
        complaint = flight.streams.too_slow() or flight.round_trip.complaint()
        if complaint is not None and not self._is_first:
            if not self._is_told:
                self._is_told = True
                flight.tell(now_us, "link", f"not guarded by now: {complaint}")
            self._commands, self._measuring_since_us = _requests(flight), None
            return None
        rates = flight.streams.rates_hz()
        text = ", ".join(f"{name} {rate_hz:.1f}" for name, rate_hz in rates.items())
        flight.tell(now_us, "streams", f"streams in Hz: {text}", **rates)
        flight.tell(now_us, "unattended", unattended_text(guard.config.limits.max_speed_m_s))
        return Move(Trigger.CONNECTED) if complaint is None else Move(Trigger.REFUSED, complaint)


def _requests(flight: FlightContext) -> list[VehicleCommand]:
    return [
        *request_streams(flight),
        SetMessageInterval(MessageId.POSITION_TARGET_LOCAL_NED, round(1e6 / ECHO_HZ)),
        SetMessageInterval(MessageId.MANUAL_CONTROL, round(1e6 / STICKS_HZ)),
    ]


class StandBy:
    """Nothing to guard; why is told when it changes."""

    def __init__(self) -> None:
        self._told: str | None = None

    def target(self, now_us: int) -> Target | None:
        return None

    def step(self, guard: GuardContext, inputs: GuardInputs, now_us: int) -> Move | None:
        vehicle = guard.flight.vehicle
        if vehicle.last_position_us is not None and vehicle.last_heard_us - vehicle.last_position_us > STREAMS_GONE_US:
            return Move(Trigger.STREAMS_GONE, "streams ended, asking for them again")
        reason = why_not(guard)
        if reason is None and guard.flight.round_trip.complaint() is not None:
            reason = "the round trip to the vehicle takes too long"
        if reason is None:
            assert guard.flight.vehicle.custom_mode is not None
            return Move(Trigger.WORTH_GUARDING, f"watching {mode_name(guard.flight.vehicle.custom_mode)}")
        if reason != self._told:
            self._told = reason
            guard.flight.tell(now_us, "standing_by", f"standing by: {reason}", reason=reason)
        return None


class Watch:
    """Until a hit. Setpoints lead the way, so that PX4 takes OFFBOARD at once; never beside somebody else's."""

    def __init__(self, guard: GuardContext, now_us: int) -> None:
        self._guard = guard

    def target(self, now_us: int) -> Target | None:
        """Stay where you are; PX4 looks at it in no mode but OFFBOARD, and then somebody else's stream counts."""
        guard, vehicle = self._guard, self._guard.flight.vehicle
        latest = vehicle.history.latest()
        seen_us = guard.others_setpoint_us
        streams_elsewhere = seen_us is not None and now_us - seen_us < OTHERS_STOPPED_US
        streams_elsewhere = streams_elsewhere or guard.program_elsewhere
        if latest is None or vehicle.custom_mode == OFFBOARD or streams_elsewhere:
            return None
        return Target(latest.position_ned_m, None)

    def step(self, guard: GuardContext, inputs: GuardInputs, now_us: int) -> Move | None:
        if guard.flight.vehicle.custom_mode == OFFBOARD and not guard.keeps_others_out:
            guard.program_elsewhere = True
        reason = why_not(guard)
        return None if reason is None else Move(Trigger.NOT_TO_GUARD, reason)


class End:
    """Nothing more to do."""

    def target(self, now_us: int) -> Target | None:
        return None

    def step(self, guard: GuardContext, inputs: GuardInputs, now_us: int) -> Move | None:
        return None
