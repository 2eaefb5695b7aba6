"""The plan a person confirms, and the words for mission items."""

from companion.autopilot.interface import Autopilot
from companion.autopilot.known import ASSUMED
from companion.fence import Fence
from companion.flight.context import FlightContext, as_text
from companion.flight.envelope import unattended_text
from companion.flight.expectations import describe
from companion.memory.stored import describe as describe_patch
from companion.mission import items
from companion.mission.model import Mission
from companion.mission.policy import AbortWhen, OnCollision
from companion.reflex.config import RecoveryConfig

_DAMAGED = "On damage  a motor that works harder than before a hit"
_AFTER = {"land": "land", "return": "return and land", "continue": "the next item", "abort": "abort"}


def describe_item(action: items.Action) -> str:
    match action:
        case items.TakeoffItem():
            return f"take off to {action.height_m:g} m"
        case items.GoToItem():
            return f"go to {as_text(action.position_ned_m)}{_speed(action.speed_m_s)}{_yaw(action.yaw_deg)}"
        case items.VelocityItem():
            return f"fly with {as_text(action.velocity_ned_m_s)} m/s for {action.duration_s:g} s{_yaw(action.yaw_deg)}"
        case items.PathItem():
            last = f"{len(action.points_ned_m)} points to {as_text(action.points_ned_m[-1])}"
            return f"fly a smooth path through {last}{_speed(action.speed_m_s)}{_yaw(action.yaw_deg)}"
        case items.OrbitItem():
            sense = "clockwise" if action.clockwise else "anticlockwise"
            circle = f"{as_text(action.centre_ned_m)} at {action.radius_m:g} m, {action.turns:g} times {sense}"
            return f"orbit {circle}{_speed(action.speed_m_s)}{_yaw(action.yaw_deg)}"
        case items.HoldItem():
            return f"hold for {action.duration_s:g} s"
        case items.WaitForItem():
            return f"wait {_condition(action)}"
        case items.SetSpeedItem():
            return f"from here on fly at {action.speed_m_s:g} m/s"
        case items.SetYawItem():
            return f"turn to {action.yaw_deg:g} deg"
        case items.ExpectItem():
            return f"expect {describe(action)}"
        case items.ReturnItem():
            height = "" if action.height_m is None else f" at {action.height_m:g} m or higher"
            return f"return to above the start{height}{_speed(action.speed_m_s)} and land"
        case items.LandItem():
            return "land"


def _speed(speed_m_s: float | None) -> str:
    return "" if speed_m_s is None else f" at {speed_m_s:g} m/s"


def _yaw(yaw: float | str | None) -> str:
    if isinstance(yaw, str):
        return ", facing " + {"along": "ahead", "centre": "the centre"}[yaw]
    return "" if yaw is None else f", heading {yaw:g} deg"


def _condition(item: items.WaitForItem) -> str:
    if item.flight_time_s is not None:
        return f"until {item.flight_time_s:g} s after arming"
    if item.steady is not None:
        return f"until steady within {item.steady.within_m:g} m for {item.steady.for_s:g} s"
    return "for a hit" if item.hit else f"for the file {item.file}"


def _after_recovery(on_collision: OnCollision) -> str:
    then = {
        "hold": f"hold for {on_collision.hold_s:g} s, then go on with the next item",
        "continue": "go on with the next item at once",
        "retry": f"try the item again at {on_collision.retry_speed_factor:.0%} of the speed",
        "detour": "fly round what is known by now",
        "return": "return to above the start and land",
        "land": "land",
    }
    return f"{then[on_collision.then]}; hit {on_collision.max_hits}: {_AFTER[on_collision.after_max_hits]}"


def describe_modifiers(item: items.MissionItem) -> str:
    """What an item has of its own beside its action, or nothing."""
    parts = []
    if item.on_collision is not None:
        parts.append(f"on a hit: {_after_recovery(item.on_collision)}")
    if item.timeout_s is not None:
        parts.append(f"after {item.timeout_s:g} s: {item.on_timeout}")
    return "; ".join(parts)


def describe_fence(fence: Fence) -> str:
    sides = [] if fence.radius_m is None else [f"within {fence.radius_m:g} m of the arming position"]
    sides += [] if fence.polygon_ne_m is None else [f"inside a polygon of {len(fence.polygon_ne_m)} corners"]
    return f"{' and '.join(sides)}, between {fence.min_height_m:g} m and {fence.max_height_m:g} m up"


def describe_abort(abort_when: AbortWhen) -> str:
    """The conditions that are set, or "never"."""
    words = {
        "outside_fence_by_m": "more than {:g} m outside the fence",
        "battery_below_percent": "battery below {:g} %",
        "flight_time_above_s": "more than {:g} s after arming",
        "setpoint_missed_by_m": "more than {:g} m from the setpoint",
        "blind_for_s": "detector blind for {:g} s",
        "hit_above_m_s": "hit at more than {:g} m/s",
    }
    given = abort_when.model_dump(exclude_none=True)
    return ", ".join(words[name].format(value) for name, value in given.items()) or "never"


def mission_lines(mission: Mission, autopilot: Autopilot = ASSUMED) -> list[str]:
    """Items, fence and policies. Positions: NED from the arming position, metres."""
    lines = list[str]()
    for number, item in enumerate(mission.items, start=1):
        lines += _item_lines(f"{number}.", item, "Items" if number == 1 else "")
    on_hit, obstacles = mission.on_collision, mission.obstacles
    return [
        *lines,
        f"Fence      setpoints stay {describe_fence(mission.fence)}",
        f"On a hit   detector {mission.companion.detector}, recovery law {_law(mission.recovery)}; "
        f"then {_after_recovery(on_hit)}",
        *([] if mission.on_damage == "tell" else [f"{_DAMAGED}: {_AFTER[mission.on_damage]}"]),
        f"Obstacles  keep {obstacles.margin_m:g} m off what is known; no way: {_AFTER[obstacles.on_unreachable]}",
        *[f"Known      {describe_patch(patch)}" for patch in obstacles.known],
        f"Abort      {describe_abort(mission.abort_when)}",
        f"On abort   Ctrl-C or a silent link: hand the vehicle to {mission.on_interrupt}",
        f"Unattended {unattended_text(autopilot)}",
    ]


def _law(recovery: RecoveryConfig) -> str:
    """Its name, and the gains of eq. 3 that this law uses."""
    north_s, east_s = recovery.gamma_per_axis
    if recovery.law == "paper":
        return f"paper with gamma {north_s:g}, {east_s:g} s"
    uses_gamma = recovery.law == "normal" or recovery.tangential == "kept"
    return f"{recovery.law} with gamma {north_s:g} s" if uses_gamma else recovery.law


def _item_lines(number: str, item: items.MissionItem, lead: str = "") -> list[str]:
    if item.repeat is not None:
        lines = [f"{lead:<10} {number} {item.repeat.times} times:"]
        for inner, below in enumerate(item.repeat.items, start=1):
            lines += _item_lines(f"{number}{inner}.", below)
        return lines
    modifiers = describe_modifiers(item)
    return [f"{lead:<10} {number} {describe_item(item.action)}" + (f" ({modifiers})" if modifiers else "")]


def _resume_lines(mission: Mission) -> list[str]:
    if mission.resume is None:
        return []
    label = items.program(mission.items)[mission.resume.at_step].label
    return [f"Resumes    at item {label}, in the first flight's coordinates unless the vehicle was restarted since"]


def plan_text(flight: FlightContext) -> str:
    """What will happen, for a person to agree to."""
    mission = flight.mission
    identity = flight.vehicle.identity
    rates = ", ".join(f"{name} {rate_hz:.1f} Hz" for name, rate_hz in flight.streams.rates_hz().items())
    trip_us = flight.round_trip.present_us
    trip = "unknown: TIMESYNC is not answered" if trip_us is None else f"{trip_us / 1e3:.1f} ms"
    lines = [
        f"Mission    {mission.name}" + (f": {mission.description}" if mission.description else ""),
        f"Vehicle    {flight.vehicle.autopilot_text()}, "
        + (f"{identity.vehicle_type}, system {identity.system_id}" if identity else "not connected"),
        f"Checks     disarmed, on the ground, round trip {trip}, streams: {rates}",
        *_resume_lines(mission),
        *mission_lines(mission, flight.vehicle.autopilot),
        "Pilot      any mode change or disarm by the pilot ends the flight; the companion does not come back",
    ]
    return "\n".join(lines)
