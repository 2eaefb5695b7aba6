"""v_c with the accelerometer's help, the push's impulse, the obstacle's normal: each against motion made by hand."""

import math
import random

import pytest

from companion.detection.interface import Impact, ImpactKind, Situation
from companion.estimate import approach
from companion.estimate.config import EstimateConfig
from companion.estimate.contact_force import ContactForce
from companion.estimate.impact import ImpactEstimator
from companion.messages import Attitude, ImuSample, LandedState, LocalPosition, Odometry, Sample, Vibration
from companion.mission.config import CompanionConfig
from companion.motion.inertial import VelocityFix
from companion.reflex.monitor import advance, start_monitor

CONFIG = EstimateConfig()
CONTACT_US = 10_000_000
LEVEL = (1.0, 0.0, 0.0, 0.0)
STILL = (0.0, 0.0, 0.0)


def fixes(seed, seconds=1.0, acceleration=2.0, delay_s=0.02, bias=0.05, noise=0.032, every_us=32_000):
    """Velocities north at constant acceleration, 2 m/s at the contact, errors as the simulated estimate has them."""
    rng = random.Random(seed)
    error = rng.gauss(0.0, noise)
    keep = math.exp(-every_us * 1e-6 / 0.3)
    for t_us in range(CONTACT_US - round(seconds * 1e6), CONTACT_US - 5_000, every_us):
        t = (t_us - CONTACT_US) * 1e-6
        error = keep * error + rng.gauss(0.0, noise * math.sqrt(1 - keep**2))
        velocity = 2.0 + acceleration * (t - delay_s) + error
        measured = acceleration + bias
        yield VelocityFix(t_us, (velocity, 0.0, 0.0), (measured * t, 0.0, 0.0), (measured, 0.0, 0.0))


def velocity_at(heard):
    return approach.velocity_at(list(heard), CONTACT_US, (0.0, 0.0, 0.0), CONFIG)


def test_v_c_is_right_to_a_few_centimetres_whatever_the_delay_the_bias_and_the_errors_that_last():
    errors = [velocity_at(fixes(seed, delay_s=0.02 * (seed % 2)))[0][0] - 2.0 for seed in range(60)]
    assert math.sqrt(sum(e * e for e in errors) / len(errors)) < 0.04


def test_the_stated_error_of_v_c_is_true():
    pairs = [velocity_at(fixes(seed)) for seed in range(60)]
    rms = math.sqrt(sum((v[0] - 2.0) ** 2 for v, _ in pairs) / len(pairs))
    assert 0.4 < rms / pairs[0][1] < 1.5


def test_an_accelerometer_that_contradicts_the_velocities_is_not_listened_to():
    wrong = [VelocityFix(f.time_boot_us, f.velocity_ned_m_s, (0.0, 0.0, 0.0), (0.0, 0.0, 0.0)) for f in fixes(1)]
    assert velocity_at(wrong) is None
    assert velocity_at([]) is None


@pytest.mark.parametrize(("off_m_s", "is_taken"), [(0.06, True), (0.10, False)])
def test_velocities_that_the_accelerometer_denies_by_more_than_their_noise_contradict_it(off_m_s, is_taken):
    # Given velocities with a noise of 0.04 m/s, that are off by so much to either side of the integral
    times_us = range(CONTACT_US - 1_000_000, CONTACT_US - 5_000, 20_000)
    signs = [off_m_s if number % 2 else -off_m_s for number in range(len(times_us))]
    heard = [VelocityFix(t, (2.0 + off, off, off), STILL, STILL) for t, off in zip(times_us, signs, strict=True)]
    assert (velocity_at(heard) is not None) == is_taken


def test_a_drift_counts_as_far_as_an_accelerometers_bias_may_explain_it():
    # Given velocities that leave the integral by 0.1 m/s in the last second
    times_us = range(CONTACT_US - 1_000_000, CONTACT_US - 5_000, 20_000)
    heard = [VelocityFix(t, (2.0 + 1e-7 * (t - CONTACT_US), 0.0, 0.0), STILL, STILL) for t in times_us]
    # Then a third of that is taken for a bias, and the rest for noise
    velocity, _ = velocity_at(heard)
    assert velocity[0] == pytest.approx(1.967, abs=0.003)


@pytest.mark.parametrize("late_us", [0, 100_000, 290_000])
def test_a_hit_that_is_told_late_has_the_velocity_from_before_it(late_us):
    # Given velocities that go on after the contact, 3 m/s off
    heard = list(fixes(2))
    for t_us in range(CONTACT_US + 20_000, CONTACT_US + late_us, 20_000):
        heard.append(VelocityFix(t_us, (-1.0, 0.0, 0.0), (0.0, 0.0, 0.0), (0.0, 0.0, 0.0)))
    velocity, _ = velocity_at(heard)
    assert velocity[0] == pytest.approx(2.0, abs=0.1)


@pytest.mark.parametrize(
    ("jumps", "velocity_m_s"),
    [
        ({}, 2.0),
        # A jump that the estimator counts itself, and a contact: what was before is no measure any more
        ({"reset_counter": 1}, 5.0),
        ({"touched_us": CONTACT_US - 800_000}, 5.0),
    ],
)
def test_v_c_is_found_from_velocities_that_belong_together(jumps, velocity_m_s):
    # Given a vehicle at 2 m/s that tells 5 m/s in its last 0.8 s
    estimator = ImpactEstimator(CONFIG)
    estimator.update(Attitude(0, LEVEL, (0.0, 0.0, 0.0)))
    for t_us in range(CONTACT_US - 4_000_000, CONTACT_US, 4_000):
        estimator.update(ImuSample(t_us, (0.0, 0.0, -9.80665), (0.0, 0.0, 0.0)))
        estimator.update(Attitude(t_us, LEVEL, (0.0, 0.0, 0.0)))
        is_last = t_us > CONTACT_US - 800_000
        if t_us == jumps.get("touched_us"):
            estimator.contact_ended_boot_us = t_us
        if t_us % 20_000 == 0:
            told, count = (5.0, jumps.get("reset_counter", 0)) if is_last and jumps else (2.0, 0)
            estimator.update(Odometry(t_us, (0.0, 0.0, 0.0), (told, 0.0, 0.0), count))
    found = estimator._velocity(CONTACT_US)
    assert found is not None
    assert found[0][0] == pytest.approx(velocity_m_s, abs=0.05)


@pytest.mark.parametrize(("is_second", "normal_deg"), [(False, 19.0), (True, 0.0)])
def test_a_vehicle_that_slides_along_a_wall_is_not_sent_along_it_by_the_second_hit(is_second, normal_deg):
    # Given a vehicle that flies west, after a hit that clipping hid a part of or without one
    estimator = ImpactEstimator(CONFIG)
    for t_us in range(CONTACT_US - 1_000_000, CONTACT_US, 4_000):
        estimator.update(ImuSample(t_us, (0.0, 0.0, -9.80665), (0.0, 0.0, 0.0)))
        estimator.update(Attitude(t_us, LEVEL, (0.0, 0.0, 0.0)))
        if t_us % 20_000 == 0:
            estimator.update(Odometry(t_us, (0.0, 0.0, 0.0), (0.0, -1.5, 0.0), 0))
            estimator.update(LocalPosition(t_us, (0.0, 0.0, 0.0), (0.0, -1.5, 0.0)))
    if is_second:
        estimator.validity.invalidate(CONTACT_US - 300_000)
    # When something pushes it south
    estimate = estimator.begin(Impact(CONTACT_US, CONTACT_US - 4_000, (-20.0, 0.0, 0.0)), Situation())
    # Then the way that it came from says where off is in a first hit alone
    n, e, _ = estimate.normal.direction_ned
    assert math.degrees(math.atan2(e, -n)) == pytest.approx(normal_deg, abs=2.0)


def imu(t_us, contact, yaw_rate=0.0):
    return ImuSample(t_us, (contact, 0.0, -9.81), (0.0, 0.0, yaw_rate))


def pushed(pushes, every_us=4_000, yaw_rate=0.0):
    contact = ContactForce((0.0, 0.0, -9.81), STILL, 5_000, 156.9, 1_000_000)
    for number, (force, loud) in enumerate(pushes, start=1):
        turned_rad = 0.5e-6 * (number - 1) * every_us * yaw_rate
        attitude = (math.cos(turned_rad), 0.0, 0.0, math.sin(turned_rad))
        contact.add(imu(1_000_000 + number * every_us, force, yaw_rate), attitude, loud)
    return contact


def test_the_impulse_is_the_sum_of_the_loud_samples():
    contact = pushed([(-20.0, True), (-40.0, True), (-1.0, False), (-10.0, True), (-5.0, False)])
    assert contact.impulse_ned_m_s == pytest.approx((-0.28, 0.0, 0.0))
    assert contact.peak_m_s2 == pytest.approx(40.0)


def test_of_the_time_before_the_first_sample_its_own_window_counts():
    # Given a stream of 50 Hz whose windows are 5 ms, and a contact that one of them shows
    contact = pushed([(-20.0, True), (0.0, False)], every_us=20_000)
    # Then the impulse is what was seen, and no more than a lower bound
    assert contact.impulse_ned_m_s == pytest.approx((-0.1, 0.0, 0.0)) and contact.has_gap


def test_a_push_that_rises_and_falls_within_the_range_was_measured_whole():
    assert pushed([(-10.0, True), (-25.0, True), (-30.0, True), (-22.0, True), (-8.0, True)]).is_fully_measured


def test_the_first_window_tells_when_the_contact_began():
    """A quarter of the second window's mean: three quarters of it (5 ms) were still free."""
    contact = pushed([(-10.0, True), (-40.0, True)])
    assert contact.begun_boot_us == 1_004_000 - 1_250


def test_a_vehicle_that_turns_in_the_contact_is_followed():
    contact = pushed([(-20.0, True)] * 25, yaw_rate=math.radians(90.0) / 0.096)
    north, east, _ = contact.impulse_ned_m_s
    assert math.degrees(math.atan2(-east, -north)) == pytest.approx(45.0, abs=2.0)


@pytest.mark.parametrize(
    ("pushes", "every_us"),
    [
        ([(-60.0, True)] * 5, 4_000),
        ([(-20.0, True)] * 2, 4_000),
        ([(-20.0, True)] * 5, 20_000),
        ([(-3.0, True), (-30.0, True), (-4.0, True), (-3.0, True)], 4_000),
        ([(-19.0, True), (23.6, True), (-13.1, True), (-4.7, True)], 4_000),
    ],
    ids=["may have clipped", "too short to tell", "gaps", "over in one window", "guards that clatter"],
)
def test_what_may_have_been_more_is_a_lower_bound(pushes, every_us):
    contact = pushed(pushes, every_us)
    assert contact.has_gap or not contact.is_fully_measured


def test_the_watch_tells_t_c_v_c_normal_impulse_and_class_and_takes_clipping_counts_to_heart():
    """North at 1.5 m/s, a wall stops the vehicle with 30 m/s^2 for 50 ms; the sensor says a second later it clipped."""
    monitor = start_monitor(CompanionConfig(detector="fused"), 0)
    situation = Situation(armed=True, landed_state=LandedState.IN_AIR, height_m=3.0)
    finished, hit_us = [], 3_002_000
    for t in range(4_000, 4_400_000, 4_000):
        inside = max(0, min(t, hit_us + 50_000) - max(t - 4_000, hit_us)) / 4_000
        speed = 1.5 - 30.0 * 1e-6 * max(0, min(t - hit_us, 50_000))
        samples: list[Sample] = [ImuSample(t, (-30.0 * inside, 0.0, -9.81), (0.0, 0.0, 0.0))]
        if t % 32_000 == 0:
            samples.append(Odometry(t, (0.0, 0.0, -3.0), (speed, 0.0, 0.0), 0))
            samples.append(LocalPosition(t, (1.5 * t * 1e-6, 0.0, -3.0), (speed, 0.0, 0.0)))
            samples.append(Attitude(t, LEVEL))
        if t % 1_000_000 == 0:
            samples.append(Vibration(t, 0.0, 0.0, (0 if t < hit_us else 9, 0, 0)))
        finished += advance(monitor, samples, situation, t).finished
    (final,) = finished
    assert final.kind is ImpactKind.WALL
    assert abs(final.time_boot_us - hit_us) < 2_000
    assert final.velocity_ned_m_s == pytest.approx((1.5, 0.0, 0.0), abs=0.03)
    assert final.position_ned_m[0] == pytest.approx(1.5 * hit_us * 1e-6, abs=0.03)
    assert final.normal.direction_ned == pytest.approx((-1.0, 0.0, 0.0), abs=0.15)
    assert final.impulse_m_s == pytest.approx(1.5, abs=0.05)
    assert (final.is_lower_bound, monitor.estimate.is_lower_bound) == (False, True)
    assert final.is_fully_measured
