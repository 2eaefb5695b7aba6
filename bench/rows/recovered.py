"""Figures of every recovery of a flight, by the simulator's truth. SI units."""

from collections.abc import Sequence
from itertools import pairwise

import numpy as np
import numpy.typing as npt

from bench.fly.campaign import Json
from bench.fly.lockstep import JudgedFlight
from bench.rows.contacts import JudgedContact, Role, phases_of
from companion.reflex.recovery.collision import CollisionReport
from companion.reflex.surface import away_from
from rebound_cli.results.summary import LONGEST_RECOVERY_S
from sim_vehicle.truth import Hit
from sim_vehicle.world import distance_m

Floats = npt.NDArray[np.float64]

# A vehicle that leaves a surface does not come nearer again by this; else a touch is another guard swinging in.
CAME_BACK_M = 0.02
# Nor does one that is still on its way in, from one guard to the next, before anything sent can have turned it.
UNANSWERED_US = 100_000
MOVED_M = 1e-3
# A vehicle at rest moves by a millimetre in so many rows of truth.
_LOOK_EVERY = 10
_DIGITS = 4
# Of a hit that nobody answered.
UNANSWERED: Json = dict.fromkeys(("settled_s", "past_m", "lost_m"))


def recoveries(flight: JudgedFlight, contacts: Sequence[JudgedContact]) -> list[Json]:
    """One for each hit, with what it touched until it had recovered; landings are none."""
    episodes: list[list[JudgedContact]] = []
    for contact in contacts:
        if contact.role is Role.HIT:
            episodes.append([contact])
        elif contact.role is not Role.LANDING and episodes:
            episodes[-1].append(contact)
    return [_figures(flight, episode) for episode in episodes]


def _figures(flight: JudgedFlight, episode: Sequence[JudgedContact]) -> Json:
    first = episode[0]
    normal = first.hit.normal_ned
    found: Json = {
        "obstacle": first.hit.obstacle,
        "kind": first.hit.kind,
        "phase": first.phase.value,
        "speed_m_s": round(first.speed_m_s, _DIGITS),
        "closing_m_s": round(first.closing_m_s, _DIGITS),
        "climbing_m_s": round(-first.hit.impact_velocity_ned_m_s[2], _DIGITS),
        "steepness": round(normal[2], _DIGITS),
        "seen": first.collision is not None,
        "again": sum(contact.role is Role.AGAIN for contact in episode),
        "others": sum(contact.role is Role.NEXT for contact in episode),
        "returned": sum(_returned(flight, first, before, touch) for before, touch in pairwise(episode)),
    }
    seen = [contact for contact in episode if contact.collision is not None]
    return found | (_recovery(flight, seen[-1]) if seen else UNANSWERED)


def _recovery(flight: JudgedFlight, contact: JudgedContact) -> Json:
    """After the last hit of an episode that was seen, to the setpoint that is flown to in the end."""
    hit, series = contact.hit, flight.truth.series
    collision, ended_us = _last_of_recovery(flight, contact)
    since_s = 1e-6 * (series["time_boot_us"] - hit.contact_at_boot_us)
    settled_s = collision.settled_after_s
    if settled_s is not None:
        settled_s += 1e-6 * (collision.sample_time_boot_us - hit.contact_at_boot_us)
    until_s = LONGEST_RECOVERY_S if settled_s is None else settled_s + flight.mission.companion.settled.duration_s
    # A recovery that was given up, or that the mission's end cut short, is over when something else begins.
    if ended_us is not None:
        until_s = min(until_s, 1e-6 * (ended_us - hit.contact_at_boot_us))
    during = (since_s >= 0.0) & (since_s <= until_s)
    past_m = _past_m(hit, collision, series["position_ned_m"][during])
    down_m = series["position_ned_m"][during, 2]
    # From the contact to the setpoint, which lies below a ceiling and above a floor, height is wanted.
    bottom_m = hit.contact_position_ned_m[2]
    if away_from(hit.normal_ned)[2] != 0.0:
        bottom_m = max(bottom_m, collision.recovery_setpoint_ned_m[2] - hit.frame_offset_ned_m[2])
    return {
        "settled_s": None if settled_s is None else round(settled_s, _DIGITS),
        "past_m": round(past_m, _DIGITS),
        "lost_m": round(max(0.0, float(down_m.max(initial=bottom_m)) - bottom_m), _DIGITS),
    }


def _past_m(hit: Hit, collision: CollisionReport, positions_ned_m: Floats) -> float:
    """Furthest beyond the setpoint, in the direction in which it lies from the contact; level where the height is held.

    Behind what it has slid past, a vehicle recovers to the other side of the surface that it touched. The setpoint's
    place is where the vehicle's own frame was at the contact.
    """
    place_ned_m = np.array(collision.recovery_setpoint_ned_m) - np.array(hit.frame_offset_ned_m)
    way, normal = place_ned_m - np.array(hit.contact_position_ned_m), np.array(hit.normal_ned)
    if away_from(hit.normal_ned)[2] == 0.0:
        way[2] = 0.0
    length_m = float(np.linalg.norm(way))
    direction = way / length_m if length_m > 0.0 else normal
    return max(0.0, float(((positions_ned_m - place_ned_m) @ direction).max(initial=0.0)))


def _last_of_recovery(flight: JudgedFlight, contact: JudgedContact) -> tuple[CollisionReport, float | None]:
    """What the companion told last in the recovery from a contact, and the boot time at which that was over.

    Of a contact that goes on, from one wall of a corner to the other, it can tell more than once.
    """
    assert contact.collision is not None
    epoch_us, collisions = flight.truth.epoch_at_boot_us, flight.report.collisions[contact.collision :]
    ended_us = phases_of(flight.events, epoch_us).end_of(collisions[0].detected_at_us - epoch_us + 1.0)
    told = [c for c in collisions if ended_us is None or c.detected_at_us - epoch_us < ended_us]
    return told[-1], ended_us


def _returned(flight: JudgedFlight, first: JudgedContact, before: JudgedContact, touch: JudgedContact) -> bool:
    """Whether the centre had come back to a surface that is touched again; one that goes from corner to corner has."""
    if touch.role is not Role.AGAIN:
        return False
    time_us, obstacle = flight.truth.series["time_boot_us"], flight.obstacles.get(touch.hit.obstacle)
    between = np.flatnonzero((time_us >= before.hit.ended_at_boot_us) & (time_us <= touch.hit.contact_at_boot_us))
    if obstacle is None or len(between) == 0:
        return False
    rows = [*between[::_LOOK_EVERY], between[-1]]
    off_m = [distance_m(obstacle, flight.truth.series["position_ned_m"][row], 1e-6 * time_us[row]) for row in rows]
    has_left = max(off_m) - off_m[0] > MOVED_M
    is_answered = touch.hit.contact_at_boot_us - first.hit.contact_at_boot_us > UNANSWERED_US
    return (has_left or is_answered) and max(off_m) - off_m[-1] > CAME_BACK_M
