"""Vectors as values, and arrays of numbers as the kernels take them."""

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
