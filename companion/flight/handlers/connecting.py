"""States connect and ready: who is there, are its streams fast enough, does the person agree."""

from abc import ABC, abstractmethod
from collections.abc import Iterator
from itertools import chain

from companion.flight.context import FlightContext, FlightT, Handler, Inputs, Transition
from companion.flight.handlers.ending import battery_complaint
from companion.flight.plan import plan_text
from companion.flight.states import Trigger
from companion.messages import LandedState, MessageId, VehicleCommand, request_message, set_message_interval


class Meet(Handler[FlightT], ABC):
    """Wait for the vehicle, ask for the streams, measure them, judge; of a flight and of a guard.

    Of a vehicle that has restarted nothing that was measured before is valid.
    """

    is_active = False

    def __init__(self, flight: FlightT, now_us: int) -> None:
        flight.reflex.restart(now_us)
        flight.vehicle.attitude_parameters.clear()
        self._started_us = now_us  # to look for a vehicle, then with it
        self._requests: Iterator[VehicleCommand] | None = None
        self._is_answered = False  # any of them
        self._measuring_since_us: int | None = None
        self.is_told = False  # what is waited for

    @abstractmethod
    def _judge(self, flight: FlightT, now_us: int) -> Transition | None:
        """Once the streams have been measured."""

    def _commands(self, flight: FlightT) -> list[VehicleCommand]:
        """What is asked of a vehicle that has just been met."""
        requested = [stream.request() for stream in flight.streams.streams]
        return [request_message(MessageId.AUTOPILOT_VERSION), *requested, *flight.vehicle.autopilot.streams]

    def step(self, flight: FlightT, inputs: Inputs, now_us: int) -> Transition | None:
        identity, companion = flight.vehicle.identity, flight.mission.companion
        if identity is None:
            wait_s = companion.link.heartbeat_wait_s
            if self.is_told or now_us - self._started_us < wait_s * 1e6:
                return None
            text = f"no HEARTBEAT from an autopilot within {wait_s:g} s"
            if not companion.link.wait:
                return Transition(Trigger.REFUSED, f"{text}; is the address right?")
            self.is_told = True
            flight.report(now_us, "link", f"{text}: waiting for it")
            return None
        if self._requests is None:
            self._requests, flight.was_silent, self.is_told = iter(self._commands(flight)), False, False
            self._started_us = now_us
            name = identity.autopilot.name
            article = "an" if name[0] in "AEIOU" else "a"
            text = f"connected to {article} {name} {identity.vehicle_type}, system {identity.system_id}"
            flight.report(now_us, "connected", text, system_id=identity.system_id)
        if self._measuring_since_us is None:
            self._ask(flight, self._requests, inputs, now_us)
            return None
        if now_us - self._measuring_since_us < companion.streams.window_s * 1e6 or flight.is_silent(now_us):
            return None
        too_old = flight.vehicle.version_complaint()
        return self._judge(flight, now_us) if too_old is None else Transition(Trigger.REFUSED, too_old)

    def _ask(self, flight: FlightT, requests: Iterator[VehicleCommand], inputs: Inputs, now_us: int) -> None:
        """A refused request is no reason to stop: what counts is what then arrives."""
        pending, asked = flight.command_client.pending, flight.streams.asked.get(MessageId.HIGHRES_IMU)
        outcome, imu = flight.command_outcome(inputs, False, now_us), flight.vehicle.autopilot.lesser_imu
        self._is_answered |= outcome is not None and (outcome.succeeded or outcome.refused)
        has_none = outcome is not None and outcome.refused and pending == asked
        if has_none and asked is not None and imu is not None:
            requests = self._requests = chain([set_message_interval(imu, round(asked.parameters[1]))], requests)
        if flight.command_client.pending is not None:
            return
        if (request := next(requests, None)) is not None:
            if len(request.parameters) == 2:  # how often it is to come
                flight.streams.asked[request.parameters[0]] = request
            flight.command_client.begin(request)
            flight.command_outcome(Inputs(), False, now_us)
        else:
            self._measuring_since_us = now_us
            flight.streams.start(now_us)

    def _missing(self, flight: FlightT) -> str | None:
        """What stands against a flight with what was measured, or None."""
        if not self._is_answered:
            return "the vehicle answers nothing: does it hear this computer, and want no signatures (--signing-key)?"
        return flight.streams.too_slow(flight.vehicle.autopilot)

    def _ask_again(self, flight: FlightT, text: str, now_us: int) -> None:
        """What is missing may come: a vehicle that has just started has no position."""
        if not self.is_told:
            self.is_told = True
            flight.report(now_us, "link", text)
        self._requests, self._measuring_since_us = iter(self._commands(flight)), None

    def _report_streams(self, flight: FlightT, now_us: int) -> None:
        rates = flight.streams.rates_hz()
        text = ", ".join(f"{name} {rate_hz:.1f}" for name, rate_hz in rates.items())
        window_s = flight.mission.companion.streams.window_s
        flight.report(now_us, "streams", f"streams in Hz over {window_s:g} s: {text}", **rates)


class Connect(Meet[FlightContext]):
    """On the ground, with a vehicle that nobody flies."""

    def _judge(self, flight: FlightContext, now_us: int) -> Transition | None:
        missing, link = self._missing(flight), flight.mission.companion.link
        # A vehicle that has just started sends some of them later.
        may_wait = link.wait or now_us - self._started_us < link.heartbeat_wait_s * 1e6
        if missing is not None and may_wait:
            self._ask_again(flight, f"not ready by now: {missing}", now_us)
            return None
        self._report_streams(flight, now_us)
        complaint = missing or ground_check(flight)
        return Transition(Trigger.VEHICLE_READY) if complaint is None else Transition(Trigger.REFUSED, complaint)


class Ready(Handler[FlightContext]):
    """Show the plan; nothing happens until it is confirmed."""

    is_active = False

    def __init__(self, flight: FlightContext, now_us: int) -> None:
        flight.report(now_us, "plan", f"plan ready: {flight.mission.name}", plan=plan_text(flight))

    def step(self, flight: FlightContext, inputs: Inputs, now_us: int) -> Transition | None:
        if flight.is_silent(now_us) or not flight.plan_confirmed:
            return None
        complaint = ground_check(flight)
        return Transition(Trigger.REFUSED, complaint) if complaint is not None else Transition(Trigger.PLAN_CONFIRMED)


def ground_check(flight: FlightContext) -> str | None:
    """What stands against a start from here, or None."""
    vehicle = flight.vehicle
    if vehicle.armed:
        return "the vehicle is armed already; land and disarm it first"
    if vehicle.landed in (LandedState.IN_AIR, LandedState.TAKEOFF, LandedState.LANDING):
        return "the vehicle says it is not on the ground"
    if flight.mission.abort_when.battery_below_percent is not None and vehicle.battery_percent is None:
        return "the mission ends below a battery level, and the vehicle says none (SYS_STATUS.battery_remaining)"
    return battery_complaint(flight) or flight.round_trip.complaint()
