"""The plan a person confirms, and the words for mission items."""

from companion.flight.context import FlightContext, as_text
from companion.mission.model import Action, GoToItem, HoldItem, LandItem, OnCollision, TakeoffItem

# MPC_XY_P = 0.95 asks for 0.95 * gamma * v_c backwards: above this gamma, for more than the impact speed.
LARGE_GAMMA_S = 1.05


def describe_item(action: Action) -> str:
    match action:
        case TakeoffItem():
            return f"take off to {action.height_m:g} m"
        case GoToItem():
            yaw = "" if action.yaw_deg is None else f", heading {action.yaw_deg:g} deg"
            return f"go to {as_text(action.position_ned_m)} at {action.speed_m_s:g} m/s{yaw}"
        case HoldItem():
            return f"hold for {action.duration_s:g} s"
        case LandItem():
            return "land"


def describe_after_recovery(on_collision: OnCollision) -> str:
    match on_collision.then:
        case "hold":
            return f"hold for {on_collision.hold_s:g} s, then go on with the next item"
        case "continue":
            return "go on with the next item at once"
        case "land":
            return "land"


def plan_text(flight: FlightContext) -> str:
    """What will happen, for a person to agree to. Positions: NED from the arming position, metres."""
    mission = flight.mission
    identity = flight.vehicle.identity
    rates = ", ".join(f"{name} {rate_hz:.1f} Hz" for name, rate_hz in flight.streams.rates_hz().items())
    gamma_1, gamma_2 = mission.recovery.gamma_per_axis
    lines = [
        f"Mission    {mission.name}" + (f": {mission.description}" if mission.description else ""),
        f"Vehicle    {flight.vehicle.autopilot_text()}, "
        + (f"{identity.vehicle_type}, system {identity.system_id}" if identity else "not connected"),
        f"Checks     disarmed, on the ground, streams: {rates}",
    ]
    for number, item in enumerate(mission.items, start=1):
        lines.append(f"{'Items' if number == 1 else '':<10} {number}. {describe_item(item.action)}")
    lines += [
        f"Fence      setpoints stay within {mission.fence.radius_m:g} m of the arming position "
        f"and below {mission.fence.max_height_m:g} m",
        f"On a hit   detector {mission.companion.detector}, recovery law {mission.recovery.law} with gamma "
        f"{gamma_1:g}, {gamma_2:g} s; then {describe_after_recovery(mission.on_collision)}",
        f"On Ctrl-C  or a silent link: hand the vehicle to {mission.on_interrupt}",
        "Pilot      any mode change or disarm by the pilot ends the flight; the companion does not come back",
    ]
    if max(gamma_1, gamma_2) > LARGE_GAMMA_S:
        lines.append(f"Note       gamma above {LARGE_GAMMA_S:g} s asks for more speed backwards than the impact had")
    return "\n".join(lines)
