"""What every step begins with: the vehicle as it was heard, and whether it is off the ground."""

from collections.abc import Sequence

from companion import messages
from companion.flight.context import FlightContext
from companion.flight.envelope import LOSS_PARAMETER, longer_loss_text
from companion.link.refusals import LASTING_US
from companion.link.vehicle import identify, is_autopilot
from companion.messages import Sample
from companion.px4_mode import mode_name
from companion.reflex.config import HELD_S


def hear(flight: FlightContext, samples: Sequence[Sample], now_us: int) -> str | None:
    """Bring the vehicle view up to date, ask and answer for the time; why the vehicle is refused, or None."""
    vehicle, streams = flight.vehicle, flight.streams
    mode, armed, conflicts = vehicle.custom_mode, vehicle.armed, vehicle.conflicts
    vehicle.note_silence(now_us)
    own_modes = flight.own_modes
    for sample in samples:
        if isinstance(sample, messages.Heartbeat):
            if not is_autopilot(sample):
                continue
            if vehicle.identity is None:
                identity = identify(sample)
                if isinstance(identity, str):
                    return identity
                vehicle.identity = identity
            if sample.system_id != vehicle.identity.system_id:
                continue
            if identify(sample) != vehicle.identity:
                # Another vehicle under its name: nothing that it says counts.
                vehicle.conflicts += 1
                continue
        elif isinstance(sample, messages.Refused):
            text = flight.refusals.add(sample, now_us)
            if text is not None:
                flight.tell(now_us, "implausible", text, message=sample.message)
            continue
        elif isinstance(sample, messages.Parameter) and sample.name == LOSS_PARAMETER:
            if flight.loss_s is None and sample.value > HELD_S:
                flight.tell(now_us, "unattended", longer_loss_text(sample.value), loss_s=sample.value)
            flight.loss_s = sample.value
        elif isinstance(sample, messages.TimeSyncRequest):
            flight.outbox.append(messages.TimeSyncReply(sample.vehicle_time_ns, now_us * 1000))
        elif isinstance(sample, messages.TimeSyncAnswer):
            flight.round_trip.hear(sample, now_us)
        vehicle.hear(sample, now_us, own_modes)
        streams.count(type(sample), now_us)
    _let_ways_go_on(flight, now_us)
    if vehicle.conflicts > conflicts:
        _tell_conflict(flight, now_us)
    if vehicle.custom_mode != mode and vehicle.custom_mode is not None:
        flight.tell(now_us, "mode", f"mode {mode_name(vehicle.custom_mode)}", custom_mode=vehicle.custom_mode)
    if vehicle.armed is False and armed:
        flight.tell(now_us, "disarmed", "disarmed")
    if vehicle.identity is not None:
        _measure_round_trip(flight, now_us)
    return None


def _let_ways_go_on(flight: FlightContext, now_us: int) -> None:
    """After a silence, or a step that came as late, a way goes on where it was: nothing is caught up with."""
    before_us, heard_us = flight.stepped_us, flight.vehicle.last_position_us
    flight.stepped_us = now_us
    longest_us = flight.mission.companion.sight.silence_s * 1e6
    late_us = 0 if before_us is None else max(0, now_us - before_us - round(longest_us))
    flight.unheard_us = 0 if heard_us == now_us else flight.unheard_us + late_us
    flight.is_heard = heard_us is not None and now_us - heard_us <= longest_us
    if before_us is not None and flight.is_heard and now_us - before_us <= longest_us:
        flight.way_us += now_us - before_us


def _measure_round_trip(flight: FlightContext, now_us: int) -> None:
    """On the ground too long a one is a reason not to begin; in the air it is told. COM_OF_LOSS_T is asked for beside
    it until it comes.
    """
    asked = flight.round_trip.ask(now_us)
    if asked is None:
        return
    flight.outbox.append(asked)
    if flight.loss_s is None:
        flight.outbox.append(messages.ReadParameter(LOSS_PARAMETER))
    text = flight.round_trip.alarm() if flight.vehicle.armed else None
    if text is not None:
        flight.tell(now_us, "round_trip", text, round_trip_us=flight.round_trip.present_us)


def _tell_conflict(flight: FlightContext, now_us: int) -> None:
    """Once a run: a sender that goes on contradicting the vehicle is no news."""
    last_us, flight.conflict_us = flight.conflict_us, now_us
    if last_us is None or now_us - last_us >= LASTING_US:
        count = flight.vehicle.conflicts
        flight.tell(now_us, "implausible", "conflicting mode reports: one was not confirmed", conflicts=count)


# A vehicle that has come down lower than this, and was not told to, drags itself along the ground: nothing of that is a
# hit to recover from. Its feet are a tenth of a metre below it, and where it leans they are not what touches.
SCRAPING_M = 0.1


def note_height(flight: FlightContext) -> None:
    """Whether the vehicle has left the ground behind; a hit that throws it down again does not bring that back."""
    height_m = flight.height_m
    if height_m is not None and height_m >= flight.mission.companion.min_detection_height_m:
        flight.has_climbed = True
    elif height_m is None or flight.vehicle.landed is messages.LandedState.ON_GROUND:
        flight.has_climbed = False


def landed(flight: FlightContext, goes_down: bool) -> messages.LandedState:
    """What the vehicle says of the ground. Up by its own height, and not on its way down, it has not landed.

    Who says so may have forged it, and a detector is off on the ground.
    """
    is_up = flight.has_climbed and not goes_down and flight.vehicle.landed is messages.LandedState.ON_GROUND
    return messages.LandedState.UNDEFINED if is_up else flight.vehicle.landed


def too_low(flight: FlightContext, goes_down: bool) -> str | None:
    """Why the height stands against a hit, or None. `goes_down`: the vehicle is to meet the ground."""
    least_m, height_m = flight.mission.companion.min_detection_height_m, flight.height_m
    if flight.has_climbed and not goes_down:
        least_m = min(least_m, SCRAPING_M)
    return f"below {least_m:g} m" if height_m is None or height_m < least_m else None
