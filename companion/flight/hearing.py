"""What every step begins with: the vehicle view brought up to date by what was heard."""

from collections.abc import Sequence

from companion.flight.context import FlightContext
from companion.link.identity import identify, is_autopilot
from companion.messages import Heartbeat, Refused, Sample, TimeSyncReply, TimeSyncRequest
from companion.px4_mode import mode_name


def hear(flight: FlightContext, samples: Sequence[Sample], now_us: int) -> str | None:
    """Bring the vehicle view up to date, answer time requests; why the vehicle is refused, or None."""
    vehicle, streams = flight.vehicle, flight.streams
    mode, armed = vehicle.custom_mode, vehicle.armed
    for sample in samples:
        if isinstance(sample, Heartbeat):
            if not is_autopilot(sample):
                continue
            if vehicle.identity is None:
                identity = identify(sample)
                if isinstance(identity, str):
                    return identity
                vehicle.identity = identity
            if sample.system_id != vehicle.identity.system_id:
                continue
        elif isinstance(sample, Refused):
            text = flight.refusals.add(sample, now_us)
            if text is not None:
                flight.tell(now_us, "implausible", text, message=sample.message)
            continue
        elif isinstance(sample, TimeSyncRequest):
            flight.outbox.append(TimeSyncReply(sample.vehicle_time_ns, now_us * 1000))
        vehicle.hear(sample, now_us)
        streams.count(type(sample), now_us)
    if vehicle.custom_mode != mode and vehicle.custom_mode is not None:
        flight.tell(now_us, "mode", f"mode {mode_name(vehicle.custom_mode)}", custom_mode=vehicle.custom_mode)
    if vehicle.armed is False and armed:
        flight.tell(now_us, "disarmed", "disarmed")
    return None
