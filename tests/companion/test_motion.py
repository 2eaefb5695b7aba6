"""The history of positions, and rotations."""

import math

import pytest

from companion.messages import LocalPosition
from companion.motion.history import MotionHistory
from companion.motion.rotation import body_to_ned, yaw_rad
from companion.motion.strapdown import Strapdown
from companion.reflex.validity import VelocityValidity

CONTACT_US = 10_000_000


def test_history_keeps_two_seconds_drops_late_packets_and_starts_anew_after_a_reboot():
    history = MotionHistory()
    samples = [
        LocalPosition(t_us, (0.0, 0.0, 0.0), (0.0, 0.0, 0.0))
        for t_us in range(CONTACT_US - 5_000_000, CONTACT_US, 20_000)
    ]
    assert all(history.add(sample) for sample in samples)
    kept = history.between(0, CONTACT_US)
    assert kept[-1] is samples[-1]
    assert 1.95 <= (kept[-1].time_boot_us - kept[0].time_boot_us) * 1e-6 <= 2.0
    assert not history.add(samples[-2])
    assert history.latest() is samples[-1]
    rebooted = LocalPosition(1000, (0.0, 0.0, 0.0), (0.0, 0.0, 0.0))
    assert history.add(rebooted)
    assert history.between(0, CONTACT_US) == [rebooted]
    assert history.before(1001) is rebooted and history.before(1000) is None


HALF = math.sqrt(0.5)


@pytest.mark.parametrize(
    ("attitude", "nose_ned", "right_ned", "yaw"),
    [
        ((1.0, 0.0, 0.0, 0.0), (1, 0, 0), (0, 1, 0), 0.0),  # nose north
        ((HALF, 0.0, 0.0, HALF), (0, 1, 0), (-1, 0, 0), math.pi / 2),  # nose east
        ((HALF, 0.0, HALF, 0.0), (0, 0, -1), (0, 1, 0), None),  # nose up
        ((HALF, HALF, 0.0, 0.0), (1, 0, 0), (0, 0, 1), 0.0),  # right wing down
    ],
)
def test_rotation_on_attitudes_everyone_knows(attitude, nose_ned, right_ned, yaw):
    assert body_to_ned(attitude, (1.0, 0.0, 0.0)) == pytest.approx(nose_ned, abs=1e-12)
    assert body_to_ned(attitude, (0.0, 1.0, 0.0)) == pytest.approx(right_ned, abs=1e-12)
    if yaw is not None:
        assert yaw_rad(attitude) == pytest.approx(yaw)


@pytest.mark.parametrize(
    ("speed_m_s", "told_deg", "kept_deg"), [(4.2, 24.0, 0.0), (4.2, 36.0, 36.0), (1.0, 14.0, 14.0)]
)
def test_after_a_clipped_hit_the_reported_tilt_counts_where_it_is_further_off_than_that_hit_spoils_it(
    speed_m_s, told_deg, kept_deg
):
    # Given gyroscopes that show no turn since the hit
    strapdown, validity = Strapdown(), VelocityValidity()
    strapdown.imu(1_000_000, (0.0, 0.0, -9.81), (0.0, 0.0, 0.0))
    validity.invalidate(800_000, speed_m_s)
    # When the estimator, which corrects itself, tells a tilt
    half_rad = 0.5 * math.radians(told_deg)
    tilted = (math.cos(half_rad), math.sin(half_rad), 0.0, 0.0)
    strapdown.attitude(1_000_000, tilted, validity.tilt_error_rad(1_000_000))
    # Then an error that clipping makes of it (23 degrees on a real PX4 at 4.2 m/s) is left out, and a larger one is not
    _, _, down = body_to_ned(strapdown.valid_wxyz, (0.0, 0.0, 1.0))
    assert math.degrees(math.acos(min(1.0, down))) == pytest.approx(kept_deg, abs=0.01)
