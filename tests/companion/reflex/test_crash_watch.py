"""Whether a vehicle at rest near the ground lies there: its weight is carried across its thrust."""

import math

import pytest

from companion.messages import ImuSample, LandedState, LocalPosition
from companion.reflex.config import LIES_US, LOW_M, TIPPED_RAD
from companion.reflex.detection.crash import CrashWatch


@pytest.mark.parametrize(
    ("tilt_rad", "weight_m_s2", "height_m", "lies"),
    [
        (TIPPED_RAD + 0.1, 9.81, 0.1, True),
        (math.pi, 9.81, 0.1, True),
        (TIPPED_RAD - 0.1, 9.81, 0.1, False),
        (TIPPED_RAD + 0.1, 12.0, 0.1, False),
        (TIPPED_RAD + 0.1, 9.81, LOW_M + 0.1, False),
    ],
)
def test_what_rests_with_its_weight_across_its_thrust_lies(tilt_rad, weight_m_s2, height_m, lies):
    # Given a vehicle at rest at a tilt, of which the accelerometer shows that force
    watch, force = CrashWatch(), (weight_m_s2 * math.sin(tilt_rad), 0.0, -weight_m_s2 * math.cos(tilt_rad))
    # When it has been so for three seconds
    for time_us in range(0, 3_000_000, 20_000):
        samples = ImuSample(time_us, force, (0.0, 0.0, 0.0)), LocalPosition(time_us, (0.0, 0.0, 0.0), (0.0, 0.0, 0.0))
        watch.update(samples, height_m, LandedState.UNDEFINED)
    # Then it lies
    assert (watch.lying.lasts_us >= LIES_US) is lies
