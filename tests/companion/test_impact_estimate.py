"""v_c with the accelerometer's help, the push's impulse, the obstacle's normal: each against motion made by hand."""

import math
import random

import pytest

from companion.detection.interface import ImpactKind, Situation
from companion.detection.watch import advance, start_watch
from companion.estimate.approach import VelocityFix, velocity_at
from companion.estimate.normal import normal_of
from companion.estimate.push import Push
from companion.messages import Attitude, ImuSample, LandedState, LocalPosition, Odometry, Vibration
from companion.mission.config import CompanionConfig, EstimateConfig

CONFIG = EstimateConfig()
CONTACT_US = 10_000_000
LEVEL = (1.0, 0.0, 0.0, 0.0)


def fixes(seed, seconds=5.0, acceleration=2.0, delay_s=0.02, bias=0.05, noise=0.032, every_us=32_000):
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


def test_v_c_is_right_to_a_few_centimetres_whatever_the_delay_the_bias_and_the_errors_that_last():
    errors = [
        velocity_at(list(fixes(seed, delay_s=0.02 * (seed % 2))), CONTACT_US, (0.0, 0.0, 0.0), CONFIG)[0][0] - 2.0
        for seed in range(60)
    ]
    assert math.sqrt(sum(e * e for e in errors) / len(errors)) < 0.03


def test_what_the_filter_says_of_its_own_error_is_true():
    pairs = [velocity_at(list(fixes(seed)), CONTACT_US, (0.0, 0.0, 0.0), CONFIG) for seed in range(60)]
    rms = math.sqrt(sum((v[0] - 2.0) ** 2 for v, _ in pairs) / len(pairs))
    assert 0.4 < rms / pairs[0][1] < 1.5


def test_an_accelerometer_that_contradicts_the_velocities_is_not_listened_to():
    wrong = [VelocityFix(f.time_boot_us, f.velocity_ned_m_s, (0.0, 0.0, 0.0), (0.0, 0.0, 0.0)) for f in fixes(1)]
    assert velocity_at(wrong, CONTACT_US, (0.0, 0.0, 0.0), CONFIG) is None
    assert velocity_at([], CONTACT_US, (0.0, 0.0, 0.0), CONFIG) is None


STILL = (0.0, 0.0, 0.0)


def slide(friction, tangent_m_s, yaw_rate=0.0, samples=10):
    """A wall to the north (normal south) that pushes ten times; the vehicle slides east, then is turned."""
    parts, total = [], (0.0, 0.0, 0.0)
    for k in range(samples):
        east_m_s = tangent_m_s + total[1]
        # Tangent east, seen from the wall: the contact point goes with v and with the turning.
        sliding = east_m_s + 0.2 * yaw_rate * k / samples
        push = (-0.2, -0.2 * friction * max(-1.0, min(1.0, sliding / 0.02)), 0.0)
        parts.append((push, (0.0, 0.0, yaw_rate * k / samples), total))
        total = (total[0] + push[0], total[1] + push[1], 0.0)
    return parts


def off_deg(normal):
    return math.degrees(math.atan2(normal[1], -normal[0]))


@pytest.mark.parametrize("friction", [0.0, 0.1, 0.2, 0.3])
@pytest.mark.parametrize(("tangent_m_s", "most_deg"), [(0.0, 3.0), (0.5, 14.0), (-0.5, 14.0), (1.5, 9.0)])
def test_the_normal_is_found_through_any_friction(friction, tangent_m_s, most_deg):
    """Worst where friction leans the push straight back, as a head-on hit would be without any."""
    normal = normal_of(slide(friction, tangent_m_s), (1.5, tangent_m_s, 0.0), 0.2)
    assert abs(off_deg(normal)) < most_deg
    assert math.hypot(*normal) == pytest.approx(1.0)


def test_friction_that_changes_sides_as_the_vehicle_turns_gives_itself_away():
    """Sliding east at first and west at the end: the truth lies between, whichever way the sum leans."""
    parts = slide(0.3, 0.6, yaw_rate=-9.0)
    assert abs(off_deg(normal_of(parts, (1.5, 0.6, 0.0), 0.2))) < 4.0


def test_a_leaning_walls_normal_is_found_where_the_vehicle_slides_up_it():
    """The wall leans over by 40 degrees; friction of 0.3 holds the vehicle that slides up along it."""
    c, s = math.cos(math.radians(40.0)), math.sin(math.radians(40.0))
    parts, total = [], STILL
    for _ in range(10):
        push = (-0.1 * (c + 0.3 * s), 0.0, 0.1 * (s - 0.3 * c))
        # Up the wall is (-s, 0, -c) from the vehicle's north; it goes north and is turned up by the wall.
        parts.append((push, STILL, total))
        total = tuple(a + b for a, b in zip(total, push, strict=True))
    n, _, d = normal_of(parts, (1.5, 0.0, 0.0), 0.2)
    assert abs(math.degrees(math.atan2(d, -n)) - 40.0) < 13.0


def test_a_ceilings_normal_is_the_pushs_direction_and_no_push_has_none():
    assert normal_of([((0.0, 0.1, 2.0), STILL, STILL)], (0.0, 0.0, -1.0), 0.2)[2] > 0.99
    assert normal_of([], (0.0, 0.0, 0.0), 0.2) == (0.0, 0.0, 0.0)


def imu(t_us, push, yaw_rate=0.0):
    return ImuSample(t_us, (push, 0.0, -9.81), (0.0, 0.0, yaw_rate))


def pushed(pushes, every_us=4_000, yaw_rate=0.0):
    push = Push((0.0, 0.0, -9.81), LEVEL, 5_000, 156.9, 1_000_000)
    for number, (force, loud) in enumerate(pushes, start=1):
        push.add(imu(1_000_000 + number * every_us, force, yaw_rate), loud)
    return push


def test_the_impulse_is_the_sum_of_the_loud_samples_and_of_what_lies_between_them():
    push = pushed([(-20.0, True), (-40.0, True), (-1.0, False), (-10.0, True), (-5.0, False)])
    assert push.impulse_ned_m_s == pytest.approx((-0.284, 0.0, 0.0))
    assert push.peak_m_s2 == pytest.approx(40.0)
    assert not push.is_lower_bound


def test_the_first_window_tells_when_the_contact_began():
    """A quarter of the second window's mean: three quarters of it (5 ms) were still free."""
    push = pushed([(-10.0, True), (-40.0, True)])
    assert push.begun_boot_us == 1_004_000 - 1_250


def test_a_vehicle_that_turns_in_the_contact_is_followed():
    push = pushed([(-20.0, True)] * 25, yaw_rate=math.radians(90.0) / 0.096)
    north, east, _ = push.impulse_ned_m_s
    assert math.degrees(math.atan2(-east, -north)) == pytest.approx(45.0, abs=2.0)


@pytest.mark.parametrize(
    ("pushes", "every_us"),
    [([(-60.0, True)] * 5, 4_000), ([(-20.0, True)] * 2, 4_000), ([(-20.0, True)] * 5, 20_000)],
    ids=["may have clipped", "too short to tell", "gaps"],
)
def test_what_may_have_been_more_is_a_lower_bound(pushes, every_us):
    assert pushed(pushes, every_us).is_lower_bound


def test_the_watch_tells_t_c_v_c_normal_impulse_and_class_and_takes_clipping_counts_to_heart():
    """North at 1.5 m/s, a wall stops the vehicle with 30 m/s^2 for 50 ms; the sensor says a second later it clipped."""
    watch = start_watch(CompanionConfig(detector="fused"), 0)
    situation = Situation(armed=True, landed_state=LandedState.IN_AIR, height_m=3.0)
    finished, hit_us = [], 3_002_000
    for t in range(4_000, 4_400_000, 4_000):
        inside = max(0, min(t, hit_us + 50_000) - max(t - 4_000, hit_us)) / 4_000
        speed = 1.5 - 30.0 * 1e-6 * max(0, min(t - hit_us, 50_000))
        samples = [ImuSample(t, (-30.0 * inside, 0.0, -9.81), (0.0, 0.0, 0.0))]
        if t % 32_000 == 0:
            samples.append(Odometry(t, (0.0, 0.0, -3.0), (speed, 0.0, 0.0), 0))
            samples.append(LocalPosition(t, (1.5 * t * 1e-6, 0.0, -3.0), (speed, 0.0, 0.0)))
            samples.append(Attitude(t, LEVEL))
        if t % 1_000_000 == 0:
            samples.append(Vibration(t, 0.0, 0.0, (0 if t < hit_us else 9, 0, 0)))
        finished += advance(watch, samples, situation, t).finished
    (final,) = finished
    assert final.kind is ImpactKind.WALL
    assert abs(final.time_boot_us - hit_us) < 2_000
    assert final.velocity_ned_m_s == pytest.approx((1.5, 0.0, 0.0), abs=0.03)
    assert final.position_ned_m[0] == pytest.approx(1.5 * hit_us * 1e-6, abs=0.03)
    assert final.normal_ned == pytest.approx((-1.0, 0.0, 0.0), abs=0.03)
    assert final.impulse_m_s == pytest.approx(1.5, abs=0.05)
    assert (final.is_lower_bound, watch.estimate.is_lower_bound) == (False, True)
