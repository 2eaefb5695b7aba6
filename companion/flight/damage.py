"""Detection of a motor damaged by a hit."""

import math
from collections.abc import Sequence

from companion.flight.context import FlightContext
from companion.messages import LandedState, MotorOutputs, Sample
from companion.motion.motors import ROTORS, MotorWatch


def note_motors(flight: FlightContext, samples: Sequence[Sample], now_us: int) -> None:
    """What the motors are asked for, before the first hit and after each recovery."""
    vehicle = flight.vehicle
    if not vehicle.armed:
        flight.motors = MotorWatch(len(flight.collisions))
        return
    rotors = 0 if vehicle.identity is None else ROTORS.get(vehicle.identity.vehicle_type, 0)
    if not rotors:
        return
    hits = len(flight.hits)
    flies = flight.has_climbed and vehicle.landed in (LandedState.IN_AIR, LandedState.LANDING)
    was_hit = hits > 0 if flies and (hits == 0 or _is_free(flight)) else None
    for sample in samples:
        if isinstance(sample, MotorOutputs) and len(sample.outputs) >= rotors:
            damage = flight.motors.take(sample.outputs[:rotors], was_hit, now_us)
            if damage is not None:
                data = {"motor": damage.motor, "harder": round(damage.harder, 3), "confidence": damage.confidence}
                wanted = flight.mission.on_damage
                flight.report(now_us, "damage", damage.text + ("" if wanted == "tell" else f"; then: {wanted}"), **data)


def _is_free(flight: FlightContext) -> bool:
    """Whether it has rested since the hit, or flown off. A vehicle that has not may hang on the obstacle, or lie on the
    ground: that also loads a motor more. One that has lost a motor rests badly, and flies all the same.
    """
    record = flight.collisions[-1]
    away_m = math.dist(flight.latest.position_ned_m, record.contact.position_ned_m)
    return record.settled_after_s is not None or (record.is_over and away_m > flight.mission.recovery.clearance_m)
