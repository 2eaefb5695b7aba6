"""Fences of a .plan and of a mission: circles and polygons that are not to be left."""

import math
from collections.abc import Sequence
from typing import Any

from companion.errors import ConfigurationError
from companion.mission.fence import Fence
from rebound_cli.plan.shape import Circle, GeoFence
from sim_vehicle.geography import Origin
from sim_vehicle.hil.messages import Place

# A plan that states no fence gets one this much wider and higher than what it flies.
_MARGIN_M = 5.0
_MARGIN_UP_M = 2.0
# A circle whose centre is nearer to home than this is one around home.
_AT_HOME_M = 1.0
# Any other circle becomes a polygon inside it, at most 1 % narrower.
_CIRCLE_CORNERS = 24


def fence_of_plan(
    written: GeoFence | None, origin: Origin, furthest_m: float, highest_m: float
) -> tuple[dict[str, Any], Sequence[str]]:
    """The mission's fence and notes. Raises ConfigurationError for what it cannot say."""
    circles, polygons = (written.circles, written.polygons) if written is not None else ([], [])
    if not all(part.inclusion for part in (*circles, *polygons)):
        raise ConfigurationError("the plan has a fence that keeps out, which a mission does not know: leave it out.")
    if len(circles) > 1 or len(polygons) > 1 or (circles and polygons):
        raise ConfigurationError("the plan has several fences, and a mission has one: leave one.")
    top_m = math.ceil(highest_m + _MARGIN_UP_M)
    note = f"a plan's fence has no top: {top_m} m was put in"
    if circles:
        return {**_circle(circles[0].circle, origin), "max_height_m": top_m}, [note]
    if polygons:
        return {"polygon_ne_m": _corners(polygons[0].polygon, origin), "max_height_m": top_m}, [note]
    radius_m = math.ceil(furthest_m + _MARGIN_M)
    fence = {"radius_m": radius_m, "max_height_m": top_m}
    return fence, [f"the plan has no fence: one of {radius_m} m and {top_m} m up was put in"]


def _circle(circle: Circle, origin: Origin) -> dict[str, Any]:
    radius_m, (latitude_deg, longitude_deg) = circle.radius, circle.center
    north_m, east_m, _ = origin.position_of(Place(latitude_deg, longitude_deg, origin.place.altitude_m))
    if math.hypot(north_m, east_m) < _AT_HOME_M:
        return {"radius_m": radius_m}
    angles = [math.tau * corner / _CIRCLE_CORNERS for corner in range(_CIRCLE_CORNERS)]
    corners = [[north_m + radius_m * math.cos(angle), east_m + radius_m * math.sin(angle)] for angle in angles]
    return {"polygon_ne_m": [[round(axis, 3) for axis in corner] for corner in corners]}


def _corners(polygon: Sequence[Sequence[float]], origin: Origin) -> list[list[float]]:
    places = [Place(latitude_deg, longitude_deg, origin.place.altitude_m) for latitude_deg, longitude_deg in polygon]
    return [[round(axis, 3) for axis in origin.position_of(place)[:2]] for place in places]


def plan_of_fence(fence: Fence, origin: Origin) -> dict[str, Any]:
    """The `geoFence` of a plan; its top cannot be stated there."""
    circles, polygons = [], []
    if fence.radius_m is not None:
        centre = [origin.place.latitude_deg, origin.place.longitude_deg]
        circles.append({"circle": {"center": centre, "radius": fence.radius_m}, "inclusion": True, "version": 1})
    if fence.polygon_ne_m is not None:
        places = [origin.place_at((north_m, east_m, 0.0)) for north_m, east_m in fence.polygon_ne_m]
        corners = [[place.latitude_deg, place.longitude_deg] for place in places]
        polygons.append({"polygon": corners, "inclusion": True, "version": 1})
    return {"circles": circles, "polygons": polygons, "version": 2}
