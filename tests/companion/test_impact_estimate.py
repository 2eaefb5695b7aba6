"""v_c and x(t_c), the push's impulse, the obstacle's normal: each against motion made by hand."""

import math
import random

import pytest

from companion.messages import ImuSample, LocalPosition, Odometry
from companion.reflex.config import EstimateConfig
from companion.reflex.detector import Impact, ImpactKind
from companion.reflex.impact import ContactForce, ImpactEstimator
from tests.companion.watching import Watch

CONFIG = EstimateConfig()
CONTACT_US = 10_000_000
LEVEL = (1.0, 0.0, 0.0, 0.0)
STILL = (0.0, 0.0, 0.0)


def told(estimator, t_us, velocity_ned_m_s, position_ned_m=STILL):
    """The vehicle's reports at one time."""
    estimator.update(Odometry(t_us, position_ned_m, velocity_ned_m_s, 0))
    estimator.update(LocalPosition(t_us, position_ned_m, velocity_ned_m_s))


def approaching(acceleration_m_s2=0.0, noise_m_s=0.0, seed=1, until_us=CONTACT_US):
    """An estimator that was told of a vehicle on its way north, at x = 4 m with 2 m/s when the contact begins."""
    rng, estimator = random.Random(seed), ImpactEstimator(CONFIG)
    for t_us in range(CONTACT_US - 1_000_000, until_us, 20_000):
        t = (t_us - CONTACT_US) * 1e-6
        off = [rng.gauss(0.0, noise_m_s) for _ in range(3)]
        speed_m_s, north_m = 2.0 + acceleration_m_s2 * t, 4.0 + 2.0 * t + 0.5 * acceleration_m_s2 * t * t
        told(estimator, t_us, (speed_m_s + off[0], off[1], off[2]), (north_m, 1.0, -1.5))
    return estimator


def begun(estimator, free_until_us=CONTACT_US):
    impact = Impact(free_until_us + 4_000, free_until_us, (-20.0, 0.0, 0.0))
    return estimator.begin(impact)


@pytest.mark.parametrize("acceleration", [0.0, 2.0, -0.52])
def test_place_and_velocity_of_a_clean_approach_are_those_of_the_contact(acceleration):
    estimate = begun(approaching(acceleration))
    assert estimate.velocity_ned_m_s == pytest.approx((2.0, 0.0, 0.0), abs=0.05)
    assert estimate.position_ned_m == pytest.approx((4.0, 1.0, -1.5), abs=0.005)


def test_the_stated_error_of_v_c_is_that_of_a_good_velocity_and_five_percent_of_it_at_most():
    found = [begun(approaching(noise_m_s=0.03, seed=seed)) for seed in range(60)]
    rms = math.sqrt(sum((each.velocity_ned_m_s[0] - 2.0) ** 2 for each in found) / len(found))
    assert 0.5 * found[0].velocity_error_m_s < rms < 1.5 * found[0].velocity_error_m_s < 0.05 * 2.0


@pytest.mark.parametrize("late_us", [500, 20_000, 100_000, 290_000])
def test_what_is_told_after_the_contact_or_in_its_millisecond_changes_nothing(late_us):
    # Given reports that go on 3 m/s off; one's stamp is cut to the millisecond before the contact
    estimator = approaching()
    for t_us in range(CONTACT_US - 500, CONTACT_US + late_us, 20_000):
        told(estimator, t_us, (-1.0, 0.0, 0.0))
    assert begun(estimator).velocity_ned_m_s == pytest.approx((2.0, 0.0, 0.0))


def pushed(pushes, every_us=4_000):
    contact = ContactForce((0.0, 0.0, -9.81), 5_000, 156.9)
    for number, force in enumerate(pushes, start=1):
        contact.add(ImuSample(1_000_000 + number * every_us, (force, 0.0, -9.81), STILL), every_us, LEVEL)
    return contact


@pytest.mark.parametrize(
    ("pushes", "every_us"),
    [
        ([-60.0] * 5, 4_000),
        ([-20.0] * 2, 4_000),
        ([-20.0] * 5, 20_000),
        ([-3.0, -30.0, -4.0, -3.0], 4_000),
        ([-19.0, 23.6, -13.1, -4.7], 4_000),
    ],
    ids=["may have clipped", "too short to tell", "gaps", "over in one window", "guards that clatter"],
)
def test_what_may_have_been_more_is_a_lower_bound(pushes, every_us):
    contact = pushed(pushes, every_us)
    assert contact.has_gap or not contact.is_fully_measured


def test_the_watch_tells_t_c_v_c_normal_impulse_and_class():
    """North at 1.5 m/s, a wall stops the vehicle with 30 m/s^2 for 50 ms."""
    hit_us = 3_002_000

    def pushed_us(t):
        return max(0, min(t - hit_us, 50_000))

    watch = Watch().fly(
        4_400_000,
        push=lambda t: (-30.0 * (pushed_us(t) - pushed_us(t - 4_000)) / 4_000, 0.0, 0.0),
        velocity=lambda t: (1.5 - 30e-6 * pushed_us(t), 0.0, 0.0),
        place=lambda t: (1.5e-6 * t, 0.0, -3.0),
    )
    (final,) = watch.finished
    assert final.impact.kind is ImpactKind.WALL
    assert abs(final.time_boot_us - hit_us) < 2_000
    assert final.velocity_ned_m_s == pytest.approx((1.5, 0.0, 0.0), abs=0.03)
    assert final.position_ned_m[0] == pytest.approx(1.5 * hit_us * 1e-6, abs=0.03)
    assert final.normal.direction_ned == pytest.approx((-1.0, 0.0, 0.0), abs=0.15)
    assert final.impulse_m_s == pytest.approx(1.5, abs=0.05)
    assert not final.is_lower_bound
    assert final.is_fully_measured


@pytest.mark.parametrize(("hides_clipping", "normal_deg"), [(False, 45.0), (True, 0.0)])
def test_a_force_whose_clipping_is_hidden_does_not_show_the_normal(hides_clipping, normal_deg):
    # Given a vehicle that flies north, and a first force that pushes it south-west
    estimator = approaching()
    estimator.hides_clipping = hides_clipping
    n, e, _ = estimator.begin(Impact(CONTACT_US + 4_000, CONTACT_US, (-20.0, -20.0, 0.0))).normal.direction_ned
    # Then the normal is the force's where that is measured, and against the way that it came where it is not
    assert math.degrees(math.atan2(-e, -n)) == pytest.approx(normal_deg, abs=3.0)
