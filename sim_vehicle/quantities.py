"""Vectors as values, and arrays of numbers as the kernels take them."""

import math

import numpy as np
import numpy.typing as npt

Vector3 = tuple[float, float, float]
Quaternion = tuple[float, float, float, float]
"""(w, x, y, z)"""
Axis3 = tuple[float | None, float | None, float | None]
"""None for an axis of which nothing is said."""

Floats = npt.NDArray[np.float64]
Ints = npt.NDArray[np.int64]


def vector(row: Floats) -> Vector3:
    """Three numbers of an array as a value."""
    return float(row[0]), float(row[1]), float(row[2])


def quaternion_from_matrix(rows: list[list[float]]) -> Quaternion:
    """Of a rotation matrix; the largest component is found first, so that no division is by a small number."""
    (a, b, c), (d, e, f), (g, h, i) = rows
    squares = (1 + a + e + i, 1 + a - e - i, 1 - a + e - i, 1 - a - e + i)
    largest = max(range(4), key=squares.__getitem__)
    n = 2 * math.sqrt(max(squares[largest], 1e-12))
    if largest == 0:
        return n / 4, (h - f) / n, (c - g) / n, (d - b) / n
    if largest == 1:
        return (h - f) / n, n / 4, (b + d) / n, (c + g) / n
    if largest == 2:
        return (c - g) / n, (b + d) / n, n / 4, (f + h) / n
    return (d - b) / n, (c + g) / n, (f + h) / n, n / 4
