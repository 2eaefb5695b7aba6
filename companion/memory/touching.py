"""From a hit to a touch: where the surface is, which way it faces and how sure that is."""

import math

from companion.memory.patch import REACHES_M, Touch
from companion.messages import Vector3
from companion.reflex.halfspace import away_from

# Of the normals that one whole contact gives, 61 % are within 10 degrees and 94 % within 20 (docs/detection.md).
ERROR_RAD = math.radians(15.0)
# A clipped sample tilts the push by what it lacks; a stiff hit is one such sample, and has been 50 degrees off.
CLIPPED_ERROR_RAD = math.radians(30.0)
# Where nothing but the approach says from where the hit came.
APPROACH_ERROR_RAD = math.radians(45.0)
# A surface pushes against the way into it. Its normal lies at most this (cosine) beside square to the approach, which
# is what its error makes of a grazing hit.
LEAST_AGAINST = -0.2
# A hit hard enough to clip the sensor goes into the surface, not along it: within 60 degrees of its normal.
LEAST_CLIPPED = 0.5
# Slower than this a hit came to the vehicle: it moves, or blew past, and will not stand there as a wall does. It is
# remembered where it was, and believed to be no larger.
LEAST_SPEED_M_S = 0.3
# So does what pushes the vehicle on the way it flies: within 60 degrees of it no obstacle that stands can push, and a
# push of which clipping left no direction has been turned round by then (see estimate.facing).
FROM_BEHIND = -0.5


def touch_of(
    centre_ned_m: Vector3,
    velocity_ned_m_s: Vector3,
    normal_ned: Vector3,
    is_clipped: bool,
    reach_m: float,
    found_at_us: int,
    is_behind: bool = False,
) -> Touch | None:
    """The touch by a vehicle whose centre was there and moved so; None where nothing says from where it came.

    ``normal_ned`` is horizontal, steep or zero (see halfspace.away_from). ``reach_m``: centre to the guards' rim.
    ``is_behind``: what was hit is known to have come after the vehicle.
    """
    n, e, d = velocity_ned_m_s
    is_fast = math.sqrt(n * n + e * e + d * d) >= LEAST_SPEED_M_S
    against = away_from((-n, -e, -d)) if is_fast else (0.0, 0.0, 0.0)
    is_behind = is_behind or _agreement(normal_ned, against) < FROM_BEHIND
    normal, error_rad = (normal_ned, ERROR_RAD) if is_behind else _direction(normal_ned, against, is_clipped)
    if normal == (0.0, 0.0, 0.0):
        return None
    place = tuple(c - reach_m * x for c, x in zip(centre_ned_m, normal, strict=True))
    reaches_m = REACHES_M if is_fast and not is_behind else 0.0
    return Touch((place[0], place[1], place[2]), normal, error_rad, reaches_m, found_at_us)


def _agreement(normal: Vector3, against: Vector3) -> float:
    return sum(a * b for a, b in zip(normal, against, strict=True))


def _direction(normal: Vector3, against: Vector3, is_clipped: bool) -> tuple[Vector3, float]:
    """The normal to believe and its error: between the push and the way back where the push is not to be trusted."""
    if against == (0.0, 0.0, 0.0):
        return normal, CLIPPED_ERROR_RAD
    agreement = _agreement(normal, against)
    if normal == (0.0, 0.0, 0.0) or agreement < (LEAST_CLIPPED if is_clipped else LEAST_AGAINST):
        return against, APPROACH_ERROR_RAD
    if not is_clipped:
        return normal, ERROR_RAD
    # Either may be right: half way between both is at most half of the angle wrong.
    middle = away_from((normal[0] + against[0], normal[1] + against[1], normal[2] + against[2]))
    half_rad = 0.5 * math.acos(max(-1.0, min(1.0, agreement)))
    return middle, max(CLIPPED_ERROR_RAD, half_rad)
