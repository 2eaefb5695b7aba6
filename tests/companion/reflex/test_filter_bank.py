"""The bank's models beside what a real PX4 did after clipped hits."""

import numpy as np
import pytest

from companion.reflex.belief.filter_bank import error_response

# What was wrong of PX4's velocity, and of its place in seconds, as shares of what clipping hid (bench/notes/px4.md).
SINCE_S = (0.1, 0.2, 0.3, 0.4, 0.5, 0.6, 0.8, 1.0, 1.4, 2.0, 3.0)
CAPTURE = (
    (1.00, 0.85, 0.54, 0.22, -0.02, -0.16, -0.19, -0.15, -0.10, -0.07, -0.05),
    (0.10, 0.17, 0.16, 0.11, 0.04, -0.02, -0.06, -0.05, -0.03, -0.01, 0.00),
)
GPS = (
    (0.98, 0.90, 0.79, 0.67, 0.53, 0.39, 0.13, -0.05, -0.18, -0.16, -0.10),
    (0.10, 0.16, 0.20, 0.20, 0.18, 0.17, 0.09, 0.02, -0.05, -0.06, -0.04),
)


@pytest.mark.parametrize(
    ("measured", "within", "late_within"), [(CAPTURE, 0.075, 0.02), (GPS, 0.055, 0.055)], ids=["capture", "gps"]
)
def test_one_of_the_models_is_a_real_px4s_whose_tilt_goes_on_being_wrong(measured, within, late_within):
    models = np.array([error_response(since_s)[:2] for since_s in SINCE_S])
    off = np.abs(models - np.array(measured).T[:, :, None]).max(axis=1)
    nearest = off.max(axis=0).argmin()
    assert off[:, nearest].max() < within
    # When the swing is over, only the tilt's slow decay is left
    assert off[-3:, nearest].max() < late_within
