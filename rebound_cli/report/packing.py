"""Columns of numbers as text in a page: whole multiples of a resolution, little-endian, base64.

`page.js` reads them back. A column that fits takes two bytes a number, any other four.
"""

import base64
import math
from typing import Any

import numpy as np
import numpy.typing as npt

Floats = npt.NDArray[np.float64]

# The most negative number stands for "none".
NONE = {"i2": -(1 << 15), "i4": -(1 << 31)}


def packed(values: Floats, resolution: float) -> dict[str, Any]:
    """One column; what is not finite is none."""
    finite = values[np.isfinite(values)]
    low, high = (math.floor(finite.min() / resolution), math.ceil(finite.max() / resolution)) if len(finite) else (0, 0)
    middle = (low + high) // 2
    kind = "i2" if high - low < 65_000 else "i4"
    # What four bytes cannot hold is none: of times in steps of 10 us what is six hours from the middle.
    steps = np.round(values / resolution) - middle
    held = np.isfinite(steps) & (np.abs(steps) < -NONE[kind])
    whole = np.where(held, np.where(held, steps, 0.0), NONE[kind]).astype(f"<{kind}")
    return {
        "kind": kind,
        "offset": middle,
        "resolution": resolution,
        "data": base64.b64encode(whole.tobytes()).decode(),
    }


def kept_rows(seconds: Floats, loudness: Floats, near_s: Floats, around_s: float, most: int) -> npt.NDArray[np.int64]:
    """Which rows of a long flight are shown: all around the moments `near_s`, elsewhere the loudest of each stretch.

    Of at most `most` rows all are.
    """
    count = len(seconds)
    if count <= most:
        return np.arange(count)
    keep = np.zeros(count, bool)
    for moment_s in near_s:
        keep |= np.abs(seconds - moment_s) <= around_s
    left = np.flatnonzero(~keep)
    # NaN is never the loudest.
    order = np.nan_to_num(loudness, nan=-np.inf)
    for part in np.array_split(left, max(most - int(keep.sum()), most // 4)):
        if len(part):
            keep[part[np.argmax(order[part])]] = True
    return np.flatnonzero(keep)
