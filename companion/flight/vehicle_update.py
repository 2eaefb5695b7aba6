"""What every step begins with: the vehicle's state from its messages, and whether it is off the ground."""

from collections.abc import Sequence

from companion import messages
from companion.autopilot.interface import Pilot
from companion.flight.context import FlightContext
from companion.flight.envelope import longer_loss_text
from companion.link.vehicle import OLD_NEWS_US, Vehicle, identify, is_autopilot
from companion.messages import MessageId, Sample
from companion.reflex.config import HELD_S, LEAST_THRUST, LIES_US, LONGEST_LOSS_S
from companion.reflex.detection.detector import NO_POSITION, Situation


def update_vehicle(flight: FlightContext, samples: Sequence[Sample], now_us: int) -> str | None:
    """Update the vehicle's state and the time synchronisation; returns why the vehicle is refused, or None."""
    vehicle, streams, heard_us = flight.vehicle, flight.streams, flight.vehicle.last_received_us
    mode, armed, is_mode_lost = vehicle.mode, vehicle.armed, False
    if vehicle.identity is not None and now_us - vehicle.last_received_us >= OLD_NEWS_US:
        is_mode_lost = vehicle.is_mode_known
        vehicle.unsure_since_us = now_us  # after a silence samples may be as old as the silence
    for sample in samples:
        if isinstance(sample, messages.ImuSample):
            # The most frequent of all: nothing of it is kept here.
            vehicle.last_received_us = now_us
            streams.count(messages.ImuSample, now_us)
            continue
        if isinstance(sample, messages.Heartbeat):
            if not is_autopilot(sample):
                continue
            if vehicle.identity is None:
                identity = identify(sample)
                if isinstance(identity, str):
                    return identity
                vehicle.identity, vehicle.autopilot = identity, identity.autopilot
                flight.reflex.monitor.estimator.hides_clipping = identity.autopilot.filters_imu
                flight.reflex.keeps_trim = identity.autopilot.keeps_trim
            if identify(sample) != vehicle.identity:
                # Another vehicle's, be it with the same system ID, do not count.
                continue
        elif isinstance(sample, messages.Refused):
            if flight.refusals.add(sample.message, now_us):
                text = f"{sample.message} is not accepted: {sample.reason}"
                flight.report(now_us, "implausible", text, message=sample.message)
            continue
        elif isinstance(sample, messages.StatusText) and sample.text != vehicle.said:
            vehicle.said = sample.text
            flight.report(now_us, "warning", f"the vehicle warns: {sample.text}")
        elif isinstance(sample, messages.Parameter) and sample.name in vehicle.autopilot.attitude_parameters:
            _note_attitude_parameter(flight, sample, now_us)
        elif isinstance(sample, messages.TimeSync):
            if sample.answered_ns is None:
                flight.outbox.append(messages.TimeSync(sample.asked_ns, now_us * 1000))
            else:
                flight.round_trip.update(sample, now_us)
        was_known = vehicle.is_mode_known
        vehicle.update(sample, now_us, flight.own_modes)
        if type(sample) in _FLYING:
            flight.flies = _flies(vehicle)
        is_mode_lost |= was_known and not vehicle.is_mode_known
        streams.count(type(sample), now_us)
    _advance_trajectory_time(flight, heard_us, now_us)
    if vehicle.mode is not None and (mode is None or vehicle.mode.custom_mode != mode.custom_mode):
        flight.report(now_us, "mode", f"mode {vehicle.mode_name}", custom_mode=vehicle.custom_mode)
    if vehicle.armed is False and armed:
        flight.report(now_us, "disarmed", "disarmed")
    if is_mode_lost and not vehicle.is_mode_known:
        # PX4 answers within milliseconds; its next report by itself may take half a second.
        flight.outbox.append(messages.SendCommand(messages.request_message(MessageId.HEARTBEAT), 0))
    if vehicle.identity is not None and now_us >= flight.round_trip.due_us:
        _measure_round_trip(flight, now_us)
    return None


def _advance_trajectory_time(flight: FlightContext, heard_us: int, now_us: int) -> None:
    """After a silence or a late step a trajectory goes on where it was. It does not catch up. `heard_us`: when the
    vehicle was heard last before this step."""
    before_us, position_us = flight.stepped_us, flight.vehicle.last_position_us
    flight.stepped_us = now_us
    longest_us = round(flight.mission.companion.sight.silence_s * 1e6)
    elapsed_us = 0 if before_us is None else now_us - before_us
    is_late = elapsed_us > longest_us
    if position_us == now_us:
        flight.missed_us = 0
    elif is_late or (flight.vehicle.last_received_us == now_us and now_us - heard_us > longest_us):
        # Nor does a link say anything of positions on which nothing came.
        flight.missed_us += max(elapsed_us, now_us - heard_us) - longest_us
    flight.has_position = position_us is not None and now_us - position_us <= longest_us
    if flight.has_position and not is_late:
        flight.trajectory_us += elapsed_us


def _measure_round_trip(flight: FlightContext, now_us: int) -> None:
    """A long one is a reason not to begin on the ground; in the air it is reported."""
    flight.outbox.append(flight.round_trip.ask(now_us))
    if flight.reflex.loss_s is None:  # for how long the last setpoint is flown on
        autopilot, told = flight.vehicle.autopilot, flight.vehicle.attitude_parameters
        flight.outbox += [messages.ReadParameter(name) for name in autopilot.attitude_parameters if name not in told]
    text = flight.round_trip.alarm() if flight.vehicle.armed else None
    if text is not None:
        flight.report(now_us, "round_trip", text, round_trip_us=flight.round_trip.present_us)


def _note_attitude_parameter(flight: FlightContext, told: messages.Parameter, now_us: int) -> None:
    """For how long an attitude is flown on, once all is told that it follows from."""
    autopilot, parameters = flight.vehicle.autopilot, flight.vehicle.attitude_parameters
    if told.name == autopilot.loss_parameter and not 0.0 <= told.value <= LONGEST_LOSS_S:
        flight.refusals.add("PARAM_VALUE", now_us)
        return
    parameters[told.name] = told.value
    if told.name == autopilot.loss_parameter and flight.reflex.loss_s is None and told.value > HELD_S:
        flight.report(now_us, "unattended", longer_loss_text(autopilot, told.value), loss_s=told.value)
    if all(name in parameters for name in autopilot.attitude_parameters):
        flight.reflex.loss_s = round(autopilot.attitude_held_s(parameters), 3)  # single precision on the wire


def note_height(flight: FlightContext) -> None:
    """Note the height, whether it flies, and whether it has left the ground: a hit that pushes it down undoes none."""
    vehicle, origin = flight.vehicle, flight.origin_ned_m
    latest, heard_us, height_m = vehicle.history.latest, vehicle.last_position_us, None
    # A vehicle whose estimator fails sends no position, and other messages.
    is_current = heard_us is not None and vehicle.last_received_us - heard_us < OLD_NEWS_US
    if latest is not None and origin is not None and is_current:
        height_m = origin[2] - latest.position_ned_m[2]
    flight.height_m = height_m
    if height_m is not None and height_m >= flight.mission.companion.min_detection_height_m:
        flight.has_climbed = True
    elif height_m is None or vehicle.stands:
        flight.has_climbed = False
    if flight.flies and not flight.is_wreck:
        flight.flew_us = flight.stepped_us
    stepped_us, flew_us = flight.stepped_us, flight.flew_us
    flight.may_crash = stepped_us is not None and flew_us is not None and stepped_us - flew_us < LIES_US


# What tells whether it flies.
_FLYING = frozenset((messages.Heartbeat, messages.ExtendedState, messages.AttitudeTarget))


def _flies(vehicle: Vehicle) -> bool:
    """Whether it is armed, and off the ground or about to be: not one that is carried while its motors idle."""
    if vehicle.thrust_fraction is None or vehicle.landed > messages.LandedState.ON_GROUND:
        return vehicle.is_airborne
    return vehicle.armed is True and vehicle.thrust_fraction >= LEAST_THRUST


def situation_of(flight: FlightContext, off_state: str | None, goes_down: bool, is_held: bool) -> Situation:
    """The detector's situation; `is_held`: the vehicle flies by this program's setpoints. Those of others are unknown.

    A held vehicle that has climbed, and is not sent down, has not landed: the report may be forged, and a detector is
    off on the ground.
    """
    is_aloft = is_held and flight.has_climbed and not goes_down
    target = flight.target if is_held else None
    place = None if target is None or target.lean is not None else target.position_ned_m
    height_m, least_m = flight.height_m, flight.mission.companion.min_detection_height_m
    if off_state is None and not flight.has_climbed:
        # Lift-off, ground effect and skids shake and push.
        off_state = NO_POSITION if height_m is None else f"below {least_m:g} m"
    return Situation(
        off_reason=off_state,
        may_crash=flight.may_crash,
        is_on_ground=flight.vehicle.landed is messages.LandedState.ON_GROUND and not is_aloft,
        height_m=height_m,
        descent_commanded=goes_down,
        setpoint_position_ned_m=place,
        flown_by_hand=flight.vehicle.pilot in (Pilot.STICKS, Pilot.HAND),
        has_climbed=flight.has_climbed,
        has_position=flight.has_position,
        is_wreck=flight.is_wreck,
    )
