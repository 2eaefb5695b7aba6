"""The history of positions, and rotations."""

import math

import pytest

from companion.messages import LocalPosition
from companion.motion.history import MotionHistory
from companion.motion.rotation import body_to_ned, yaw_rad

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
