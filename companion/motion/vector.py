"""Vectors of three numbers, NED or FRD."""

import math

from companion.messages import Vector3

ZERO: Vector3 = (0.0, 0.0, 0.0)


def flat(vector: Vector3) -> Vector3:
    """Without its part down, of NED."""
    return (vector[0], vector[1], 0.0)


def along(vector: Vector3, normal: Vector3) -> float:
    """The component of a vector along a unit normal."""
    return vector[0] * normal[0] + vector[1] * normal[1] + vector[2] * normal[2]


def split(vector: Vector3, normal: Vector3) -> tuple[float, Vector3]:
    """The component of a vector along a unit normal, and the vector without it."""
    (u, v, w), (a, b, c) = vector, normal
    along = u * a + v * b + w * c
    return along, (u - along * a, v - along * b, w - along * c)


def plus(vector: Vector3, factor: float, direction: Vector3) -> Vector3:
    """vector + factor * direction."""
    return (
        vector[0] + factor * direction[0],
        vector[1] + factor * direction[1],
        vector[2] + factor * direction[2],
    )


def minus(vector: Vector3, other: Vector3) -> Vector3:
    """vector - other."""
    return (vector[0] - other[0], vector[1] - other[1], vector[2] - other[2])


def towards(vector: Vector3, other: Vector3, share: float) -> Vector3:
    """vector + share * (other - vector): a share of the way; of a low-pass filter the next value."""
    x, y, z = vector
    return (x + share * (other[0] - x), y + share * (other[1] - y), z + share * (other[2] - z))


def limited(vector: Vector3, most: float) -> Vector3:
    """The vector, no longer than that."""
    size = math.hypot(*vector)
    return vector if size <= most else plus(ZERO, most / size, vector)


def unit(vector: Vector3) -> Vector3:
    """Unit vector; zero for a zero vector."""
    length = math.hypot(*vector)
    return (vector[0] / length, vector[1] / length, vector[2] / length) if length > 1e-9 else ZERO
