"""The flight's part of the obstacle map: what its hits add, for trajectories and for recoveries."""

from collections.abc import Sequence
from dataclasses import replace

from companion.flight.context import FlightContext
from companion.flight.envelope import KnownSurface
from companion.memory.patch import Patch, is_same, touch_of
from companion.memory.stored import as_data, describe
from companion.memory.surroundings import LEAST_FREE_M, ObstacleMap
from companion.messages import Vector3
from companion.motion.vector import minus, plus
from companion.reflex.surface import Contact, Normal, Surface


def remember(flight: FlightContext, hits: int, now_us: int) -> None:
    """Add the first `hits` hits, by their newest estimates; report new patches."""
    before, flight.known = flight.known.patches, _with_hits(flight, hits)
    for patch in flight.known.patches:
        if patch not in before:
            flight.report(now_us, "obstacle", f"remembered: {describe(patch)}", **as_data(patch))


def all_known(flight: FlightContext) -> ObstacleMap:
    """With the hit of the present recovery: the map to keep if the program ends now."""
    return _with_hits(flight, len(flight.collisions))


def surroundings(flight: FlightContext) -> ObstacleMap:
    """The obstacles that the flight plans its trajectories around.

    An item that is tried again shall meet what stopped it: that hit is left out, and nothing else.
    """
    return _with_hits(flight, len(flight.collisions) - flight.tally.hits) if flight.is_retry else flight.known


class FlightRoom:
    """What a flight knows of the space around; local NED."""

    def __init__(self, flight: FlightContext) -> None:
        self._flight = flight

    def surfaces(self, contact: Contact) -> Sequence[Surface]:
        """What is known in front of a vehicle that has just been hit, besides what hit it.

        Of each patch what counts is where the vehicle's centre would touch it, and that the margin is kept.
        """
        flight, known = self._flight, self._flight.known
        if not known.patches:
            return []
        place, clearance_m = flight.mission_ned_m(contact.position_ned_m), known.clearance_m
        normal = Normal(contact.normal_ned, contact.normal_error_rad)
        touch = touch_of(place, contact.velocity_ned_m_s, normal, known.reach_m, 0)
        return [
            Surface(_touching_ned_m(flight, patch), patch.normal_ned, known.margin_m)
            for patch in known.patches
            if patch.faces(place, clearance_m) and not (touch is not None and is_same(patch, touch, clearance_m))
        ]

    def inside(self, contact_ned_m: Vector3, goal_ned_m: Vector3) -> Vector3:
        """The goal inside the fence: where the line from the contact leaves it; the nearest for a contact outside."""
        fence, origin = self._flight.mission.fence, self._flight.origin_ned_m
        assert origin is not None, "hits are detected only in flight"
        (start_n, start_e, _), (end_n, end_e, end_d) = (minus(place, origin) for place in (contact_ned_m, goal_ned_m))
        n, e = fence.nearest_inside(end_n, end_e)
        if fence.contains(start_n, start_e):
            n, e = fence.shortened((start_n, start_e), (end_n, end_e))
        return plus((n, e, min(max(end_d, -fence.max_height_m), -fence.min_height_m)), 1.0, origin)


def known_surfaces(flight: FlightContext) -> list[KnownSurface]:
    """Surfaces that a setpoint must not lead into: those hit in this recovery, and the obstacle map."""
    known = []
    for record in flight.reflex.in_one_recovery():
        # As it is known now: the first sample's normal was 51 degrees wrong on a real PX4.
        surface = replace(record.surfaces[0], distance_m=LEAST_FREE_M)
        # A surface that the recovery setpoint lies behind does not count: the vehicle has slid past it.
        if surface.off_m(record.setpoint_ned_m) > 0.0:
            known.append(KnownSurface(surface))
    if flight.known.patches and flight.origin_ned_m is not None:
        for patch in surroundings(flight).patches:
            surface = Surface(_touching_ned_m(flight, patch), patch.normal_ned, LEAST_FREE_M)
            known.append(KnownSurface(surface, patch, flight.origin_ned_m, flight.known.reach_m))
    return known


def _touching_ned_m(flight: FlightContext, patch: Patch) -> Vector3:
    """Where the vehicle's centre is when it touches the middle of a patch; local NED."""
    return flight.local_ned_m(plus(patch.centre_ned_m, flight.known.reach_m, patch.normal_ned))


def _with_hits(flight: FlightContext, hits: int) -> ObstacleMap:
    mission, touches = flight.mission, []
    for record in flight.collisions[:hits]:
        if record.source is not flight.reflex.monitor.estimator:
            continue  # the vehicle has restarted since: its local frame may be another
        centre, velocity = flight.mission_ned_m(record.contact.position_ned_m), record.contact.velocity_ned_m_s
        touch = touch_of(centre, velocity, record.normal, flight.known.reach_m, record.detected_at_us)
        touches += [] if touch is None else [touch]
    return mission.known.joined(touches)
