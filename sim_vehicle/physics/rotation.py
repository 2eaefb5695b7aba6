"""Attitude arithmetic: quaternions are (w, x, y, z) and rotate body FRD into world NED.

A "body" here is an array laid out as `PlantState.body`, of which rows 6..9 are the quaternion: passing the
whole array costs a kernel less than cutting a slice.
"""

import math

from sim_vehicle.physics.jit import inlined, njit
from sim_vehicle.quantities import Floats


@inlined
def matrix_from_quaternion(body: Floats, rotation: Floats) -> None:
    """Write the rotation matrix R (body to NED) of a body's unit quaternion into ``rotation`` (3, 3)."""
    w, x, y, z = body[6], body[7], body[8], body[9]
    rotation[0, 0] = 1 - 2 * (y * y + z * z)
    rotation[0, 1] = 2 * (x * y - w * z)
    rotation[0, 2] = 2 * (x * z + w * y)
    rotation[1, 0] = 2 * (x * y + w * z)
    rotation[1, 1] = 1 - 2 * (x * x + z * z)
    rotation[1, 2] = 2 * (y * z - w * x)
    rotation[2, 0] = 2 * (x * z - w * y)
    rotation[2, 1] = 2 * (y * z + w * x)
    rotation[2, 2] = 1 - 2 * (x * x + y * y)


@inlined
def normalise(body: Floats) -> None:
    """Scale a body's quaternion to unit length in place: integration lets it drift by rounding."""
    w, x, y, z = body[6], body[7], body[8], body[9]
    scale = 1 / math.sqrt(w * w + x * x + y * y + z * z)
    for i in range(6, 10):
        body[i] *= scale


@njit
def turn(body: Floats, x_rad: float, y_rad: float, z_rad: float, out: Floats) -> None:
    """Write a body's quaternion turned by a small body-frame rotation into that of ``out``."""
    w, x, y, z = body[6], body[7], body[8], body[9]
    a, b, c = 0.5 * x_rad, 0.5 * y_rad, 0.5 * z_rad
    out[6] = w - x * a - y * b - z * c
    out[7] = x + w * a + y * c - z * b
    out[8] = y + w * b + z * a - x * c
    out[9] = z + w * c + x * b - y * a
    normalise(out)


@njit
def yaw_of(body: Floats) -> float:
    """Heading of a body's nose from north, right positive, radians."""
    w, x, y, z = body[6], body[7], body[8], body[9]
    return math.atan2(2 * (w * z + x * y), 1 - 2 * (y * y + z * z))
