"""What follows a hit: the mission's policy, acted on when the vehicle has settled, and whether a motor was damaged."""

import math
from collections.abc import Sequence
from dataclasses import replace

from companion.flight.context import BeforeHit, FlightContext, Target, Transition
from companion.flight.states import State, Trigger
from companion.messages import LandedState, MotorOutputs, Sample
from companion.mission.items import GoToItem, OrbitItem, PathItem, ReturnItem, WaitForItem
from companion.mission.policy import OnCollision
from companion.motion.motors import ROTORS, MotorWatch
from companion.reflex.recovery.collision import recoveries_from

# After these the interrupted step is over.
_STEP_LEFT = ("hold", "continue")
# These have somewhere to be, to which there may be another way; of all others nothing is left after a detour's hit.
_WITH_A_GOAL = (GoToItem, PathItem, OrbitItem)


def decide(flight: FlightContext, state: State, now_us: int) -> None:
    """Count the newest hit and decide what follows its recovery. `state`: in which it happened.

    A hit during a recovery, or during the hold after it, belongs to the step in which the first one happened.
    """
    flight.tally.hits += 1
    step = flight.steps[flight.tally.index]
    # An item's own policy ends with it.
    is_over = (flight.going_home or flight.is_landing) and not isinstance(step.action, ReturnItem)
    own = None if is_over else step.item.on_collision
    policy = own or flight.mission.on_collision
    hits = recoveries_from(flight.collisions[-flight.tally.hits :] if own else flight.collisions)
    then, reason = _verdict(flight, policy, hits, own)
    if then == "retry" and state in (State.TAKEOFF, State.MISSION):
        flight.tally.pace_factor *= policy.retry_speed_factor
    flight.after_recovery = Transition(Trigger(f"settled, then: {then}"), reason)
    # What an interrupted flight resumes with.
    is_met = isinstance(step.action, WaitForItem) and step.action.hit is True
    is_left = is_met or then in _STEP_LEFT or (then == "detour" and not isinstance(step.action, _WITH_A_GOAL))
    flight.step_index = flight.tally.index + (1 if is_left else 0)
    if reason:
        flight.report(now_us, "policy", f"{reason}; after the recovery: {then}", then=then)


def _verdict(flight: FlightContext, policy: OnCollision, hits: int, own: OnCollision | None) -> tuple[str, str]:
    """What follows, and the reason where that is not the policy's `then`; `own`: the step's, where it has one."""
    limit_m_s = flight.mission.abort_when.hit_above_m_s
    speed_m_s = math.hypot(*flight.collisions[-1].contact.velocity_ned_m_s)
    if limit_m_s is not None and speed_m_s > limit_m_s and not flight.is_landing:
        return "abort", f"hit at {speed_m_s:.2f} m/s, above abort_when.hit_above_m_s = {limit_m_s:g}"
    if hits >= policy.max_hits:
        # With obstacles on the way home the vehicle lands.
        then = "land" if flight.going_home or flight.is_landing else policy.after_max_hits
        return then, f"recovery {hits} of at most {policy.max_hits}"
    if flight.is_landing:
        return "land", ""
    goes_on = flight.going_home and (own is None or own.then != "land")
    return "return" if goes_on else policy.then, ""


def lands_anyway(flight: FlightContext) -> bool:
    """Whether so many hits have been met that a landing is not interrupted for another one."""
    return flight.is_landing and recoveries_from(flight.collisions) >= flight.mission.on_collision.max_hits


def note_before(flight: FlightContext, way_back: Transition | None) -> None:
    """Save what a hit changes, and by what the flight goes on if it was none. Within a recovery nothing is restored."""
    flight.before_hit = None
    if way_back is not None:
        flight.before_hit = BeforeHit(way_back, flight.step_index, replace(flight.tally), flight.after_recovery)


def take_back(flight: FlightContext, now_us: int) -> Transition | None:
    """Remove the rejected newest hit, and go on with what it interrupted; None within another hit's recovery."""
    before = flight.before_hit
    if before is None:
        return None
    flight.reflex.take_back()
    flight.unconfirmed += 1
    text = "not a hit: one message showed it, and nothing else did; going on"
    flight.report(now_us, "unconfirmed", text, count=flight.unconfirmed)
    flight.tally = before.tally
    flight.step_index = before.step_index
    flight.after_recovery = before.after_recovery
    flight.target = Target(flight.latest.position_ned_m, flight.yaw_rad)
    return before.way_back


def note_motors(flight: FlightContext, samples: Sequence[Sample], now_us: int) -> None:
    """What the motors are asked for, before the first hit and after each recovery."""
    vehicle = flight.vehicle
    if not vehicle.armed:
        flight.motors = MotorWatch(len(flight.collisions))
        return
    rotors = 0 if vehicle.identity is None else ROTORS.get(vehicle.identity.vehicle_type, 0)
    hits = len(flight.hits)
    flies = flight.has_climbed and vehicle.landed in (LandedState.IN_AIR, LandedState.LANDING)
    was_hit = hits > 0 if flies and (hits == 0 or _is_free(flight)) else None
    for sample in samples:
        if not rotors or not isinstance(sample, MotorOutputs) or len(sample.outputs) < rotors:
            continue
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
