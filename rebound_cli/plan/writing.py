"""A mission as a .plan that a PX4 flies by itself, without the companion."""

import math
from collections.abc import Sequence
from typing import Any

from companion.messages import Vector3
from companion.mission.items import (
    ExpectItem,
    GoToItem,
    HoldItem,
    LandItem,
    OrbitItem,
    PathItem,
    ReturnItem,
    SetSpeedItem,
    SetYawItem,
    TakeoffItem,
    VelocityItem,
    WaitForItem,
)
from companion.mission.model import Leg, Mission, itinerary
from companion.ways.trajectory import Trajectory
from rebound_cli.plan import commands
from rebound_cli.plan.fences import plan_of_fence
from sim_vehicle.geography import Origin
from sim_vehicle.hil.messages import Place

# PX4 flies circles in missions as what they are made of: a corner every 15 degrees is 1 % off the circle.
_CORNERS_A_TURN = 24
_FIRMWARE_PX4 = 12  # MAV_AUTOPILOT
_VEHICLE_QUADROTOR = 2  # MAV_TYPE
_ALTITUDE_ABOVE_HOME = 1


class _Plan:
    """The items as far as they are written; numbers from 1."""

    def __init__(self, origin: Origin) -> None:
        self.origin = origin
        self.items: list[dict[str, Any]] = []
        self.notes: list[str] = []
        self.speed_m_s: float | None = None

    def add(self, command: int, *parameters: float | None) -> None:
        """A command without a place."""
        padded = [*parameters, *[0.0] * (7 - len(parameters))]
        self._append(command, commands.FRAME_WITHOUT_PLACE, padded, {})

    def add_place(self, command: int, place_ned_m: Vector3, hold_s: float = 0.0, yaw_deg: float | None = None) -> None:
        place, height_m = self.origin.place_at(place_ned_m), round(-place_ned_m[2], 4)
        parameters = [hold_s, 0.0, 0.0, yaw_deg, place.latitude_deg, place.longitude_deg, height_m]
        extra = {"AMSLAltAboveTerrain": None, "Altitude": height_m, "AltitudeMode": _ALTITUDE_ABOVE_HOME}
        self._append(command, commands.FRAME_ABOVE_HOME[0], parameters, extra)

    def _append(self, command: int, frame: int, parameters: list[float | None], extra: dict[str, Any]) -> None:
        number = len(self.items) + 1
        item = {"autoContinue": True, "command": command, "doJumpId": number, "frame": frame, "params": parameters}
        self.items.append({**extra, **item, "type": "SimpleItem"})

    def fly_at(self, speed_m_s: float) -> None:
        if speed_m_s != self.speed_m_s:
            self.speed_m_s = speed_m_s
            self.add(commands.CHANGE_SPEED, 1.0, speed_m_s, -1.0)


def plan_of_mission(mission: Mission, home: Place) -> tuple[dict[str, Any], Sequence[str]]:
    """The plan for a vehicle armed at `home`, and notes on what a plan cannot say."""
    plan = _Plan(Origin(home))
    legs = itinerary(mission)
    pace_m_s = mission.companion.flight.cruise_speed_m_s
    for leg in legs:
        if isinstance(leg.step.action, SetSpeedItem):
            pace_m_s = leg.step.action.speed_m_s
        _add(plan, leg, pace_m_s)
    plan.notes.append("PX4 flies the plan alone: what follows a hit, time-outs and abort conditions are left out")
    return {
        "fileType": "Plan",
        "geoFence": plan_of_fence(mission.fence, plan.origin),
        "groundStation": "QGroundControl",
        "mission": {
            "cruiseSpeed": 15,
            "firmwareType": _FIRMWARE_PX4,
            "globalPlanAltitudeMode": _ALTITUDE_ABOVE_HOME,
            "hoverSpeed": mission.companion.flight.cruise_speed_m_s,
            "items": plan.items,
            "plannedHomePosition": [home.latitude_deg, home.longitude_deg, home.altitude_m],
            "vehicleType": _VEHICLE_QUADROTOR,
            "version": 2,
        },
        "rallyPoints": {"points": [], "version": 2},
        "version": 1,
    }, plan.notes


def _add(plan: _Plan, leg: Leg, pace_m_s: float) -> None:
    action, label = leg.step.action, leg.step.label
    match action:
        case TakeoffItem():
            plan.add_place(commands.TAKEOFF, leg.end_ned_m)
        case GoToItem() | PathItem() | OrbitItem():
            plan.fly_at(action.speed_m_s or pace_m_s)
            for place in _corners(action, leg):
                plan.add_place(commands.WAYPOINT, place, yaw_deg=_heading(action))
        case VelocityItem():
            plan.fly_at(math.hypot(*action.velocity_ned_m_s))
            plan.add_place(commands.WAYPOINT, leg.end_ned_m, yaw_deg=_heading(action))
        case HoldItem():
            plan.add(commands.DELAY, action.duration_s, -1.0, -1.0, -1.0)
        case SetYawItem():
            plan.add_place(commands.WAYPOINT, leg.end_ned_m, yaw_deg=action.yaw_deg)
        case ReturnItem():
            plan.add(commands.RETURN_TO_LAUNCH)
        case LandItem():
            plan.add_place(commands.LAND, (leg.end_ned_m[0], leg.end_ned_m[1], 0.0))
        case WaitForItem() | ExpectItem():
            plan.notes.append(f"left out: item {label}, {leg.step.name}")
        case SetSpeedItem():
            pass


def _heading(action: GoToItem | PathItem | OrbitItem | VelocityItem) -> float | None:
    return action.yaw_deg if isinstance(action.yaw_deg, float | int) else None


def _corners(action: GoToItem | PathItem | OrbitItem, leg: Leg) -> Sequence[Vector3]:
    """Places between which PX4 may fly straight."""
    match action:
        case GoToItem():
            return [action.position_ned_m]
        case PathItem():
            return action.points_ned_m
        case OrbitItem():
            assert leg.way is not None
            return _round(action, leg.way)


def _round(orbit: OrbitItem, way: Trajectory) -> Sequence[Vector3]:
    """Corners at equal angles, the first where the vehicle comes onto the circle."""
    north_m, east_m, down_m = orbit.centre_ned_m
    end = way.target_m
    last_rad = math.atan2(end[1] - east_m, end[0] - north_m)
    count = max(1, math.ceil(orbit.turns * _CORNERS_A_TURN))
    angle_rad = math.tau * orbit.turns * (1.0 if orbit.clockwise else -1.0)
    angles = [last_rad - angle_rad * (1.0 - corner / count) for corner in range(count + 1)]
    r = orbit.radius_m
    return [(north_m + r * math.cos(angle), east_m + r * math.sin(angle), down_m) for angle in angles]
