"""A mission as a .plan that a PX4 flies by itself, without the companion."""

import math
from collections.abc import Sequence
from typing import Any

from companion.fence import Fence
from companion.messages import Vector3
from companion.mission import items
from companion.mission.items import ExpectItem
from companion.mission.model import Leg, Mission, itinerary
from rebound_cli.plan import shape
from sim_vehicle.geography import Origin, Place

# PX4 flies circles in missions as what they are made of: a corner every 15 degrees is 1 % off the circle.
_CORNERS_A_TURN = 24
_FIRMWARE_PX4 = 12  # MAV_AUTOPILOT
_ALTITUDE_ABOVE_HOME = 1


def plan_of_mission(mission: Mission, home: Place) -> tuple[dict[str, Any], Sequence[str]]:
    """The plan for a vehicle armed at `home`, and notes on what a plan cannot say."""
    plan = _Plan(Origin(home), mission.companion.flight.cruise_speed_m_s)
    for leg in itinerary(mission):
        plan.add_leg(leg)
    plan.notes.append("PX4 flies the plan alone: what follows a hit, time-outs and abort conditions are left out")
    return {
        "fileType": "Plan",
        "geoFence": _fence(mission.fence, plan.origin),
        "groundStation": "QGroundControl",
        "mission": {
            "cruiseSpeed": 15,
            "firmwareType": _FIRMWARE_PX4,
            "globalPlanAltitudeMode": _ALTITUDE_ABOVE_HOME,
            "hoverSpeed": mission.companion.flight.cruise_speed_m_s,
            "items": plan.items,
            "plannedHomePosition": [home.latitude_deg, home.longitude_deg, home.altitude_m],
            "vehicleType": shape.QUADROTOR,
            "version": 2,
        },
        "rallyPoints": {"points": [], "version": 2},
        "version": 1,
    }, plan.notes


def _fence(fence: Fence, origin: Origin) -> dict[str, Any]:
    """Its top cannot be stated in a plan."""
    circles, polygons = [], []
    if fence.radius_m is not None:
        centre = [origin.place.latitude_deg, origin.place.longitude_deg]
        circles.append({"circle": {"center": centre, "radius": fence.radius_m}, "inclusion": True, "version": 1})
    if fence.polygon_ne_m is not None:
        places = [origin.place_at((north_m, east_m, 0.0)) for north_m, east_m in fence.polygon_ne_m]
        corners = [[place.latitude_deg, place.longitude_deg] for place in places]
        polygons.append({"polygon": corners, "inclusion": True, "version": 1})
    return {"circles": circles, "polygons": polygons, "version": 2}


class _Plan:
    """The items as far as they are written; numbers from 1."""

    def __init__(self, origin: Origin, cruise_m_s: float) -> None:
        self.origin = origin
        self.items: list[dict[str, Any]] = []
        self.notes: list[str] = []
        self._cruise_m_s = cruise_m_s
        self._speed_m_s: float | None = None

    def add_leg(self, leg: Leg) -> None:
        action = leg.step.action
        match action:
            case items.TakeoffItem():
                self._add_place(shape.TAKEOFF, leg.end_ned_m)
            case items.GoToItem() | items.PathItem() | items.OrbitItem():
                self._fly_at(action.speed_m_s or self._cruise_m_s)
                for place in _corners(action, leg):
                    self._add_place(shape.WAYPOINT, place, action.yaw_deg)
            case items.VelocityItem():
                self._fly_at(math.hypot(*action.velocity_ned_m_s))
                self._add_place(shape.WAYPOINT, leg.end_ned_m, action.yaw_deg)
            case items.HoldItem():
                self._add(shape.DELAY, action.duration_s, -1.0, -1.0, -1.0)
            case items.SetYawItem():
                self._add_place(shape.WAYPOINT, leg.end_ned_m, action.yaw_deg)
            case items.ReturnItem():
                self._add(shape.RETURN_TO_LAUNCH)
            case items.LandItem():
                self._add_place(shape.LAND, (*leg.end_ned_m[:2], 0.0))
            case items.WaitForItem() | ExpectItem():
                self.notes.append(f"left out: item {leg.step.label}, {leg.step.name}")
            case items.SetSpeedItem():
                self._cruise_m_s = action.speed_m_s

    def _fly_at(self, speed_m_s: float) -> None:
        if speed_m_s != self._speed_m_s:
            self._speed_m_s = speed_m_s
            self._add(shape.CHANGE_SPEED, 1.0, speed_m_s, -1.0)

    def _add_place(self, command: int, place_ned_m: Vector3, yaw: float | str | None = None) -> None:
        """`yaw`: degrees, or in a word what a plan cannot say."""
        place, height_m = self.origin.place_at(place_ned_m), round(-place_ned_m[2], 4)
        yaw_deg = yaw if isinstance(yaw, float | int) else None
        extra = {"AMSLAltAboveTerrain": None, "Altitude": height_m, "AltitudeMode": _ALTITUDE_ABOVE_HOME}
        values = (0.0, 0.0, 0.0, yaw_deg, place.latitude_deg, place.longitude_deg, height_m)
        self._add(command, *values, frame=shape.FRAME_ABOVE_HOME[0], **extra)

    def _add(
        self, command: int, *parameters: float | None, frame: int = shape.FRAME_WITHOUT_PLACE, **extra: Any
    ) -> None:
        values = [*parameters, *[0.0] * (7 - len(parameters))]
        number = len(self.items) + 1
        item = {"autoContinue": True, "command": command, "doJumpId": number, "frame": frame, "params": values}
        self.items.append({**extra, **item, "type": "SimpleItem"})


def _corners(action: items.GoToItem | items.PathItem | items.OrbitItem, leg: Leg) -> Sequence[Vector3]:
    """Places between which PX4 may fly straight; of a circle at equal angles, the first where the vehicle joins it."""
    if isinstance(action, items.GoToItem):
        return [action.position_ned_m]
    if isinstance(action, items.PathItem):
        return action.points_ned_m
    assert leg.trajectory is not None
    (north_m, east_m, down_m), end = action.centre_ned_m, leg.trajectory.target_m
    last_rad = math.atan2(end[1] - east_m, end[0] - north_m)
    count = max(1, math.ceil(action.turns * _CORNERS_A_TURN))
    angle_rad = math.tau * action.turns * (1.0 if action.clockwise else -1.0)
    angles = [last_rad - angle_rad * (1.0 - corner / count) for corner in range(count + 1)]
    r = action.radius_m
    return [(north_m + r * math.cos(angle), east_m + r * math.sin(angle), down_m) for angle in angles]
