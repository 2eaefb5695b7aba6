"""Missions into a wall: up, straight at it at a steady speed, hit, recovery, down."""

import math
from collections.abc import Mapping
from typing import Any

# What the paper used, whatever the defaults become: its law and gain, a detector on the inertial sensor alone.
DETECTOR, LAW, GAMMA_S = "lateral", "paper", 0.5
ACCELERATION_M_S2 = 2.0
# After the acceleration, until drag and tilt are in balance: the integral of eq. 6 takes that long to find it.
CRUISE_S = 3.0
# The paper flew half a metre up. A hit at 5 m/s leans the vehicle so far that it loses up to 0.9 m; the errors of
# optical flow grow with the height, so no higher than that asks for.
HEIGHT_M = 1.5
# The mission's target is so far behind the wall that braking for it has not begun: a second of flight.
BEHIND_S = 1.0
# The wall is wider than any flight bounces along it.
WALL_WIDTH_M, WALL_HEIGHT_M = 20.0, 3.8
FENCE_MARGIN_M = 10.0
RUN_UP_M_S2 = 3.0
# After speeding up, the vehicle flies steadily for this long before the wall.
STEADY_S = 1.0


def across(north_m: float, slant_rad: float, width_m: float, height_m: float) -> dict[str, Any]:
    """A wall that stands on the ground across the way north, its face turned by so much."""
    normal = [-math.cos(slant_rad), -math.sin(slant_rad), 0]
    place = [north_m, 0, -height_m / 2]
    return {"point_ned_m": place, "normal_ned": normal, "width_m": width_m, "height_m": height_m}


def there(height_m: float, go_to: Mapping[str, Any]) -> list[dict[str, Any]]:
    """Up, to a place, down."""
    return [{"takeoff": {"height_m": height_m}}, {"go_to": dict(go_to)}, {"land": {}}]


def into_a_wall(name: str, speed_m_s: float, slant_deg: float, height_m: float) -> dict[str, Any]:
    """Up, and at the speed into a wall; the target is so far behind it that braking has not begun there."""
    wall_m = round(0.5 * speed_m_s**2 / RUN_UP_M_S2 + STEADY_S * speed_m_s + 1.0, 3)
    beyond_m = wall_m + speed_m_s**2 / RUN_UP_M_S2 + 2.0
    go_to = {"position_ned_m": [beyond_m, 0, -height_m], "speed_m_s": speed_m_s, "acceleration_m_s2": RUN_UP_M_S2}
    return {
        "name": name,
        "items": there(height_m, go_to),
        "companion": {"flight": {"speeding_up_m_s2": RUN_UP_M_S2}},
        "fence": {"radius_m": 40, "max_height_m": 8},
        "sim": {"walls": [across(wall_m, math.radians(slant_deg), 40, 8)]},
    }


def pinned(mission: Mapping[str, Any]) -> dict[str, Any]:
    """The mission with the paper's detector, law and gain stated, so that no default can change them."""
    return {
        **mission,
        "companion": {**mission.get("companion", {}), "detector": DETECTOR},
        "recovery": {"law": LAW, "gamma": GAMMA_S},
    }


def approach(
    speed_m_s: float,
    heading_deg: float = 0.0,
    height_m: float = HEIGHT_M,
    cruise_s: float = CRUISE_S,
    companion: Mapping[str, Any] | None = None,
) -> dict[str, Any]:
    """Mission towards `heading_deg` at a wall square to it.

    The nose stays north: the heading chooses the arms that are hit.
    """
    north, east = math.cos(math.radians(heading_deg)), math.sin(math.radians(heading_deg))
    facing = math.radians(heading_deg + 180.0)
    ramp_m = speed_m_s**2 / (2.0 * ACCELERATION_M_S2)
    wall_m = ramp_m + cruise_s * speed_m_s
    target_m = wall_m + ramp_m + BEHIND_S * speed_m_s
    wall = {
        "name": "wall",
        "point_ned_m": [wall_m * north, wall_m * east, -0.5 * WALL_HEIGHT_M - 0.1],
        "normal_ned": [math.cos(facing), math.sin(facing), 0.0],
        "width_m": WALL_WIDTH_M,
        "height_m": WALL_HEIGHT_M,
    }
    go_to = {
        "position_ned_m": [target_m * north, target_m * east, -height_m],
        "speed_m_s": speed_m_s,
        "acceleration_m_s2": ACCELERATION_M_S2,
        "yaw_deg": 0.0,
    }
    flight = {"arrival_timeout_s": 2.0, "speeding_up_m_s2": ACCELERATION_M_S2}
    settings: dict[str, Any] = {"streams": {"window_s": 0.5}, "flight": flight}
    for part, values in (companion or {}).items():
        settings[part] = {**settings.get(part, {}), **values} if isinstance(values, Mapping) else values
    return pinned(
        {
            "name": "approach",
            "items": there(height_m, go_to),
            "on_collision": {"then": "land"},
            "fence": {"radius_m": target_m + FENCE_MARGIN_M, "max_height_m": height_m + 4.0},
            "companion": settings,
            "sim": {"walls": [wall]},
        }
    )
