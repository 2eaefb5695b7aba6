"""v_c and x(t_c): from before the contact, extrapolated to it, never touched by what came after."""

import math
import random

import pytest

from companion.estimate.approach import position_at, velocity_alone
from companion.estimate.config import EstimateConfig
from companion.messages import LocalPosition
from companion.motion.history import MotionHistory
from companion.motion.rotation import body_to_ned, yaw_rad

CONFIG = EstimateConfig()
CONTACT_US = 10_000_000


def approach(speed_m_s=2.0, acceleration_m_s2=0.0, noise_m_s=0.0, seed=1, every_us=20_000, seconds=1.0):
    """Positions and velocities along north before the contact at x = 4 m, where the speed is `speed_m_s`."""
    rng = random.Random(seed)
    samples = []
    for t_us in range(CONTACT_US - round(seconds * 1e6), CONTACT_US, every_us):
        t = (t_us - CONTACT_US) * 1e-6
        north = 4.0 + speed_m_s * t + 0.5 * acceleration_m_s2 * t * t
        noise = [rng.gauss(0.0, noise_m_s) for _ in range(3)]
        velocity = (speed_m_s + acceleration_m_s2 * t + noise[0], noise[1], noise[2])
        samples.append(LocalPosition(t_us, (north, 1.0, -1.5), velocity))
    return samples


@pytest.mark.parametrize("acceleration", [0.0, 2.0, -0.52])
def test_a_clean_approach_is_extrapolated_to_the_contact(acceleration):
    samples = approach(2.0, acceleration)
    velocity, _ = velocity_alone(samples, CONTACT_US, CONFIG)
    assert velocity == pytest.approx((2.0, 0.0, 0.0), abs=0.03)
    assert position_at(samples[-1], CONTACT_US, velocity) == pytest.approx((4.0, 1.0, -1.5), abs=0.005)


def test_samples_after_the_contact_change_nothing():
    before = approach(noise_m_s=0.03)
    after = [LocalPosition(CONTACT_US + k * 20_000, (9.0, 9.0, 9.0), (-50.0, 7.0, 3.0)) for k in range(5)]
    assert velocity_alone(before + after, CONTACT_US, CONFIG) == velocity_alone(before, CONTACT_US, CONFIG)


def test_a_stamp_cut_to_the_millisecond_that_may_be_after_the_contact_is_not_used():
    before = approach()
    doubtful = LocalPosition(CONTACT_US - 500, (4.0, 1.0, -1.5), (-1.0, 0.0, 0.0))
    assert velocity_alone([*before, doubtful], CONTACT_US, CONFIG) == velocity_alone(before, CONTACT_US, CONFIG)


@pytest.mark.parametrize("speed_m_s", [1.0, 2.0])
def test_with_a_good_estimates_noise_v_c_is_within_five_percent(speed_m_s):
    errors = []
    for seed in range(60):
        velocity, _ = velocity_alone(approach(speed_m_s, noise_m_s=0.03, seed=seed), CONTACT_US, CONFIG)
        errors.append(math.hypot(*velocity) - speed_m_s)
    rms = math.sqrt(sum(e * e for e in errors) / len(errors))
    assert rms < 0.05 * speed_m_s / 2, "half the allowance: the other half is the delay of the estimate"


def test_without_history_there_is_no_estimate_and_one_sample_is_taken_as_it_is():
    assert velocity_alone([], CONTACT_US, CONFIG) is None
    one = approach()[-1:]
    velocity, _ = velocity_alone(one, CONTACT_US, CONFIG)
    assert velocity == pytest.approx(one[0].velocity_ned_m_s)


def test_history_keeps_two_seconds_drops_late_packets_and_starts_anew_after_a_reboot():
    history = MotionHistory()
    samples = approach(seconds=5.0)
    assert all(history.add(sample) for sample in samples)
    kept = history.between(0, CONTACT_US)
    assert kept[-1] is samples[-1]
    assert 1.95 <= (kept[-1].time_boot_us - kept[0].time_boot_us) * 1e-6 <= 2.0
    assert not history.add(samples[-2])
    assert history.latest() is samples[-1]
    rebooted = LocalPosition(1000, (0.0, 0.0, 0.0), (0.0, 0.0, 0.0))
    assert history.add(rebooted)
    assert history.between(0, CONTACT_US) == [rebooted]


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
