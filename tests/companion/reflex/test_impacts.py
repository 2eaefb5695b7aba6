"""An impact: v_c and x(t_c), impulse and normal, each against motion made by hand; and what kind it is."""

import math

import pytest

from companion.messages import ImuSample, LocalPosition, Odometry
from companion.motion.strapdown import LEVEL, VelocityFix
from companion.reflex.config import CHANGE_RAD, IMPULSE_RAD, EstimateConfig
from companion.reflex.detection.classify import Touch, classified
from companion.reflex.detection.detector import DetectorState, Impact, ImpactKind, Phase, Situation
from companion.reflex.detection.impact import ContactForce, ImpactEstimator
from companion.reflex.surface import Normal, normal_of, with_change

CONTACT_US = 10_000_000
STILL = (0.0, 0.0, 0.0)


def told(estimator, t_us, velocity_ned_m_s, position_ned_m=STILL):
    estimator.update(Odometry(t_us, position_ned_m, velocity_ned_m_s, 0))
    estimator.update(LocalPosition(t_us, position_ned_m, velocity_ned_m_s))


def approaching(acceleration_m_s2=0.0):
    """An estimator that was told of a vehicle on its way north, at x = 4 m with 2 m/s when the contact begins."""
    estimator = ImpactEstimator(EstimateConfig())
    for t_us in range(CONTACT_US - 1_000_000, CONTACT_US, 20_000):
        t = (t_us - CONTACT_US) * 1e-6
        speed_m_s, north_m = 2.0 + acceleration_m_s2 * t, 4.0 + 2.0 * t + 0.5 * acceleration_m_s2 * t * t
        told(estimator, t_us, (speed_m_s, 0.0, 0.0), (north_m, 1.0, -1.5))
    return estimator


def begun(estimator, kind=ImpactKind.WALL, force=(-20.0, 0.0, 0.0)):
    return estimator.begin(Impact(CONTACT_US + 4_000, CONTACT_US, force, kind))


@pytest.mark.parametrize("acceleration", [0.0, 2.0, -0.52])
def test_place_and_velocity_of_a_clean_approach_are_those_of_the_contact(acceleration):
    estimate, after = begun(estimator := approaching(acceleration)), estimator.after
    begun(estimator, ImpactKind.CONTACT)
    assert estimator.after is after, "a hand's touch hides nothing"
    assert estimate.velocity_ned_m_s == pytest.approx((2.0, 0.0, 0.0), abs=0.05)
    assert estimate.position_ned_m == pytest.approx((4.0, 1.0, -1.5), abs=0.005)


@pytest.mark.parametrize("late_us", [500, 20_000, 100_000, 290_000])
def test_what_is_told_after_the_contact_or_in_its_millisecond_changes_nothing(late_us):
    # Given reports that go on 3 m/s off; one's stamp is cut to the millisecond before the contact
    estimator = approaching()
    for t_us in range(CONTACT_US - 500, CONTACT_US + late_us, 20_000):
        told(estimator, t_us, (-1.0, 0.0, 0.0))
    assert begun(estimator).velocity_ned_m_s == pytest.approx((2.0, 0.0, 0.0))


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
    contact = ContactForce((0.0, 0.0, -9.81), 5_000, 156.9)
    for number, force in enumerate(pushes, start=1):
        contact.add(ImuSample(1_000_000 + number * every_us, (force, 0.0, -9.81), STILL), every_us, LEVEL)
    assert contact.has_gap or not contact.is_fully_measured(False, (0.0, 0.0, 0.0))


@pytest.mark.parametrize(
    ("came_m_s", "every_ms", "whole"), [(2.0, 4, False), (0.5, 4, True), (3.0, 20, False), (1.5, 20, True)]
)
def test_a_contact_is_clipped_that_ends_before_it_has_stopped_the_vehicle(came_m_s, every_ms, whole):
    # Given the chatter of a rigid frame, far below the sensor's range: 0.5 m/s, or 1.8 where samples are apart
    contact = ContactForce((0.0, 0.0, -9.81), 5_000, 156.9)
    for number in range(1, 4):
        contact.add(ImuSample(1_000_000 + number * 1000 * every_ms, (-40.0, 0.0, -9.81), STILL), 1000 * every_ms, LEVEL)
    came_ned_m_s = (came_m_s, 0.0, 0.0)
    assert contact.is_fully_measured(False, came_ned_m_s)
    # When it is over and the vehicle would go on into it
    assert contact.is_fully_measured(True, came_ned_m_s) is whole


@pytest.mark.parametrize(("hides_clipping", "normal_deg"), [(False, 45.0), (True, 0.0)])
def test_a_force_whose_clipping_is_hidden_does_not_show_the_normal(hides_clipping, normal_deg):
    # Given a vehicle that flies north, and a first force that pushes it south-west
    estimator = approaching()
    estimator.hides_clipping = hides_clipping
    normal = begun(estimator, force=(-20.0, -20.0, 0.0)).normal
    # Then the normal is the force's where that is measured, and against the way that it came where it is not
    assert angle_deg(normal) == pytest.approx(normal_deg, abs=3.0)


@pytest.mark.parametrize(("pushes", "is_whole"), [(20, True), (5, False)])
def test_a_contact_that_is_over_has_the_normal_of_its_whole_impulse_and_is_whole_if_that_stopped_the_vehicle(
    pushes, is_whole
):
    # Given a vehicle that flies north, and a force that is south-west in its first sample and south in the others
    estimator, state = approaching(), DetectorState(phase=Phase.CONTACT)
    for number in range(pushes + 1):
        sample = ImuSample(CONTACT_US + 4_000 * number, (-30.0 * (number > 0), -30.0 * (number == 1), -9.81), STILL)
        estimator.update(sample)
        if number == 1:
            begun(estimator, force=(-30.0, -30.0, 0.0))
        if number > 1:
            state.last_loud_boot_us = sample.time_boot_us
            estimator.follow(sample, state)
            assert not estimator.estimate.is_final
    # When it is over
    state.phase = Phase.ARMED
    estimator.follow(ImuSample(sample.time_boot_us + 4_000, (0.0, 0.0, -9.81), STILL), state)
    # Then it is known what it was
    found = estimator.estimate
    assert angle_deg(found.normal) == pytest.approx(math.degrees(math.atan2(1, pushes)), abs=0.5)
    assert found.is_final and found.is_fully_measured is is_whole and found.is_lower_bound is not is_whole
    assert found.after.normal == found.normal and found.after.is_fully_measured is is_whole


def turned(angle_deg, size=1.0):
    """South, turned towards the west."""
    angle = math.radians(angle_deg)
    return (-size * math.cos(angle), -size * math.sin(angle), 0.0)


def angle_deg(normal):
    n, e, _ = normal.direction_ned
    return math.degrees(math.atan2(-e, -n))


# In a hover the force alone tells, and what pushes along the flight came from behind.
@pytest.mark.parametrize(
    ("force", "speed_m_s", "normal_deg"),
    [
        (turned(45.0), 2.0, 0.0),
        ((0.0, 0.0, 0.0), 2.0, 0.0),
        (turned(110.0), 2.0, 0.0),
        (turned(130.0), 2.0, 130.0),
        (turned(45.0), 0.4, 45.0),
    ],
)
def test_where_clipping_is_hidden_the_way_that_the_vehicle_came_takes_the_forces_place(force, speed_m_s, normal_deg):
    assert angle_deg(normal_of(force, (speed_m_s, 0.0, 0.0), is_hidden=True)) == pytest.approx(normal_deg, abs=0.1)


def test_without_a_force_the_way_that_it_came_is_all_that_is_known():
    assert angle_deg(normal_of((0.0, 0.0, 0.0), (2.0, 0.0, 0.0))) == pytest.approx(0.0)
    assert normal_of((0.0, 0.0, 0.0), (0.4, 0.0, 0.0)) == Normal()


def test_the_change_of_the_velocity_turns_it_and_leaves_less_error_than_either():
    by_force = normal_of(turned(30.0), (2.0, 0.0, 0.0))
    both, unsure = (with_change(by_force, (2.0, 0.0, 0.0), (-1.0, 0.0, 0.0), error_m_s) for error_m_s in (0.05, 1.0))
    assert angle_deg(both) == pytest.approx(10.1, abs=0.5) and both.error_rad < CHANGE_RAD
    assert angle_deg(both) < angle_deg(unsure) < 30.0 and both.error_rad < unsure.error_rad < IMPULSE_RAD


UP, BACK = (0.0, 0.0, -30.0), (-30.0, 0.0, 0.0)
FORWARD, HOVER = (2.0, 0.0, 0.0), (0.0, 0.05, 0.0)


def kind(
    force, velocity=FORWARD, tilt_deg=0.0, height_m=5.0, descends=False, by_hand=False, has_climbed=True, sinks_m_s=None
):
    situation = Situation(may_crash=True, height_m=height_m, descent_commanded=descends, flown_by_hand=by_hand)
    tilted = (math.cos(math.radians(tilt_deg / 2.0)), math.sin(math.radians(tilt_deg / 2.0)), 0.0, 0.0)
    return Touch(force, velocity, tilted, situation._replace(has_climbed=has_climbed), sinks_m_s).kind


def sinking(speed_m_s):
    return (0.3, 0.0, speed_m_s)


def test_a_vehicle_that_hovers_away_from_the_ground_was_struck():
    assert kind(BACK, HOVER) is ImpactKind.STRUCK
    # near the ground its own skids may have pushed
    assert kind(BACK, HOVER, height_m=0.9) is ImpactKind.WALL
    assert kind(BACK, None) is ImpactKind.WALL


@pytest.mark.parametrize("force", [UP, BACK])
@pytest.mark.parametrize("speed_m_s", [0.2, 3.0])
def test_who_is_sent_down_and_meets_the_ground_upright_and_slow_has_landed(force, speed_m_s):
    near = {"velocity": sinking(speed_m_s), "height_m": 0.5, "tilt_deg": 20.0}
    assert kind(force, **near, descends=True) is ImpactKind.LANDING
    assert kind(UP, **near) is ImpactKind.FLOOR


@pytest.mark.parametrize(("height_m", "touched"), [(0.07, ImpactKind.LANDING), (0.15, ImpactKind.WALL)])
def test_what_is_as_low_as_its_feet_scrapes_along_the_ground(height_m, touched):
    assert kind(BACK, (1.0, 0.0, 0.0), height_m=height_m) is touched


def test_ground_above_the_place_of_arming_is_known_by_its_force_from_below():
    assert kind(UP, sinking(0.5), descends=True) is ImpactKind.LANDING
    assert kind(BACK, sinking(0.5), descends=True) is ImpactKind.WALL
    # A hand that brings it down, rather than along, means the ground, whatever a barometer says of the height
    assert kind(BACK, sinking(0.5), descends=True, by_hand=True) is ImpactKind.LANDING
    assert kind(BACK, sinking(0.2), descends=True, by_hand=True) is ImpactKind.WALL


@pytest.mark.parametrize("descends", [True, False])
@pytest.mark.parametrize(("tilt_deg", "speed_m_s"), [(0.0, 3.3), (50.0, 0.5), (111.0, 13.0), (180.0, 0.0)])
def test_ground_met_fast_or_tilted_is_a_crash_whatever_was_asked(tilt_deg, speed_m_s, descends):
    assert kind(UP, sinking(speed_m_s), tilt_deg, 0.2, descends) is ImpactKind.CRASH


def test_what_has_not_climbed_since_it_stood_on_the_ground_cannot_have_fallen():
    # Given a climb rate that vibration has made wrong
    gone_astray = {"velocity": sinking(9.0), "height_m": -3.0, "descends": True}
    # Then skids that touch in a take-off, or a bounce, are no crash by their speed; a vehicle that tips over is one
    assert kind(UP, **gone_astray) is ImpactKind.CRASH
    assert kind(UP, **gone_astray, has_climbed=False) is ImpactKind.LANDING
    assert kind(UP, **gone_astray, has_climbed=False, tilt_deg=60.0) is ImpactKind.CRASH
    # What falls loses height by the reported heights, too
    assert kind(UP, **gone_astray, sinks_m_s=0.5) is ImpactKind.LANDING
    assert kind(UP, **gone_astray, sinks_m_s=4.0) is ImpactKind.CRASH


def test_a_wall_met_at_a_steep_tilt_high_up_is_no_crash():
    assert kind(BACK, tilt_deg=60.0) is ImpactKind.WALL
    # even where its own thrust is what pushes, as along a wall that leans
    assert kind(UP, tilt_deg=60.0) is ImpactKind.FLOOR
    assert kind(UP, sinking(0.5), tilt_deg=60.0) is ImpactKind.CRASH


def test_a_fall_is_as_fast_as_at_its_end_and_not_as_its_heights_were_in_the_mean():
    # Given heights of a fall from rest whose last report shows the bounce already
    motion, touch_us = ImpactEstimator(EstimateConfig()), 400_000
    for time_us in range(0, touch_us, 20_000):
        since_s = 1e-6 * time_us
        place = (0.0, 0.0, 0.5 * 9.81 * since_s**2 - 0.8)
        motion.history.add(LocalPosition(time_us, place, (0.0, 0.0, 9.81 * since_s)))
    motion.history.add(LocalPosition(touch_us, (0.0, 0.0, 0.0), (0.0, 0.0, -1.5)))
    motion.strapdown.fixes.append(VelocityFix(touch_us - 20_000, (0.0, 0.0, 3.7), (0.0, 0.0, 0.0)))
    situation = Situation(may_crash=True, height_m=0.1)
    # When it meets the ground at 3.7 m/s, whose mean over the last tenths of a second was 2.9 m/s
    impact = Impact(touch_us, touch_us - 10_000, (0.0, 0.0, -100.0))
    # Then it has crashed
    assert classified(impact, (0.0, 0.0, -1.5), situation, motion).kind is ImpactKind.CRASH
