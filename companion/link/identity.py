"""Is the other end a PX4 multicopter?"""

from dataclasses import dataclass

from companion.messages import Heartbeat

# MAV_COMP_ID_AUTOPILOT1: gimbals, cameras and ground stations on the same link have other numbers.
AUTOPILOT_COMPONENT_ID = 1
MAV_AUTOPILOT_PX4 = 12

# MAV_TYPE: hover, sideways force and land detection are the same for all of these.
MULTICOPTERS = {
    2: "quadrotor",
    13: "hexarotor",
    14: "octorotor",
    15: "tricopter",
    29: "dodecarotor",
    35: "decarotor",
}
# The ones most often met by mistake, named so that the message helps.
OTHER_TYPES = {
    1: "fixed-wing aircraft",
    3: "coaxial helicopter",
    4: "helicopter",
    6: "ground station",
    10: "ground rover",
    11: "boat",
    12: "submarine",
    19: "VTOL aircraft",
    20: "VTOL aircraft",
    21: "VTOL aircraft",
    22: "VTOL aircraft",
}
OTHER_AUTOPILOTS = {0: "generic autopilot", 3: "ArduPilot", 8: "component without an autopilot"}


@dataclass(frozen=True, slots=True)
class Identity:
    system_id: int
    component_id: int
    vehicle_type: str


def is_autopilot(heartbeat: Heartbeat) -> bool:
    return heartbeat.component_id == AUTOPILOT_COMPONENT_ID


def identify(heartbeat: Heartbeat) -> Identity | str:
    """The vehicle, or one sentence saying why it is not one that can be flown."""
    if heartbeat.autopilot != MAV_AUTOPILOT_PX4:
        name = OTHER_AUTOPILOTS.get(heartbeat.autopilot, "unknown autopilot")
        return f"the vehicle's autopilot is not PX4 but {name} (MAV_AUTOPILOT {heartbeat.autopilot})"
    vehicle_type = MULTICOPTERS.get(heartbeat.vehicle_type)
    if vehicle_type is None:
        name = OTHER_TYPES.get(heartbeat.vehicle_type, "unknown type")
        return f"the vehicle is not a multicopter but: {name} (MAV_TYPE {heartbeat.vehicle_type})"
    return Identity(heartbeat.system_id, heartbeat.component_id, vehicle_type)
