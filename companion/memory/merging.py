"""Touches of one surface become one patch: which do, and what they say together."""

import math
from collections.abc import Sequence
from dataclasses import replace

from companion.memory.patch import Patch, Touch, mean_of
from companion.messages import Vector3

# A place is good to this: the estimate wanders by some centimetres between two hits, and which part of which guard
# touched is not known.
PLACE_ERROR_M = 0.1
# Normals this near to each other may be one surface's however sure each is of itself: a wall is not quite plane.
LEAST_ANGLE_RAD = math.radians(25.0)
# Walls of a corner stand at 90 degrees: normals that differ by more than this are never one surface's.
MOST_ANGLE_RAD = math.radians(60.0)
# Two places nearer to each other than this give no direction that is better than the normals.
LEAST_BASE_M = 0.4


def remembered(known: Sequence[Patch], touches: Sequence[Touch], clearance_m: float) -> tuple[Patch, ...]:
    """The known patches and what the touches, in their order, add to them.

    ``clearance_m``: how far the vehicle's centre stays off a surface. Through a gap of less than twice that it cannot
    pass, so what lies on both sides of such a gap may as well be one.
    """
    patches = list(known)
    for touch in touches:
        fitting = [patch for patch in patches if is_same(patch, touch, clearance_m)]
        patches = [patch for patch in patches if patch not in fitting]
        patches.append(_joined(fitting, touch))
    return tuple(patches)


def is_same(patch: Patch, touch: Touch, clearance_m: float) -> bool:
    """Whether the touch is one more of the patch's surface."""
    lone = patch_of(touch)
    if patch.is_steep != lone.is_steep:
        return False
    errors_rad = math.hypot(patch.normal_error_rad, touch.normal_error_rad)
    if _angle_rad(patch.normal_ned, touch.normal_ned) > min(MOST_ANGLE_RAD, max(LEAST_ANGLE_RAD, 2.0 * errors_rad)):
        return False
    if patch.is_steep:
        beside_m = min(math.dist(touch.place_ned_m[:2], place[:2]) for place in patch.touches_ned_m)
        is_near = beside_m <= patch.believed_beyond_m() + 2.0 * clearance_m
    else:
        along_m, height_m = patch.along_m(touch.place_ned_m), -touch.place_ned_m[2]
        beside_m = _outside_m(along_m, patch.touched_along_m())
        is_near = (
            _outside_m(along_m, patch.believed_along_m()) <= 2.0 * clearance_m
            and _outside_m(height_m, patch.believed_heights_m()) <= 2.0 * clearance_m
        )
    bends_m = beside_m * math.tan(min(patch.normal_error_rad, MOST_ANGLE_RAD))
    return is_near and abs(patch.off_m(touch.place_ned_m)) <= 2.0 * PLACE_ERROR_M + bends_m


def patch_of(touch: Touch) -> Patch:
    return Patch((touch.place_ned_m,), touch.normal_ned, touch.normal_error_rad, touch.reaches_m, touch.found_at_us)


def _joined(patches: Sequence[Patch], touch: Touch) -> Patch:
    """One patch of all; the normal by the means of the normals, then by the places where those lie far apart."""
    parts = [*patches, patch_of(touch)]
    weights = [part.hits / max(part.normal_error_rad, 1e-3) ** 2 for part in parts]
    total = sum(weights)
    n, e, d = (
        sum(weight * part.normal_ned[axis] for weight, part in zip(weights, parts, strict=True)) for axis in range(3)
    )
    size = math.sqrt(n * n + e * e + d * d)
    # Normals of one surface have errors in common (friction leans all alike): the mean is no better than the best.
    error_rad = min(part.normal_error_rad for part in parts)
    joined = Patch(
        touches_ned_m=tuple(place for part in parts for place in part.touches_ned_m),
        normal_ned=(n / size, e / size, d / size) if size > 1e-6 * total else touch.normal_ned,
        normal_error_rad=error_rad,
        reaches_m=max(part.reaches_m for part in parts),
        found_at_us=min(part.found_at_us for part in parts),
    )
    return joined if joined.is_steep else _turned_to_places(joined)


def _turned_to_places(patch: Patch) -> Patch:
    """A wall's normal square to the line through its touches (least squares), as far as those are apart enough."""
    (north, east, _), places = mean_of(patch.touches_ned_m), patch.touches_ned_m
    nn = sum((n - north) ** 2 for n, _, _ in places)
    ee = sum((e - east) ** 2 for _, e, _ in places)
    ne = sum((n - north) * (e - east) for n, e, _ in places)
    low_m, high_m = patch.touched_along_m()
    base_m = high_m - low_m
    if base_m < LEAST_BASE_M:
        return patch
    error_rad = math.atan(2.0 * PLACE_ERROR_M / base_m)
    if error_rad >= patch.normal_error_rad:
        return patch
    along_rad = 0.5 * math.atan2(2.0 * ne, nn - ee)
    normal = (-math.sin(along_rad), math.cos(along_rad), 0.0)
    if normal[0] * patch.normal_ned[0] + normal[1] * patch.normal_ned[1] < 0.0:
        normal = (-normal[0], -normal[1], 0.0)
    return replace(patch, normal_ned=normal, normal_error_rad=error_rad)


def _angle_rad(a: Vector3, b: Vector3) -> float:
    return math.acos(max(-1.0, min(1.0, sum(x * y for x, y in zip(a, b, strict=True)))))


def _outside_m(value: float, bounds: tuple[float, float]) -> float:
    return max(0.0, bounds[0] - value, value - bounds[1])
