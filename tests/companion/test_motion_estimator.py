"""The motion after a hit that the accelerometer could not show whole: what is reckoned, when the estimate counts."""

import math
import random
from dataclasses import replace

import pytest

from companion.flight.context import Inputs, Target
from companion.flight.recovering import Recover
from companion.messages import Attitude, LocalPosition
from companion.motion.config import SAME_M_S
from companion.motion.strapdown import Strapdown
from companion.reflex.config import IMPULSE_RAD, TILT_PER_S, EstimateConfig
from companion.reflex.laws import Contact, MotionState
from companion.reflex.motion_estimator import MotionEstimator, tilt_ahead
from companion.reflex.normal import Normal
from tests.companion.test_recovering import AT, HIT_US, SOUTH, flight_with

NORTH = (1.0, 0.0, 0.0)
ZERO, LEVEL = (0.0, 0.0, 0.0), (1.0, 0.0, 0.0, 0.0)
# A real PX4's, and others: after how long what was hidden is put right, with which frequency and damping.
PX4, GPS = (0.18, 4.65, 0.665), (0.15, 2.42, 0.69)
WAYS = [PX4, GPS, (0.08, 7.5, 0.9), (0.22, 3.0, 0.5)]


def reckoned(velocity=(2.0, 0.0, 0.0), normal=SOUTH, restitution=0.2, is_second=False, hit_us=HIT_US):
    contact = Contact(hit_us, AT, velocity, normal)
    return MotionEstimator(contact, hit_us, contact.rebound(restitution), EstimateConfig(), is_second)


def said(north_m_s, since_us=60_000, position=AT):
    return LocalPosition(HIT_US + since_us, position, (north_m_s, 0.0, 0.0))


def missing(since_s, late_s, rad_s, damping):
    """Of what was hidden, what is missing in velocity and place, by small steps of the estimator's own equations."""
    velocity, place, tilt, step_s = 1.0, min(since_s, late_s), 0.0, 1e-4
    swing, rest = 2 * damping * rad_s, TILT_PER_S
    for _ in range(round(max(0.0, since_s - late_s) / step_s)):
        velocity, place, tilt = (
            velocity + step_s * (tilt - (rad_s**2 + swing * rest) * place),
            place + step_s * (velocity - (swing + rest) * place),
            tilt - step_s * rad_s**2 * rest * place,
        )
    return velocity, place


def followed(way, speed_m_s, restitution, hides=1.0, until_s=1.4, seed=1):
    """Since the hit, s; true velocity; told velocity; reckoning: after each that a vehicle tells, noise included."""
    draw = random.Random(seed)
    after_m_s = -restitution * speed_m_s
    hidden_m_s = hides * (speed_m_s - after_m_s)
    found = reckoned((speed_m_s, 0.0, 0.0), restitution=0.45)
    strapdown, noise = Strapdown(), [0.0, 0.0]
    for tick in range(1, round(until_s / 0.004)):
        strapdown.time_boot_us = HIT_US + 4_000 * tick
        found.imu(strapdown)
        if tick % 5 == 0:
            since_s = 0.004 * tick
            noise = [0.935 * each + 0.354 * draw.gauss(0.0, 0.03) for each in noise]
            lacks_m_s, lacks_m = missing(since_s, *way)
            velocity = (after_m_s + hidden_m_s * lacks_m_s + noise[0], noise[1], 0.0)
            place = (AT[0] + after_m_s * since_s + hidden_m_s * lacks_m + draw.gauss(0.0, 0.01), 0.0, AT[2])
            found.update(LocalPosition(strapdown.time_boot_us, place, velocity))
            yield since_s, after_m_s, velocity[0], found


@pytest.mark.parametrize("way", WAYS)
@pytest.mark.parametrize(("speed_m_s", "restitution"), [(1.0, 0.2), (2.0, 0.8), (4.0, 0.85), (3.0, 0.0)])
def test_the_motion_is_found_long_before_the_estimate_is_right_again(way, speed_m_s, restitution):
    # Given a hit of which the vehicle's own estimate knows nothing
    for since_s, true_m_s, told_m_s, found in followed(way, speed_m_s, restitution, until_s=3.0):
        velocity_error_m_s = found.motion.velocity_ned_m_s[0] - true_m_s
        hidden_m_s = (1.0 + restitution) * speed_m_s
        # Then it is never taken for right before what is missing still is known: to a few times its noise and a share
        least_m_s = SAME_M_S + 0.05 * hidden_m_s
        assert not found.has_converged or abs(told_m_s - found.velocity_error_m_s[0] - true_m_s) < least_m_s
        # and the motion is known to half of what was hidden at any time, and to a tenth and noise after a second
        assert abs(velocity_error_m_s) < 0.01 + (0.5 if since_s < 1.0 else 0.1) * hidden_m_s


@pytest.mark.parametrize("speed_m_s", [1.0, 3.0])
def test_the_spread_says_how_far_the_reckoned_velocity_may_be_off(speed_m_s):
    within = [
        abs(found.motion.velocity_ned_m_s[0] - true_m_s) <= 2.0 * found.spread_m_s + 0.1
        for restitution in (0.0, 0.3, 0.6, 0.9)
        for _, true_m_s, _, found in followed(PX4, speed_m_s, restitution)
    ]
    assert sum(within) >= 0.95 * len(within)


def test_an_estimate_that_knows_the_hit_is_believed_soon_and_one_that_flies_into_the_wall_is_not():
    right_s = next(since_s for since_s, _, _, found in followed(PX4, 2.0, 0.5, hides=0.0) if found.has_converged)
    assert right_s < 0.5
    lost_s = next(since_s for since_s, _, _, found in followed(PX4, 2.0, 0.5, until_s=2.0) if found.has_converged)
    assert lost_s > 0.9


@pytest.mark.parametrize("late_us", [0, 20_000, 45_000])
def test_reports_that_are_late_do_not_turn_the_motion_round(late_us):
    # Given a hit at 3 m/s that leaves 1 m/s back, and reports from 45 ms before it, or less
    found, strapdown = reckoned((3.0, 0.0, 0.0), restitution=0.45), Strapdown()
    for tick in range(1, 31):
        strapdown.time_boot_us = HIT_US + 4_000 * tick
        found.imu(strapdown)
        if tick % 5 == 0:
            shown = -1.0 if 4_000 * tick > late_us else 3.0
            found.update(said(shown, 4_000 * tick, (AT[0] - 0.004 * tick, 0.0, AT[2])))
    # Then after 0.12 s the motion is known
    assert found.motion.velocity_ned_m_s[0] == pytest.approx(-1.0, abs=0.3)


@pytest.mark.parametrize("is_whole", [False, True])
def test_a_report_from_before_the_hit_moves_no_estimate(is_whole):
    found = reckoned((3.0, 0.0, 0.0))
    found.note_contact(is_whole, HIT_US)
    before = found.motion
    found.update(said(2.9, 40_000))
    assert found.motion == before and not found.has_converged
    # A report that never shows the hit counts in the end: all of it was hidden.
    found.update(said(2.9, 120_000))
    assert found.motion != before


def test_a_report_after_a_second_hit_counts_at_once():
    # Given a second hit whose velocity before is an estimate: a report that is like it says nothing of being late
    found = reckoned((3.0, 0.0, 0.0), is_second=True)
    before = found.motion
    found.update(said(2.9, 40_000))
    assert found.motion != before


def test_a_contact_that_goes_on_makes_what_was_known_of_the_motion_uncertain():
    # Given a vehicle that reports 1.35 m/s off the wall, until the contact pushes on at 0.2 s and makes it 2.2 m/s
    found, strapdown = reckoned((3.0, 0.0, 0.0), restitution=0.45), Strapdown()
    for tick in range(1, 68):
        since_us = 4_000 * tick
        strapdown.time_boot_us = HIT_US + since_us
        found.imu(strapdown)
        if since_us == 200_000:
            found.note_contact(False, strapdown.time_boot_us)
        if tick % 5 == 0:
            late_s = 1e-6 * max(0, since_us - 200_000)
            place = (AT[0] - 1.35e-6 * since_us - 0.85 * late_s, 0.0, AT[2])
            found.update(said(-2.2 if late_s > 0.0 else -1.35, since_us, place))
    # Then 60 ms later that is its motion
    assert found.motion.velocity_ned_m_s[0] == pytest.approx(-2.2, abs=0.2)


def test_what_the_accelerometer_has_shown_whole_the_estimate_knows_at_once():
    whole = reckoned()
    whole.note_contact(True, HIT_US)
    whole.update(said(-0.6, 60_000, (2.9, 0.0, -2.0)))
    assert whole.has_converged and whole.motion == MotionState((2.9, 0.0, -2.0), (-0.6, 0.0, 0.0))
    whole.update(said(-0.5, 80_000, (2.9, 0.0, -2.0)))
    assert -0.6 < whole.motion.velocity_ned_m_s[0] < -0.55, "noise counts little"


def test_it_is_believed_in_the_end_whatever_it_says():
    found = reckoned()
    for since_us in range(20_000, 4_000_000, 20_000):
        found.update(said(2.0 - 9e-6 * since_us, since_us))
    assert found.has_converged


@pytest.mark.parametrize("ahead_us", [1_000_000, 120_000, -70_000])
@pytest.mark.parametrize("hides", [0.0, 1.0])
def test_a_place_of_another_time_leaves_the_motion_one_that_a_vehicle_can_have(ahead_us, hides):
    # Given a hit, and now and then in the second after it a place that is stamped ahead of its time, or behind
    found, strapdown = reckoned(), Strapdown()
    for tick in range(1, 600):
        since_us = 4_000 * tick
        strapdown.time_boot_us = HIT_US + since_us
        found.imu(strapdown)
        if tick % 5 == 0:
            lacks_m_s, lacks_m = missing(1e-6 * since_us, *PX4)
            place = (3.0 - 0.4e-6 * since_us + 2.4 * hides * lacks_m, 0.0, -2.0)
            at_us = since_us + (ahead_us if tick % 25 == 0 and tick < 250 else 0)
            found.update(said(-0.4 + 2.4 * hides * lacks_m_s, at_us, place))
        # Then the motion stays one that a vehicle can have
        assert math.isfinite(found.spread_m_s)
        assert -2.5 < found.motion.velocity_ned_m_s[0] < 2.5
    assert found.motion.velocity_ned_m_s[0] == pytest.approx(-0.4, abs=0.15)


def test_another_hit_while_the_estimate_is_put_right_leaves_it_wrong():
    # Given a clipped hit on a wall, then a soft one on another whose force was shown whole
    *_, (_, _, told_m_s, _) = followed(PX4, 2.0, 0.5, until_s=0.16)
    again = reckoned((-1.0, 0.0, 0.0), NORTH, 0.0, True, HIT_US + 160_000)
    again.note_contact(True, HIT_US + 160_000)
    again.update(said(told_m_s, 180_000))
    assert told_m_s > 1.0 and not again.has_converged
    assert again.motion.velocity_ned_m_s[0] < 0.5 * told_m_s


def heard(estimator, acceleration, until_us=400_000, attitude=LEVEL):
    strapdown = Strapdown(attitude_wxyz=attitude)
    for since_us in range(4_000, until_us + 1, 4_000):
        strapdown.time_boot_us = HIT_US + since_us
        strapdown.acceleration_ned_m_s2 = acceleration(since_us)
        estimator.imu(strapdown)
    return estimator.motion


def test_until_then_the_motion_is_the_expected_one_and_what_the_accelerometer_adds():
    # Given a push of 15 g that is clipped, and a vehicle that then brakes with 1 m/s^2
    motion = heard(reckoned(), lambda since_us: (-150.0 if since_us < 10_000 else 1.0, 0.0, 0.0))
    assert motion.velocity_ned_m_s == pytest.approx((0.0, 0.0, 0.0), abs=0.02), "0.4 m/s off the wall, for 0.4 s"
    assert motion.position_ned_m == pytest.approx((2.92, 0.0, -2.0), abs=0.01)
    assert motion.acceleration_ned_m_s2 == pytest.approx((1.0, 0.0, 0.0), abs=0.01)


def test_a_lean_is_known_ahead_by_the_rates():
    level = Strapdown(rates_frd_rad_s=(0.0, -2.0, 0.0))
    assert tilt_ahead(Strapdown(), 0.15) == pytest.approx(ZERO)
    assert tilt_ahead(level, 0.15)[0] == pytest.approx(9.80665 * math.tan(0.15 * 2.0)), "nose down leans north"


def recovering(**hit):
    flight = flight_with(estimator=reckoned(**hit))
    return flight, flight.collisions[0], Recover(flight, 0)


def test_a_velocity_that_is_not_that_of_the_places_is_put_right_by_them():
    # Given a vehicle at rest that takes itself for moving at 0.15 m/s for seconds, and its places stand
    flight, record, recover = recovering()
    record.estimator.note_contact(True, HIT_US)
    for at_us in range(100_000, 5_000_000, 20_000):
        recover.step(flight, Inputs(positions=[said(0.15, at_us, (2.38, 0.0, -2.0))]), at_us)
        if record.is_over:
            break
    # Then the recovery is over although 0.15 m/s is told
    assert record.setpoint_ned_m[0] == pytest.approx(2.38, abs=0.05)
    assert record.estimator.velocity_error_m_s[0] == pytest.approx(0.15, abs=0.05)
    assert record.is_over and record.settled_after_s < 3.5


def test_a_recovery_that_is_over_or_whose_hit_is_taken_back_goes_on_until_its_state_ends():
    flight, record, recover = recovering(velocity=ZERO)
    record.is_over, flight.collisions = True, []
    at_us = 11_000_000
    assert recover.step(flight, Inputs(positions=[said(1.0, at_us, (2.0, 0.0, -2.0))]), at_us) is not None
    assert recover.target(at_us) is not None


def test_a_place_that_jumps_makes_no_large_error_of_a_velocity():
    found = reckoned()
    found.note_contact(True, HIT_US)
    for since_us in range(60_000, 400_000, 20_000):
        found.update(said(0.0, since_us, (3.0 if since_us < 200_000 else 8.0, 0.0, -2.0)))
    assert math.hypot(*found.velocity_error_m_s) <= 2.0 * SAME_M_S + 1e-9


def test_a_push_that_its_sensor_shows_one_axis_of_is_turned_back_by_the_velocity():
    # Given a slanted wall met at 1.2 m/s, of whose push the accelerometer shows the part along the east alone
    flight, record, recover = recovering(velocity=(1.2, 0.0, 0.0))
    record.estimator.note_contact(True, HIT_US)
    record.contact_normal, record.estimator.pushed_boot_us = Normal((0.0, -1.0, 0.0), IMPULSE_RAD), HIT_US + 80_000
    # When the velocity goes on changing after the last sample that showed a push
    north_m, east_m, before_us = 3.05, 0.0, 60_000
    for at_us, (n, e) in ((84, (0.6, -0.47)), (124, (0.4, -0.55)), (164, (0.2, -0.6)), (260, (0.6, 0.4))):
        elapsed_s, before_us = 1e-3 * at_us - 1e-6 * before_us, 1_000 * at_us
        north_m, east_m = north_m + elapsed_s * n, east_m + elapsed_s * e
        told = LocalPosition(HIT_US + before_us, (north_m, east_m, -2.0), (n, e, 0.0))
        recover.step(flight, Inputs(positions=[told]), before_us)
    # Then the way off is along what the contact did to it, and not along what the vehicle's own thrust does later
    normal = recover._contact.normal_ned
    assert math.degrees(math.atan2(-normal[1], -normal[0])) == pytest.approx(31.0, abs=35.0)


@pytest.mark.parametrize(("is_second", "normal"), [(False, (-0.79, -0.61, 0.0)), (True, (0.0, -1.0, 0.0))])
def test_a_normal_is_turned_by_the_velocity_that_is_known_late_too(is_second, normal):
    # Given a clipped hit of whose push the sensor shows the east alone, and an estimate that is right after 0.6 s
    flight, record, recover = recovering(velocity=(1.2, 0.0, 0.0), is_second=is_second)
    record.contact_normal, record.estimator.has_converged = Normal((0.0, -1.0, 0.0), IMPULSE_RAD), True
    recover._contact = replace(record.contact, normal_ned=(0.0, -1.0, 0.0))
    # When the first velocity after that comes
    recover.step(
        flight, Inputs(positions=[LocalPosition(HIT_US + 600_000, (2.8, 0.0, -2.0), (-0.5, 0.0, 0.0))]), 600_000
    )
    # Then the way off is against the change of it, if the velocity before the hit was a measured one
    assert recover._contact.normal_ned == pytest.approx(normal, abs=0.01)


def test_the_heading_of_before_the_first_hit_is_kept_through_the_second():
    # Given a vehicle that was to head north, is turned by a hit, and is turned back
    flight, record, recover = recovering()
    flight.target, flight.yaw_rad = Target((3.0, 0.0, -2.0), 0.0), 0.0
    recover = Recover(flight, 0)
    flight.vehicle.attitude = Attitude(HIT_US, (math.cos(1.0), 0.0, 0.0, math.sin(1.0)))
    recover.step(flight, Inputs(), 100_000)
    flight.target = recover.target(100_000)
    assert flight.target.yaw_rad > 1.0
    # When it is hit again
    flight.collisions.append(replace(record))
    Recover(flight, 200_000)
    # Then north is where it is turned to
    assert flight.yaw_rad == 0.0


@pytest.mark.parametrize(
    ("heading_deg", "asked_deg"), [(10.0, 0.0), (-15.0, 0.0), (-120.0, -104.0), (120.0, 104.0), (350.0, 0.0)]
)
def test_a_vehicle_that_a_hit_has_turned_is_turned_back_at_leisure(heading_deg, asked_deg):
    # Given a vehicle that is to head north
    flight, _, recover = recovering()
    flight.yaw_rad, half_rad = 0.0, math.radians(0.5 * heading_deg)
    flight.vehicle.attitude = Attitude(HIT_US, (math.cos(half_rad), 0.0, 0.0, math.sin(half_rad)))
    # When it recovers, then it is asked for no heading far from its own
    recover.step(flight, Inputs(), 100_000)
    assert math.degrees(recover.target(100_000).yaw_rad) == pytest.approx(asked_deg, abs=0.1)
    # And for its heading of before when that is over
    assert recover.step(flight, Inputs(), 11_000_000) is not None
    assert flight.target.yaw_rad == 0.0


def test_a_whole_hit_is_followed_by_what_is_told_even_while_it_pushes():
    # Given arms that push for half a second, each sample shown whole
    found = reckoned((0.5, 0.0, 0.0))
    for since_us in range(40_000, 500_000, 20_000):
        found.note_contact(True, HIT_US + since_us)
        found.update(said(0.3, since_us, (3.0 + 0.3e-6 * since_us, 0.0, -2.0)))
    # Then the motion is what the estimate says, not what was expected of the hit
    assert found.motion.velocity_ned_m_s[0] == pytest.approx(0.3, abs=0.02)


def test_gyroscopes_that_deny_more_tilt_than_a_hit_can_hide_are_wrong_themselves():
    # Given gyroscopes with a bias of 0.5 rad/s, of a vehicle that hovers level and says so, after a hit
    strapdown, leans_m_s2 = Strapdown(), []
    strapdown.attitude(HIT_US, LEVEL)
    for since_us in range(4_000, 1_500_001, 4_000):
        strapdown.imu(HIT_US + since_us, (0.0, 0.0, -9.80665), (0.0, 0.5, 0.0))
        if since_us % 20_000 == 0:
            strapdown.attitude(HIT_US + since_us, LEVEL, most_wrong_rad=0.4)
        leans_m_s2.append(math.hypot(*strapdown.level_acceleration_m_s2))
    # Then the lean is never corrected by more than the hit can have spoilt it, and the reported attitude counts again
    assert max(leans_m_s2) < 9.80665 * math.tan(0.41)
    assert 0.0 in leans_m_s2[140:], "told anew, not held"


def test_a_fall_before_the_estimate_is_believed_makes_no_ceiling_of_the_wall():
    # Given a clipped hit square into a wall, whose estimate is believed after three seconds
    flight, record, recover = recovering()
    # When the vehicle has by then fallen 1.5 m
    late = LocalPosition(HIT_US + 3_500_000, (2.8, 0.0, -0.5), (-0.4, 0.0, 3.5))
    recover.step(flight, Inputs(positions=[late]), 3_500_000)
    # Then the way out is still away from the wall, and back up to where it was
    assert record.estimator.has_converged
    n, e, d = record.setpoint_ned_m
    assert n < 2.7 and abs(e) < 0.1 and d == pytest.approx(-2.0)
    # And of the speed off the wall nothing is said: no velocity of that time was believed
    assert record.report().rebound_speed_m_s is None
