"""A hit that the accelerometer could not show whole: what is believed of the estimate, and when."""

import math

import pytest

from companion.estimate.approach import VelocityFix
from companion.flight.collision import CollisionRecord
from companion.flight.context import FlightContext, Inputs
from companion.flight.doubt import EARLIEST_US, LATEST_US, half_way, is_believed, is_steady
from companion.flight.recovering import Recover
from companion.link.streams import StreamMonitor
from companion.link.vehicle import Vehicle
from companion.messages import LocalPosition
from companion.mission.config import GuardsConfig
from companion.mission.model import Mission
from companion.recovery.climb import Climb
from companion.reflex.laws import Contact

NORTH, SOUTH = (1.0, 0.0, 0.0), (-1.0, 0.0, 0.0)
ZERO = (0.0, 0.0, 0.0)
NOT_KNOWN = Climb(1_000_000, 998_000, (1.0, 0.0, 0.0), GuardsConfig(), 3.0)


def said(north_m_s, at_us=0):
    return LocalPosition(at_us, ZERO, (north_m_s, 0.0, 0.0))


def fixes(missing_m_s, until_us, every_us=33_000):
    """Velocities that lack what `missing_m_s(t)` says, beside a sum that knows all."""
    times = range(until_us - 300_000, until_us + 1, every_us)
    return [VelocityFix(t, (missing_m_s(t * 1e-6), 0.0, 0.0), ZERO, ZERO) for t in times]


def test_an_estimate_that_shows_the_rebound_is_believed_at_once_and_one_that_flies_into_the_wall_is_not():
    assert is_believed(said(-0.7), (2.0, 0.0, 0.0), [SOUTH], (), 60_000)
    assert not is_believed(said(2.0), (2.0, 0.0, 0.0), [SOUTH], (), 60_000)
    assert not is_believed(said(-0.1), (2.0, 0.0, 0.0), [SOUTH], (), 60_000), "less than arms give back"
    assert not is_believed(said(-0.4), (2.0, 0.0, 0.0), [SOUTH], (), 60_000), "arms that met their stops give back more"


def test_an_estimate_that_missed_the_hit_is_not_believed_for_want_of_an_approach():
    # Along a normal that is wrong by 85 degrees nothing came near, so nothing need come back
    aside = (math.cos(math.radians(85.0)), math.sin(math.radians(85.0)), 0.0)
    assert not is_believed(said(2.0), (2.0, 0.0, 0.0), [aside], (), 60_000)
    # nor has a vehicle that hovered come near
    assert not is_believed(said(-0.3), ZERO, [SOUTH], (), 60_000)
    assert is_believed(said(-1.8), ZERO, [SOUTH], (), 60_000)


def test_the_glide_begins_anew_when_a_slow_contact_is_over():
    # Given arms that push for 0.15 s, while which the vehicle still flies in
    slow = Mission.model_validate({"name": "slow", "items": [{"takeoff": {"height_m": 2}}, {"land": {}}]})
    flight = FlightContext(slow, Vehicle(), StreamMonitor(slow.companion.streams))
    flight.origin_ned_m = (0.0, 0.0, 0.0)
    wall = Contact(1_000_000, (3.0, 0.0, -2.0), (1.0, 0.0, 0.0), SOUTH)
    record = CollisionRecord(0, 1_000_000, "fused", wall, (2.6, 0.0, -2.0), SOUTH, 20.0, 1_080_000, 1.2, NOT_KNOWN)
    record.may_be_clipped = False
    flight.collisions.append(record)
    recover = Recover(flight, 0)

    def hears(at_us, north_m, north_m_s):
        sample = LocalPosition(1_000_000 + at_us, (north_m, 0.0, -2.0), (north_m_s, 0.0, 0.0))
        recover.step(flight, Inputs(positions=[sample]), at_us)
        return recover.target(at_us)

    assert hears(80_000, 3.05, 0.2).velocity_ned_m_s[0] == 0.0, "towards the wall is never asked for"
    # When it has left the wall: not with the first sign of it, but when nothing pushes any more
    record.contact_ended_boot_us = 1_150_000
    assert hears(160_000, 3.02, -0.3).position_ned_m[0] > 3.04
    anew = hears(220_000, 2.99, -0.5)
    # Then the way goes on from there, once
    assert (anew.position_ned_m[0], anew.velocity_ned_m_s[0]) == (pytest.approx(2.99), pytest.approx(-0.5))
    assert hears(300_000, 2.90, -0.9).velocity_ned_m_s[0] > -0.7


def test_while_the_estimate_is_put_right_it_is_not_believed_whatever_it_says():
    """A real PX4's error: 3.6 m/s, flat for 0.14 s, then a second-order system of 4.45 rad/s, damped by 0.59."""

    def missing(t_s):
        s = max(0.0, t_s - 0.14)
        return 3.6 * math.exp(-2.6 * s) * math.cos(3.6 * s)

    believed_us = next(
        us
        for us in range(20_000, 2_000_000, 20_000)
        if is_believed(said(1.0), (2.0, 0.0, 0.0), [SOUTH], fixes(missing, us), us)
    )
    assert EARLIEST_US <= believed_us <= LATEST_US + 20_000
    assert abs(missing(believed_us * 1e-6)) < 0.2 * 3.6


def test_steady_is_what_goes_along_with_the_accelerometer():
    assert is_steady(fixes(lambda t: 0.5, 1_000_000), 1_000_000), "a lasting error is not a change"
    assert not is_steady(fixes(lambda t: 2.0 * t, 1_000_000), 1_000_000)
    assert not is_steady((), 1_000_000), "nothing heard, nothing known"


def test_the_way_out_lies_between_a_clipped_push_and_the_way_back():
    turned = (-math.cos(0.5), -math.sin(0.5), 0.0)
    n, e, d = half_way(turned, SOUTH)
    assert (n, e, d) == pytest.approx((-math.cos(0.25), -math.sin(0.25), 0.0))
    assert half_way((-0.17, 0.985, 0.0), SOUTH) == SOUTH, "80 degrees off: the push is wrong"
    assert half_way(turned, ZERO) == turned, "a vehicle that hovered has no way back"


def test_a_fall_before_the_estimate_is_believed_makes_no_ceiling_of_the_wall():
    # Given a clipped hit square into a wall, whose estimate is believed only when it must be
    falling = Mission.model_validate({"name": "fall", "items": [{"takeoff": {"height_m": 2}}, {"land": {}}]})
    flight = FlightContext(falling, Vehicle(), StreamMonitor(falling.companion.streams))
    flight.origin_ned_m = (0.0, 0.0, 0.0)
    wall = Contact(1_000_000, (3.0, 0.0, -2.0), (2.0, 0.0, 0.0), SOUTH)
    record = CollisionRecord(0, 1_000_000, "fused", wall, (2.0, 0.0, -2.0), SOUTH, 150.0, 1_000_000, 2.0, NOT_KNOWN)
    record.doubted_since_boot_us = 1_000_000
    flight.collisions.append(record)
    recover = Recover(flight, 0)
    # When the vehicle has by then fallen 1.5 m
    late = LocalPosition(1_000_000 + LATEST_US + 20_000, (2.8, 0.0, -0.5), (-0.4, 0.0, 3.5))
    recover.step(flight, Inputs(positions=[late]), LATEST_US + 20_000)
    # Then the way out is still away from the wall, and back up to where it was
    assert record.is_believed
    n, e, d = record.setpoint_ned_m
    assert n < 2.7 and abs(e) < 0.1 and d == pytest.approx(-2.0)
    # And of the speed off the wall nothing is said: no velocity of that time was believed
    assert record.report().rebound_speed_m_s is None
