"""Attitude arithmetic on plain floats; quaternions (w, x, y, z) turn body FRD into NED."""

import math

from companion.messages import Quaternion, Vector3


def body_to_ned(attitude_wxyz: Quaternion, vector_frd: Vector3) -> Vector3:
    """R(q) v."""
    w, x, y, z = attitude_wxyz
    a, b, c = vector_frd
    # t = 2 q_v x v;  v' = v + w t + q_v x t
    t_x, t_y, t_z = 2.0 * (y * c - z * b), 2.0 * (z * a - x * c), 2.0 * (x * b - y * a)
    return (
        a + w * t_x + y * t_z - z * t_y,
        b + w * t_y + z * t_x - x * t_z,
        c + w * t_z + x * t_y - y * t_x,
    )


def ned_to_body(attitude_wxyz: Quaternion, vector_ned: Vector3) -> Vector3:
    """R(q)^T v."""
    w, x, y, z = attitude_wxyz
    return body_to_ned((w, -x, -y, -z), vector_ned)


def turned(attitude_wxyz: Quaternion, rates_frd_rad_s: Vector3, over_s: float) -> Quaternion:
    """The attitude after turning at constant body rates: q exp(w t / 2)."""
    w, x, y, z = attitude_wxyz
    p, q, r = rates_frd_rad_s
    half = 0.5 * over_s * math.sqrt(p * p + q * q + r * r)
    scale = 0.5 * over_s * (math.sin(half) / half if abs(half) > 1e-9 else 1.0)
    c, i, j, k = math.cos(half), scale * p, scale * q, scale * r
    return (
        w * c - x * i - y * j - z * k,
        w * i + x * c + y * k - z * j,
        w * j - x * k + y * c + z * i,
        w * k + x * j - y * i + z * c,
    )


def swept_ned(attitude_wxyz: Quaternion, rates_frd_rad_s: Vector3, place_frd: Vector3) -> Vector3:
    """R(q) (w x r): the velocity of a place of a body that turns."""
    (p, q, r), (x, y, z) = rates_frd_rad_s, place_frd
    return body_to_ned(attitude_wxyz, (q * z - r * y, r * x - p * z, p * y - q * x))


def tilt_rad(attitude_wxyz: Quaternion) -> float:
    """Angle between body z and down, 0 to pi."""
    return math.acos(max(-1.0, min(1.0, body_to_ned(attitude_wxyz, (0.0, 0.0, 1.0))[2])))


def yaw_rad(attitude_wxyz: Quaternion) -> float:
    """Heading of the nose, clockwise from north, in (-pi, pi]."""
    w, x, y, z = attitude_wxyz
    return math.atan2(2.0 * (w * z + x * y), 1.0 - 2.0 * (y * y + z * z))
