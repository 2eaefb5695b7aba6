"""Patches as shapes seen from above. Coordinates (north, east), metres."""

import math
from collections.abc import Sequence

from shapely import MultiPoint, Polygon
from shapely.geometry.base import BaseGeometry

from companion.memory.patch import Patch

# Nobody knows how thick what was hit is; thinner than an inner wall is rare.
THICKNESS_M = 0.1


def believed(patch: Patch) -> BaseGeometry:
    """What the surface is believed to cover, wherever it is believed to be in height.

    Of a wall a rectangle behind its front; it widens to both sides with what the normal's error makes of its length, so
    that a surface that is turned against what is believed still lies within it.
    """
    if patch.is_steep:
        return _level(patch)
    low_m, high_m = patch.believed_along_m()
    touched_low_m, touched_high_m = patch.touched_along_m()
    beyond_m = max(touched_low_m - low_m, high_m - touched_high_m)
    return _wall(patch, beyond_m * math.sin(patch.normal_error_rad))


def core(patch: Patch) -> BaseGeometry:
    """The same as if the normal were right: what a vehicle beside it is certainly not in."""
    return _level(patch) if patch.is_steep else _wall(patch, 0.0)


def _level(patch: Patch) -> BaseGeometry:
    touched = MultiPoint([place[:2] for place in patch.touches_ned_m]).convex_hull
    return touched.buffer(max(patch.believed_beyond_m(), THICKNESS_M), quad_segs=2)


def _wall(patch: Patch, wavers_m: float) -> BaseGeometry:
    (north, east, _), (ahead_n, ahead_e, _) = patch.centre_ned_m, patch.normal_ned
    offs_m = [patch.off_m(place) for place in patch.touches_ned_m]
    back_m, front_m = min(offs_m) - max(THICKNESS_M, wavers_m), max(offs_m) + wavers_m
    # A touch that is believed to reach no further is still as wide as it is thick.
    low_m, high_m = patch.believed_along_m()
    low_m, high_m = min(low_m, high_m - THICKNESS_M), max(high_m, low_m + THICKNESS_M)
    corners = ((low_m, back_m), (low_m, front_m), (high_m, front_m), (high_m, back_m))
    return Polygon(
        [
            (north + off_m * ahead_n - along_m * ahead_e, east + off_m * ahead_e + along_m * ahead_n)
            for along_m, off_m in corners
        ]
    )


def outline(patch: Patch) -> Sequence[tuple[float, float]]:
    """The corners of what is believed, for drawing."""
    return [(float(n), float(e)) for n, e in believed(patch).exterior.coords]
