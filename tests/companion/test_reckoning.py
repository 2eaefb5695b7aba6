"""The motion after a hit that the accelerometer could not show whole: what is reckoned, when the estimate counts."""

import math

import pytest

from companion.estimate.approach import VelocityFix
from companion.estimate.strapdown import Strapdown
from companion.flight.collision import CollisionRecord
from companion.flight.context import FlightContext, Inputs
from companion.flight.recovering import Recover, agreed_normal
from companion.link.streams import StreamMonitor
from companion.link.vehicle import Vehicle
from companion.messages import LocalPosition
from companion.mission.model import Mission
from companion.reflex.config import BEGUN_US, OVER_US
from companion.reflex.laws import Contact
from companion.reflex.planner import Moving
from companion.reflex.reckoning import Reckoning, half_way, is_steady, lean_ahead

NORTH, SOUTH = (1.0, 0.0, 0.0), (-1.0, 0.0, 0.0)
ZERO, LEVEL = (0.0, 0.0, 0.0), (1.0, 0.0, 0.0, 0.0)
HIT_US = 1_000_000


def reckoned(velocity=(2.0, 0.0, 0.0), normal=SOUTH, restitution=0.2, **doubt):
    contact = Contact(HIT_US, (3.0, 0.0, -2.0), velocity, normal)
    return Reckoning(contact, HIT_US, contact.rebound(restitution), **doubt)


def said(north_m_s, since_us=60_000, position=(3.0, 0.0, -2.0)):
    return LocalPosition(HIT_US + since_us, position, (north_m_s, 0.0, 0.0))


def fixes(missing_m_s, until_us, every_us=33_000):
    """Velocities that lack what `missing_m_s(t)` says, beside a sum that knows all."""
    times = range(until_us - 300_000, until_us + 1, every_us)
    return [VelocityFix(HIT_US + t, (missing_m_s(t * 1e-6), 0.0, 0.0), ZERO, ZERO) for t in times]


def believed(reckoning, sample, normals=(SOUTH,), known=()):
    return reckoning.judge(sample, normals, known, 1.0)


def test_an_estimate_that_shows_the_rebound_is_believed_at_once_and_one_that_flies_into_the_wall_is_not():
    assert believed(reckoned(), said(-0.7))
    assert not believed(reckoned(), said(2.0))
    assert not believed(reckoned(), said(-0.1)), "less than arms give back"
    assert not believed(reckoned(), said(-0.4)), "arms that met their stops give back more"


def test_a_rebound_is_seen_along_the_change_of_velocity_where_the_normal_is_wrong():
    # Given a pole met beside its middle, its normal wrong by a right angle
    aside = reckoned(velocity=(1.4, -0.2, 0.0), normal=(0.0, -1.0, 0.0))
    sample = LocalPosition(HIT_US + 60_000, (3.0, 0.0, -2.0), (0.2, 0.9, 0.0))
    assert believed(aside, sample, [(0.0, -1.0, 0.0)])


def test_an_estimate_that_missed_the_hit_is_not_believed_for_want_of_an_approach():
    # Along a normal that is wrong by 85 degrees nothing came near, so nothing need come back
    aside = (math.cos(math.radians(85.0)), math.sin(math.radians(85.0)), 0.0)
    assert not believed(reckoned(), said(2.0), [aside])
    # nor has a vehicle that hovered come near
    assert not believed(reckoned(velocity=ZERO), said(-0.3))
    assert believed(reckoned(velocity=ZERO), said(-0.8))


@pytest.mark.parametrize(
    ("velocity", "position", "is_right"),
    [
        ((-0.5, 0.1, 0.0), (3.0, 0.0, -2.0), True),
        ((-2.0, 0.0, 0.0), (3.0, 0.0, -2.0), True),  # as stiff as can be
        ((-4.0, 0.0, 0.0), (3.0, 0.0, -2.0), False),  # faster off than on
        ((0.0, 5.0, 0.0), (3.0, 0.0, -2.0), False),
        ((-0.5, 0.0, 0.0), (3.0, 5.0, -2.0), False),  # a position that jumped
    ],
)
def test_a_rebound_that_the_hit_cannot_have_caused_is_not_believed(velocity, position, is_right):
    whole = reckoned()
    whole.tell(True)
    assert believed(whole, LocalPosition(HIT_US + 80_000, position, velocity)) is is_right
    # And is, whatever it says, once every estimator has come right
    assert believed(whole, LocalPosition(HIT_US + OVER_US, position, velocity))


def test_a_hit_during_doubt_is_in_doubt_too():
    again = reckoned(inherits_doubt=True)
    again.tell(True)
    assert not believed(again, said(1.0))


def test_while_the_estimate_is_put_right_it_is_not_believed_whatever_it_says():
    """A real PX4's error: 3.6 m/s, flat for 0.14 s, then a second-order system of 4.45 rad/s, damped by 0.59."""

    def missing(t_s):
        s = max(0.0, t_s - 0.14)
        return 3.6 * math.exp(-2.6 * s) * math.cos(3.6 * s)

    found = reckoned()
    times = range(20_000, 2_000_000, 20_000)
    believed_us = next(us for us in times if believed(found, said(1.0, us), known=fixes(missing, us)))
    assert BEGUN_US <= believed_us <= OVER_US
    assert abs(missing(believed_us * 1e-6)) < 0.2 * 3.6


def test_steady_is_what_goes_along_with_the_accelerometer():
    now_us = HIT_US + 1_000_000
    assert is_steady(fixes(lambda t: 0.5, 1_000_000), now_us), "a lasting error is not a change"
    assert not is_steady(fixes(lambda t: 2.0 * t, 1_000_000), now_us)
    assert not is_steady((), now_us), "nothing heard, nothing known"


def heard(reckoning, acceleration, until_us=400_000, attitude=LEVEL):
    strapdown = Strapdown(attitude_wxyz=attitude)
    for since_us in range(4_000, until_us + 1, 4_000):
        strapdown.time_boot_us = HIT_US + since_us
        strapdown.acceleration_ned_m_s2 = acceleration(since_us)
        reckoning.imu(strapdown)
    return reckoning.motion


def test_until_then_the_motion_is_the_expected_one_and_what_the_accelerometer_adds():
    # Given a push of 15 g that is clipped, and a vehicle that then brakes with 1 m/s^2
    motion = heard(reckoned(), lambda since_us: (-150.0 if since_us < 10_000 else 1.0, 0.0, 0.0))
    assert motion.velocity_ned_m_s == pytest.approx((0.0, 0.0, 0.0), abs=0.02), "0.4 m/s off the wall, for 0.4 s"
    assert motion.position_ned_m == pytest.approx((2.92, 0.0, -2.0), abs=0.01)
    assert motion.acceleration_ned_m_s2 == pytest.approx((1.0, 0.0, 0.0), abs=0.01)


def test_an_estimate_that_is_right_counts_at_once_and_its_noise_little():
    found = reckoned()
    found.correct(said(-0.6, 60_000, (2.9, 0.0, -2.0)))
    assert found.motion == Moving((2.9, 0.0, -2.0), (-0.6, 0.0, 0.0))
    found.correct(said(-0.5, 80_000, (2.9, 0.0, -2.0)))
    assert -0.6 < found.motion.velocity_ned_m_s[0] < -0.55


def test_the_lean_in_vain_is_the_wind():
    # Given a vehicle that leans south by 6 degrees and does not move
    lean_rad = math.radians(6.0)
    found = reckoned()
    heard(found, lambda _: ZERO, 4_000_000, (math.cos(0.5 * lean_rad), 0.0, math.sin(0.5 * lean_rad), 0.0))
    assert found.wind_m_s2 == pytest.approx((-9.81 * math.tan(lean_rad), 0.0), abs=0.05)


def test_a_lean_is_known_ahead_by_the_rates():
    level = Strapdown(rates_frd_rad_s=(0.0, -2.0, 0.0))
    assert lean_ahead(Strapdown()) == pytest.approx(ZERO)
    assert lean_ahead(level)[0] == pytest.approx(9.81 * 0.15 * 2.0, abs=0.05), "nose down leans north"


def test_the_way_out_lies_between_a_clipped_push_and_the_way_back():
    turned = (-math.cos(0.5), -math.sin(0.5), 0.0)
    n, e, d = half_way(turned, (1.5, 0.0, 0.2))
    assert (n, e, d) == pytest.approx((-math.cos(0.25), -math.sin(0.25), 0.0))
    assert half_way((-0.17, 0.985, 0.0), NORTH) == SOUTH, "80 degrees off: the push is wrong"
    assert half_way(turned, ZERO) == turned, "a vehicle that hovered has no way back"


@pytest.mark.parametrize(
    ("pushed", "after", "normal"),
    [
        ((-0.94, 0.34, 0.0), (-0.5, 0.0, 0.0), (-0.94, 0.34, 0.0)),  # 20 degrees beside the change: may be friction
        ((0.0, 1.0, 0.0), (-0.5, 0.0, 0.0), (-1.0, 0.0, 0.0)),  # a sample gone wrong
        ((0.0, 1.0, 0.0), (1.9, 0.3, 0.0), (0.0, 1.0, 0.0)),  # a graze: the change says little
        ((0.0, 1.0, 0.0), (-0.5, 0.0, 3.5), (-1.0, 0.0, 0.0)),  # a fall since makes no ceiling of a wall
    ],
)
def test_the_normal_is_the_pushs_unless_the_velocity_says_otherwise(pushed, after, normal):
    assert agreed_normal(pushed, (2.0, 0.0, 0.0), after) == pytest.approx(normal)


def recovering(**hit):
    mission = Mission.model_validate({"name": "m", "items": [{"takeoff": {"height_m": 2}}, {"land": {}}]})
    flight = FlightContext(mission, Vehicle(), StreamMonitor(mission.companion.streams))
    flight.origin_ned_m = ZERO
    reckoning = reckoned(**hit)
    record = CollisionRecord(
        0, HIT_US, "fused", reckoning.contact, (2.6, 0.0, -2.0), SOUTH, 20.0, HIT_US, 1.2, reckoning
    )
    flight.collisions.append(record)
    return flight, record, Recover(flight, 0)


def test_the_plan_begins_anew_when_a_slow_contact_is_over():
    # Given arms that push for 0.15 s, while which the vehicle still flies in
    flight, record, recover = recovering(velocity=(1.0, 0.0, 0.0))
    record.reckoning.tell(True)

    def hears(at_us, north_m, north_m_s):
        sample = LocalPosition(HIT_US + at_us, (north_m, 0.0, -2.0), (north_m_s, 0.0, 0.0))
        recover.step(flight, Inputs(positions=[sample]), at_us)
        return recover.target(at_us)

    record.contact_ended_boot_us = HIT_US + 80_000
    first = hears(80_000, 3.05, 0.2)
    assert first.velocity_ned_m_s[0] == 0.0, "towards the wall is never asked for"
    assert first.acceleration_ned_m_s2[0] < 0.0
    # When nothing pushes any more, and the vehicle leaves
    record.contact_ended_boot_us = HIT_US + 150_000
    hears(160_000, 3.02, -0.3)
    anew = hears(300_000, 2.99, -0.5)
    # Then the plan goes on from there
    assert anew.position_ned_m[0] == pytest.approx(2.99, abs=0.02)
    assert anew.velocity_ned_m_s[0] == pytest.approx(-0.35, abs=0.15)
    assert record.setpoint_ned_m[0] < 2.7


def test_what_pushes_a_vehicle_along_takes_its_surface_and_its_goal_with_it():
    # Given a screen that carries a vehicle south with 0.8 m/s
    flight, record, recover = recovering(velocity=ZERO)
    record.reckoning.tell(True)
    goals = []
    for at_us in range(100_000, 1_500_000, 20_000):
        record.contact_ended_boot_us = HIT_US + at_us
        sample = LocalPosition(HIT_US + at_us, (3.0 - 0.8e-6 * at_us, 0.0, -2.0), (-0.8, 0.0, 0.0))
        recover.step(flight, Inputs(positions=[sample]), at_us)
        asked = recover.target(at_us)
        goals.append(record.setpoint_ned_m[0])
        assert asked.acceleration_ned_m_s2[0] < 2.8, "it brakes no harder than it can take back"
    # Then the goal is ahead of it all the time
    assert goals[0] - goals[-1] > 1.0
    assert goals[-1] < 3.0 - 0.8 * 1.48 - 0.34


def test_a_fall_before_the_estimate_is_believed_makes_no_ceiling_of_the_wall():
    # Given a clipped hit square into a wall, whose estimate is believed only when it must be
    flight, record, recover = recovering()
    # When the vehicle has by then fallen 1.5 m
    late = LocalPosition(HIT_US + OVER_US + 20_000, (2.8, 0.0, -0.5), (-0.4, 0.0, 3.5))
    recover.step(flight, Inputs(positions=[late]), OVER_US + 20_000)
    # Then the way out is still away from the wall, and back up to where it was
    assert record.reckoning.is_right
    n, e, d = record.setpoint_ned_m
    assert n < 2.7 and abs(e) < 0.1 and d == pytest.approx(-2.0)
    # And of the speed off the wall nothing is said: no velocity of that time was believed
    assert record.report().rebound_speed_m_s is None


def test_in_doubt_accelerations_alone_are_asked_for():
    flight, record, recover = recovering()
    recover.step(flight, Inputs(positions=[said(2.0, 100_000, (3.1, 0.0, -2.0))]), 100_000)
    asked = recover.target(100_000)
    assert asked.leans_only and not asked.is_height_free
    assert asked.acceleration_ned_m_s2[0] < 0.5, "0.4 m/s off the wall: braked gently, never towards it harder"
    assert asked.expected == Moving(record.reckoning.motion.position_ned_m, record.reckoning.motion.velocity_ned_m_s)
