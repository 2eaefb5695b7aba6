"""Whether a flight made use of what it knew: no surface hit twice, no goal given up that lies in the open."""

from collections.abc import Iterator, Sequence

import numpy as np
import numpy.typing as npt

from bench.fly.lockstep import JudgedFlight
from bench.rows.contacts import JudgedContact, Role, same_surface
from bench.rows.phases import MissionPhase
from companion.mission.items import GoToItem, program
from companion.report import Event
from sim_vehicle.truth import Hit

Floats = npt.NDArray[np.float64]

# The middle of a patch of 0.5 m: whatever is made of a hit, this much of the surface is known after it.
KNOWN_M = 0.3
# A hit slower than this is no surface that is remembered as more than a place.
REMEMBERED_M_S = 0.5
# Further from everything than a patch is wide, with guards and margin: nothing known can stand in such a way.
OPEN_M = 1.5
# A straight way is looked at so often, and the vehicle's path so far.
_LOOKS = 50


def repeated(flight: JudgedFlight, contacts: Sequence[JudgedContact]) -> Iterator[str]:
    """Hits on a place that an earlier hit had shown, on a way that ought to have kept off it."""
    answered: list[JudgedContact] = []
    for contact in contacts:
        if contact.role is not Role.HIT or contact.hit.contact_point_ned_m is None:
            continue
        if _keeps_off(flight, contact) and any(_is_known(contact, earlier) for earlier in answered):
            at = flight.at(contact.hit.contact_at_boot_us)
            yield f"{contact.hit.obstacle} again at {contact.speed_m_s:.2f} m/s {at}"
        is_still = contact.hit.obstacle in flight.obstacles and flight.obstacles[contact.hit.obstacle].motion is None
        if contact.collision is not None and contact.closing_m_s >= REMEMBERED_M_S and is_still:
            answered.append(contact)


def _keeps_off(flight: JudgedFlight, contact: JudgedContact) -> bool:
    """A second try is meant to meet what stopped the first, a velocity is flown as it is."""
    if contact.phase is MissionPhase.RETURNING:
        return True
    before = [event for event in flight.events if flight.boot_us(event) <= contact.hit.contact_at_boot_us]
    index = next((int(str(event.data["step"])) for event in reversed(before) if event.kind == "item"), None)
    if contact.phase is not MissionPhase.ITEM or index is None:
        return False
    item = program(flight.mission.items)[index].item
    policy = item.on_collision or flight.mission.on_collision
    return item.name in ("go_to", "path", "orbit") and policy.then != "retry"


def _is_known(contact: JudgedContact, earlier: JudgedContact) -> bool:
    """By where the vehicle takes the places to be: one that has lost its position by a metre cannot keep off them."""
    here, there = (_believed(touch.hit) for touch in (contact, earlier))
    return same_surface(contact.hit, earlier.hit) and float(np.linalg.norm(here - there)) <= KNOWN_M


def _believed(hit: Hit) -> Floats:
    """Where the vehicle was touched, in its own frame at that time."""
    assert hit.contact_point_ned_m is not None, "only such contacts are looked at"
    place: Floats = np.add(hit.contact_point_ned_m, hit.frame_offset_ned_m)
    return place


def given_up(flight: JudgedFlight) -> Iterator[str]:
    """Places called out of reach to which the straight way was wide open."""
    steps, index = program(flight.mission.items), 0
    for event in flight.events:
        if event.kind == "item":
            index = int(str(event.data["step"]))
        if event.kind != "unreachable":
            continue
        action = steps[index].action
        goal = action.position_ned_m if isinstance(action, GoToItem) and "then" in event.data else None
        if goal is not None and _is_open(flight, event, goal):
            yield f"item {steps[index].label} {flight.at(flight.boot_us(event))}"


def _is_open(flight: JudgedFlight, event: Event, goal_ned_m: Sequence[float]) -> bool:
    start = flight.truth.series["position_ned_m"][flight.row_at(flight.boot_us(event))]
    goal = np.array(goal_ned_m) + np.array(flight.start_ned_m) - [0.0, 0.0, flight.standing_m]
    places = [start + share * (goal - start) for share in np.linspace(0.0, 1.0, _LOOKS)]
    still = [obstacle for obstacle in flight.obstacles.values() if obstacle.motion is None]
    return all(obstacle.distance_m((float(n), float(e), float(d))) > OPEN_M for obstacle in still for n, e, d in places)
