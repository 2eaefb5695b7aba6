"""The kind of an impact: what the vehicle did, then what was asked of it."""

import math
from collections import deque

import pytest

from companion.messages import LocalPosition
from companion.motion.history import MotionHistory
from companion.motion.strapdown import Strapdown, VelocityFix
from companion.reflex.classify import FASTEST_LANDING_M_S, classified, kind_of
from companion.reflex.config import GROUND_M
from companion.reflex.detector import Impact, ImpactKind, Situation

UP, DOWN, BACK = (0.0, 0.0, -30.0), (0.0, 0.0, 30.0), (-30.0, 0.0, 0.0)
FORWARD, HOVER = (2.0, 0.0, 0.0), (0.0, 0.05, 0.0)


def tilted(degrees):
    half = math.radians(degrees) / 2.0
    return (math.cos(half), math.sin(half), 0.0, 0.0)


def kind(
    force,
    velocity=FORWARD,
    tilt_deg=0.0,
    height_m=5.0,
    descends=False,
    by_hand=False,
    has_climbed=True,
    sinking_m_s=None,
):
    situation = Situation(armed=True, height_m=height_m, descent_commanded=descends, flown_by_hand=by_hand)
    return kind_of(force, velocity, tilted(tilt_deg), situation._replace(has_climbed=has_climbed), sinking_m_s)


def sinking(speed_m_s):
    return (0.3, 0.0, speed_m_s)


@pytest.mark.parametrize(
    ("force", "expected"), [(BACK, ImpactKind.WALL), (DOWN, ImpactKind.CEILING), (UP, ImpactKind.FLOOR)]
)
def test_in_flight_the_direction_names_what_was_hit(force, expected):
    assert kind(force) is expected


def test_a_vehicle_that_hovers_away_from_the_ground_was_struck():
    assert kind(BACK, HOVER) is ImpactKind.STRUCK
    # near the ground its own skids may have pushed
    assert kind(BACK, HOVER, height_m=0.9 * GROUND_M) is ImpactKind.WALL
    assert kind(BACK, None) is ImpactKind.WALL


@pytest.mark.parametrize("force", [UP, BACK])
@pytest.mark.parametrize("speed_m_s", [0.2, 2.0])
def test_who_is_sent_down_and_meets_the_ground_upright_and_slow_has_landed(force, speed_m_s):
    near = {"velocity": sinking(speed_m_s), "height_m": 0.5 * GROUND_M, "tilt_deg": 20.0}
    assert kind(force, **near, descends=True) is ImpactKind.LANDING
    assert kind(UP, **near) is ImpactKind.FLOOR


def test_ground_above_the_place_of_arming_is_known_by_its_force_from_below():
    assert kind(UP, sinking(0.5), descends=True) is ImpactKind.LANDING
    assert kind(BACK, sinking(0.5), descends=True) is ImpactKind.WALL
    # A hand that brings it down, rather than along, means the ground, whatever a barometer says of the height
    assert kind(BACK, sinking(0.5), descends=True, by_hand=True) is ImpactKind.LANDING
    assert kind(BACK, sinking(0.2), descends=True, by_hand=True) is ImpactKind.WALL


@pytest.mark.parametrize("descends", [True, False])
@pytest.mark.parametrize(
    ("tilt_deg", "speed_m_s"), [(0.0, 1.05 * FASTEST_LANDING_M_S), (50.0, 0.5), (111.0, 13.0), (180.0, 0.0)]
)
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
    assert kind(UP, **gone_astray, sinking_m_s=0.5) is ImpactKind.LANDING
    assert kind(UP, **gone_astray, sinking_m_s=4.0) is ImpactKind.CRASH


def test_a_wall_met_at_a_steep_tilt_high_up_is_no_crash():
    assert kind(BACK, tilt_deg=60.0) is ImpactKind.WALL
    # even where its own thrust is what pushes, as along a wall that leans
    assert kind(UP, tilt_deg=60.0) is ImpactKind.FLOOR
    assert kind(UP, sinking(0.5), tilt_deg=60.0) is ImpactKind.CRASH


def test_a_fall_is_as_fast_as_at_its_end_and_not_as_its_heights_were_in_the_mean():
    # Given heights of a fall from rest whose last report shows the bounce already
    history, touch_us = MotionHistory(), 400_000
    for time_us in range(0, touch_us, 20_000):
        since_s = 1e-6 * time_us
        history.add(LocalPosition(time_us, (0.0, 0.0, 0.5 * 9.81 * since_s**2 - 0.8), (0.0, 0.0, 9.81 * since_s)))
    history.add(LocalPosition(touch_us, (0.0, 0.0, 0.0), (0.0, 0.0, -1.5)))
    before = VelocityFix(touch_us - 20_000, (0.0, 0.0, 3.7), (0.0, 0.0, 0.0))
    situation = Situation(armed=True, height_m=0.1, history=history, strapdown=Strapdown(fixes=deque([before])))
    # When it meets the ground at 3.7 m/s, whose mean over the last tenths of a second was 2.9 m/s
    impact = Impact(touch_us, touch_us - 10_000, (0.0, 0.0, -100.0))
    # Then it has crashed
    assert classified(impact, (0.0, 0.0, -1.5), situation).kind is ImpactKind.CRASH
