"""What PX4's estimator takes off its IMU for biases after a hit, and what gives it back."""

import random

import pytest

from companion.autopilot.px4.firmware import PX4
from companion.messages import ImuSample, MessageId, ScaledImu
from companion.motion.biases import TakenBiases
from companion.motion.config import GRAVITY_M_S2, MEMORY_STEPS
from companion.motion.vector import ZERO, plus
from companion.reflex.detection.detector import Situation
from companion.reflex.detection.monitor import CollisionMonitorConfig, advance, start_monitor
from tests.companion.reflex.test_motion_estimator import reckoned

FORCE, RATES = (0.3, -0.1, -9.8), (0.02, 0.0, -0.01)
TURN_ON = ((0.05, -0.02, 0.1), (0.003, 0.0, 0.0))  # biases that it has found rightly
HIT = ((-0.35, 0.25, 0.0), (0.0, -0.01, 0.0))  # what it takes besides, of a hit


def told(biases, at_us, taken, is_free, is_later=True, stamp_us=0):
    """What is made of a sample that the estimator has taken so much off; as it is measured it comes later, or before
    it, with another stamp."""
    measured = ScaledImu(at_us + stamp_us, FORCE, RATES)
    sent = ImuSample(at_us, plus(FORCE, -1.0, taken[0]), plus(RATES, -1.0, taken[1]))
    if not is_later:
        biases.take(measured, is_free)
    found = biases.given_back(sent, is_free)
    if is_later:
        biases.take(measured, is_free)
    return found, sent


def both(one, other):
    return tuple(plus(a, 1.0, b) for a, b in zip(one, other, strict=True))


def after_a_hit(taken, *, is_later=True, stamp_us=0, learns=True):
    """The second sample after a hit, of which the estimator takes so much, and as it was sent."""
    biases = TakenBiases()
    for tick in range(MEMORY_STEPS if learns else 0):
        found, sent = told(biases, 40_000 * tick, TURN_ON, True, is_later)
        assert found is sent
    told(biases, 8_000_000, taken, False, is_later, stamp_us)
    return told(biases, 8_040_000, taken, False, is_later, stamp_us)


@pytest.mark.parametrize("is_later", [True, False])
@pytest.mark.parametrize("stamp_us", [-2_000, 0, 2_000])
def test_what_the_estimator_takes_since_a_hit_is_given_back_and_what_it_had_found_before_stays_off(is_later, stamp_us):
    found, _ = after_a_hit(both(TURN_ON, HIT), is_later=is_later, stamp_us=stamp_us)
    assert found.specific_force_frd_m_s2 == pytest.approx(plus(FORCE, -1.0, TURN_ON[0]))
    assert found.angular_velocity_frd_rad_s == pytest.approx(plus(RATES, -1.0, TURN_ON[1]))


@pytest.mark.parametrize(
    ("taken", "is_bias"),
    [
        # From one of PX4's limits to the other: EKF2_ABL_LIM 0.4 m/s^2, EKF2_GYR_B_LIM 0.15 rad/s
        (((0.79, 0.0, 0.0), ZERO), True),
        (((0.81, 0.0, 0.0), ZERO), False),
        ((HIT[0], (0.0, 0.0, 0.29)), True),
        ((HIT[0], (0.0, 0.0, 0.31)), False),
    ],
)
def test_more_than_an_estimator_takes_for_a_bias_is_another_sensor(taken, is_bias):
    found, sent = after_a_hit(both(TURN_ON, taken))
    assert (found is not sent) is is_bias


def test_a_sample_that_is_rounded_is_the_same():
    # Given a force to and fro, and SCALED_IMU, which cuts off what is less than a thousandth of g
    biases, least_m_s2 = TakenBiases(), 0.99e-3 * GRAVITY_M_S2
    for tick in range(202):
        force, is_free = (least_m_s2 * (-1) ** tick,) * 3, tick < 200
        biases.take(ScaledImu(40_000 * tick, ZERO, ZERO), is_free)
        biases.given_back(ImuSample(40_000 * tick, plus(force, -1.0, ZERO if is_free else HIT[0]), ZERO), is_free)
    # Then what the estimator takes is known to that
    assert biases.force_m_s2 == pytest.approx(HIT[0], abs=0.02)


@pytest.mark.parametrize("shakes_m_s2", [0.02, 0.1])
def test_another_sensor_that_vibrates_by_itself_is_not_compared_with(shakes_m_s2):
    # Given a vehicle that flies by its second sensor, and what the first one measures
    biases, draw = TakenBiases(), random.Random(1)
    for tick in range(200):
        shakes = (tuple(draw.gauss(0.0, shakes_m_s2) for _ in range(3)), ZERO)
        told(biases, 40_000 * tick, both(TURN_ON, shakes), is_free=tick < 150)
        # Then nothing is given back of what that says after a hit
        assert biases.force_m_s2 == ZERO


def test_one_odd_sample_forgets_nothing():
    # Given the first sample of a hit, which the two show differently
    biases = TakenBiases()
    for tick in range(202):
        taken = both(TURN_ON, HIT) if tick >= 200 else TURN_ON
        told(biases, 40_000 * tick, taken, is_free=tick <= 200)
    # Then what the estimator takes from then on is known all the same
    assert biases.force_m_s2 == pytest.approx(HIT[0], abs=0.02)


def test_another_sample_says_nothing_of_this_one():
    found, sent = after_a_hit(both(TURN_ON, HIT), stamp_us=2_001)
    assert found is sent


def test_where_nothing_was_compared_before_a_hit_nothing_is_given_back():
    found, sent = after_a_hit(both(TURN_ON, HIT), learns=False)
    assert found is sent


def test_once_the_hit_is_over_its_biases_are_the_vehicles():
    # Given a hit, and no SCALED_IMU after it
    biases = TakenBiases()
    for tick in range(MEMORY_STEPS):
        told(biases, 40_000 * tick, (ZERO, ZERO), True)
    told(biases, 4_000_000, HIT, False)
    assert biases.force_m_s2 != ZERO
    # Then nothing of it goes on to the next one
    for is_free in (True, False):
        sent = ImuSample(16_000_000, FORCE, RATES)
        assert biases.given_back(sent, is_free) is sent


@pytest.mark.parametrize("is_followed", [False, True])
def test_after_a_hit_the_monitor_takes_samples_with_what_the_estimator_has_taken_of_it(is_followed):
    # Given a vehicle that rests, before a hit and after one
    monitor, situation = start_monitor(CollisionMonitorConfig(), 0), Situation(off_reason="at rest")
    for tick in range(1, MEMORY_STEPS + 2):
        at_us, taken = 4_000 * tick, HIT[0] if tick >= MEMORY_STEPS else ZERO
        if taken != ZERO and is_followed:
            monitor.estimator.followed = [reckoned()]
        sent = ImuSample(at_us, plus((0.0, 0.0, -GRAVITY_M_S2), -1.0, taken), (1e-12 * at_us, 0.0, 0.0))
        measured = ScaledImu(at_us, (0.0, 0.0, -GRAVITY_M_S2), sent.angular_velocity_frd_rad_s)
        advance(monitor, [sent, measured], situation, at_us)
    # Then its accelerometer shows none after it
    shown = ZERO if is_followed else plus(ZERO, -1.0, HIT[0])
    assert monitor.estimator.strapdown.acceleration_ned_m_s2 == pytest.approx(shown, abs=1e-6)


def test_a_real_px4_is_asked_for_what_it_measures():
    # 40 ms: its estimator moves a bias by 0.3 m/s^2 in 0.25 s
    asked = {request.parameters for request in PX4.streams}
    assert asked == {(MessageId.SCALED_IMU, 40_000)}
