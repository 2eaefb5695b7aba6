"""Whether a flight ended as its mission says, by what really happened, and made use of what it knew."""

from collections.abc import Iterator, Sequence
from itertools import pairwise

import numpy as np
import numpy.typing as npt

from bench.cases.missions import MissionCase, flyable, random_mission
from bench.fly.campaign import Json
from bench.fly.lockstep import NOTICED_M_S, JudgedFlight, fly
from bench.rows.contacts import JudgedContact, MissionPhase, Role, contacts_of, crashes, same_surface, without_contact
from bench.rows.recovered import recoveries
from companion.mission.items import GoToItem, PathItem, TakeoffItem, program
from companion.report import Event
from sim_vehicle.truth import Hit

Floats = npt.NDArray[np.float64]

# The companion counts a goal as reached within 0.5 m of its estimate, which has drifted by up to half as much.
REACHED_M = 0.75
# Home is reached within 0.5 m of the estimate; wind, landing and drift add as much.
HOME_M = 1.0
# From where it was told to land to where it stands: gusts, and a glancing wall on the way down.
LANDED_BESIDE_M = 1.0
# While it holds, apart from being pushed.
HELD_M = 0.5


def failures(flight: JudgedFlight) -> list[tuple[str, str]]:
    """The cause that it is counted by, and details, the gravest first; empty where it ended as the mission says."""
    contacts = contacts_of(flight)
    others = {
        "not as the mission says": _ending(flight),
        "not where the mission says": _places(flight, contacts),
        "flew into a known surface": repeated(flight, contacts),
        "gave up a goal in the open": given_up(flight),
    }
    found = [*crashes(flight), *_noticing(flight, contacts)]
    return found + [(cause, text) for cause, texts in others.items() for text in texts]


def _ending(flight: JudgedFlight) -> Iterator[str]:
    """An end that no policy of the mission asks for."""
    mission, report = flight.mission, flight.report
    policies = [mission.on_collision, *(step.item.on_collision for step in program(mission.items))]
    asked: set[str] = {policy.after_max_hits for policy in policies if policy is not None}
    asked.add(mission.obstacles.on_unreachable)
    if report.outcome != "completed" and not (report.outcome == "aborted" and "abort" in asked):
        yield f"{report.outcome}: {report.reason}"


def _noticing(flight: JudgedFlight, contacts: Sequence[JudgedContact]) -> Iterator[tuple[str, str]]:
    for contact in contacts:
        if contact.role is Role.HIT and contact.collision is None and contact.closing_m_s >= NOTICED_M_S:
            text = f"{contact.hit.obstacle} at {contact.speed_m_s:.2f} m/s ({contact.closing_m_s:.2f} square to it)"
            yield "hit not noticed", f"{text} {flight.at(contact.hit.contact_at_boot_us)}"
    for collision in without_contact(flight):
        yield "answered a hit that was none", flight.at(collision.sample_time_boot_us)


def _places(flight: JudgedFlight, contacts: Sequence[JudgedContact]) -> Iterator[str]:
    """Goals, holds, home and landings, where the vehicle really was."""
    steps = program(flight.mission.items)
    goes_home = False
    told = [event for event in flight.events if event.kind in _TELLING or event.data.get("left_out")]
    for event, following in pairwise(told):
        goes_home |= event.kind == "return"
        if event.kind == "hold":
            off_m = _wandered_m(flight, event, following, contacts)
            if off_m > HELD_M:
                yield f"moved by {off_m:.2f} m while holding {flight.at(flight.boot_us(event))}"
        if following.kind == "item" and event.kind in ("armed", "item"):
            step = steps[0 if event.kind == "armed" else int(str(event.data["step"]))]
            goal = _goal(step.action)
            if goal is not None:
                off_m = float(np.linalg.norm((_place(flight, following) - goal)[~np.isnan(goal)]))
                if off_m > REACHED_M:
                    yield f"item {step.label} ({step.item.name}) ended {off_m:.2f} m beside its goal"
    last = next((event for event in reversed(told) if event.kind == "landing"), None)
    if last is not None and told[-1].kind == "done":
        end = flight.truth.series["position_ned_m"][-1, :2]
        beside_m = float(np.linalg.norm(end - (_place(flight, last)[:2] + flight.start_ned_m[:2])))
        home_m = float(np.linalg.norm(end - flight.start_ned_m[:2]))
        if beside_m > LANDED_BESIDE_M:
            yield f"stands {beside_m:.2f} m beside where it was told to land"
        if goes_home and told[told.index(last) - 1].kind == "return" and home_m > HOME_M:
            yield f"stands {home_m:.2f} m from home"


# A time-out, a hit, a goal out of reach, points left out: such items were not flown one after the other.
_TELLING = ("armed", "item", "detection", "unreachable", "timeout", "hold", "return", "landing", "done", "aborted")


def _goal(action: object) -> Floats | None:
    """Where an item ends, mission coordinates; NaN where it does not say; None where that depends on its start."""
    match action:
        case GoToItem(position_ned_m=place):
            return np.array(place)
        case PathItem(points_ned_m=points):
            return np.array(points[-1])
        case TakeoffItem(height_m=height_m):
            return np.array([np.nan, np.nan, -height_m])
    return None


def _place(flight: JudgedFlight, event: Event) -> Floats:
    """Where the vehicle truly was, mission coordinates."""
    world_ned_m = flight.truth.series["position_ned_m"][flight.row_at(flight.boot_us(event))]
    place: Floats = world_ned_m - flight.start_ned_m + [0.0, 0.0, flight.standing_m]
    return place


def _wandered_m(flight: JudgedFlight, begin: Event, end: Event, contacts: Sequence[JudgedContact]) -> float:
    """Furthest from where it was at first, unless something touched it."""
    first_us, last_us = flight.boot_us(begin), flight.boot_us(end)
    if any(first_us <= contact.hit.contact_at_boot_us <= last_us for contact in contacts):
        return 0.0
    time_us = flight.truth.series["time_boot_us"]
    path = flight.truth.series["position_ned_m"][(time_us >= first_us) & (time_us <= last_us)]
    return float(np.linalg.norm(path - path[0], axis=1).max()) if len(path) else 0.0


def work_out_mission(case: MissionCase) -> Json:
    """The row of a random mission: what was drawn, how it ended, and each of its hits."""
    drawn = random_mission(case)
    flight = fly(*flyable(case, drawn))
    contacts = contacts_of(flight)
    return {
        "room": drawn.room,
        "stream_hz": drawn.stream_hz,
        "wind_m_s": drawn.wind_m_s,
        "extras": list(drawn.extras),
        "items": [next(iter(item)) for item in drawn.data["items"]],
        "outcome": flight.report.outcome,
        "seconds": round(1e-6 * (flight.report.ended_at_us - flight.report.started_at_us), 3),
        "failures": failures(flight),
        "hits": recoveries(flight, contacts),
    }


# --- what the flight knew


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
    goal = np.array(goal_ned_m) + flight.start_ned_m - [0.0, 0.0, flight.standing_m]
    places = [start + share * (goal - start) for share in np.linspace(0.0, 1.0, _LOOKS)]
    still = [obstacle for obstacle in flight.obstacles.values() if obstacle.motion is None]
    return all(obstacle.distance_m((float(n), float(e), float(d))) > OPEN_M for obstacle in still for n, e, d in places)
