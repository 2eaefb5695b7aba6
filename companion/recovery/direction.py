"""Which way is away from what was hit."""

import math

from companion.messages import Vector3

# Sine of the normal's angle from the horizontal. Below it height is held, as the vehicle's own lean and a single
# clipped sample tilt the normal of a wall; above it the obstacle is a ceiling, a floor or a steep roof. As in
# estimate.normal.
STEEP = 0.7


def away_from(normal_ned: Vector3) -> Vector3:
    """Unit direction out of the obstacle: horizontal unless the obstacle is steep; zero where nothing is known."""
    n, e, d = normal_ned
    flat, size = math.hypot(n, e), math.sqrt(n * n + e * e + d * d)
    if size == 0.0:
        return (0.0, 0.0, 0.0)
    if abs(d) > STEEP * size:
        return (n / size, e / size, d / size)
    return (n / flat, e / flat, 0.0)


def split(vector: Vector3, normal: Vector3) -> tuple[float, Vector3]:
    """The part of a vector along a unit normal, and the rest."""
    along = sum(v * n for v, n in zip(vector, normal, strict=True))
    return along, (vector[0] - along * normal[0], vector[1] - along * normal[1], vector[2] - along * normal[2])


def plus(vector: Vector3, factor: float, direction: Vector3) -> Vector3:
    """vector + factor * direction."""
    return (
        vector[0] + factor * direction[0],
        vector[1] + factor * direction[1],
        vector[2] + factor * direction[2],
    )
