"""The motion after a hit that the accelerometer could not show whole: what is reckoned, when the estimate counts."""

import math
import random
import statistics

import pytest

from companion.flight.context import Inputs
from companion.messages import Attitude, LocalPosition
from companion.motion.config import CURRENT_US, GRAVITY_M_S2, SAME_M_S, SHOWN_US, TILT_RAD_PER_M_S
from companion.motion.rotation import yaw_rad
from companion.motion.strapdown import Strapdown
from companion.motion.vector import ZERO, minus
from companion.reflex.belief.motion_estimator import MotionEstimator
from companion.reflex.config import CORRECTED_US, TILT_PER_S, TIPPED_RAD, EstimateConfig
from companion.reflex.surface import Contact, MotionState
from tests.companion.flight.test_recovering import AT, HIT_US, SOUTH, flight_with, recover_in

# A real PX4's, and others: after how long what was hidden is put right, with which frequency and damping.
PX4, GPS = (0.18, 4.65, 0.665), (0.15, 2.42, 0.69)
WAYS = [PX4, GPS, (0.08, 7.5, 0.9), (0.22, 3.0, 0.5)]


def reckoned(velocity=(2.0, 0.0, 0.0), restitution=0.2, fits=True, known_wind_m_s2=(0.0, 0.0, 0.0)):
    contact = Contact(AT, velocity, SOUTH, 0.2)
    found = MotionEstimator(contact, HIT_US, contact.rebound(restitution), EstimateConfig(), None, fits)
    found.note_wind(known_wind_m_s2)
    return found


@pytest.mark.parametrize(("later_us", "is_second"), [(1_000_000, True), (CORRECTED_US + 1_000_000, False)])
def test_what_an_earlier_hit_has_hidden_counts_on_in_the_next_one_until_it_is_corrected(later_us, is_second):
    # Given a clipped hit at 3 m/s, and one at 1 m/s later
    first, next_us = reckoned((3.0, 0.0, 0.0)), HIT_US + later_us
    first.imu(Strapdown(time_boot_us=next_us))
    contact = Contact(AT, (1.0, 0.0, 0.0), SOUTH, 0.2)
    found = MotionEstimator(contact, next_us, contact.rebound(0.45), EstimateConfig(), first)
    # Then the tilt may be wrong by the harder of both, at once; else by its own, once the correction can have begun
    tilts_rad = [found.tilt_error_rad(next_us + since_us) for since_us in (SHOWN_US - 1, SHOWN_US)]
    assert tilts_rad == pytest.approx([4.0 * TILT_RAD_PER_M_S] * 2 if is_second else [0.0, 2.0 * TILT_RAD_PER_M_S])
    # And a contact that was measured whole leaves the estimate valid after none
    found.note_contact(True, next_us, found.normal, 0.0)
    assert found.is_valid is not is_second
    found.imu(Strapdown(time_boot_us=next_us + CORRECTED_US + 1))
    assert found.is_valid and not found.has_faded
    # However hard it was, a vehicle's level is no further off than where it tips over
    assert reckoned((20.0, 0.0, 0.0)).tilt_error_rad(HIT_US + SHOWN_US) == TIPPED_RAD


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


def reports(found, strapdown, until_s, way=PX4):
    """When the vehicle reports: since the hit, s; and of what was hidden, what is missing in velocity and place."""
    for tick in range(1, round(until_s / 0.004)):
        strapdown.time_boot_us = HIT_US + 4_000 * tick
        found.imu(strapdown)
        if tick % 5 == 0:
            yield 0.004 * tick, *missing(0.004 * tick, *way)


def followed(way, speed_m_s, restitution, hides=1.0, until_s=1.4, fits=True):
    """Since the hit, s; true velocity; told velocity; reckoning: after each that a vehicle tells, noise included."""
    draw = random.Random(1)
    after_m_s = -restitution * speed_m_s
    hidden_m_s = hides * (speed_m_s - after_m_s)
    found = reckoned((speed_m_s, 0.0, 0.0), restitution=0.45, fits=fits)
    strapdown, noise = Strapdown(), [0.0, 0.0]
    for since_s, lacks_m_s, lacks_m in reports(found, strapdown, until_s, way):
        noise = [0.935 * each + 0.354 * draw.gauss(0.0, 0.03) for each in noise]
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


@pytest.mark.parametrize("late_s", [0.18, 0.22])
def test_a_report_that_looks_as_expected_until_its_correction_begins_may_be_wrong_by_that(late_s):
    # Given a seventh of a hit hidden, so that the report is the expected rebound at first
    for _, true_m_s, told_m_s, found in followed((late_s, 4.65, 0.665), 1.3, 0.85, until_s=1.6, hides=0.15):
        assert abs(told_m_s - true_m_s) < found.left_m_s
    # Then that is bounded as long as it lasts, and a jump by more counts when it is over
    assert found.left_m_s < 2.0 * SAME_M_S


@pytest.mark.parametrize("way", WAYS)
def test_what_strikes_a_hovering_vehicle_may_have_hidden_more_than_its_own_speed(way):
    # Given a vehicle that hovers, and a strike that leaves it with 2 m/s, of which 0.7 m/s were measured
    found, strapdown = reckoned((0.1, 0.0, 0.0)), Strapdown()
    for since_s, lacks_m_s, lacks_m in reports(found, strapdown, 3.0, way):
        if since_s < 0.03:
            found.note_contact(False, HIT_US + 4_000, found.normal, 0.7)
        place = (AT[0] - 2.0 * since_s + 1.3 * lacks_m, 0.0, AT[2])
        found.update(LocalPosition(strapdown.time_boot_us, place, (-2.0 + 1.3 * lacks_m_s, 0.0, 0.0)))
        # Then its estimate is not taken for right before it is, or what it lacks is known
        assert not found.has_converged or abs(found.motion.velocity_ned_m_s[0] + 2.0) < 0.5


@pytest.mark.parametrize("speed_m_s", [1.0, 3.0])
def test_the_spread_says_how_far_the_reckoned_velocity_may_be_off(speed_m_s):
    within = [
        abs(found.motion.velocity_ned_m_s[0] - true_m_s) <= 2.0 * found.spread_m_s + 0.1
        for restitution in (0.0, 0.3, 0.6, 0.9)
        for _, true_m_s, _, found in followed(PX4, speed_m_s, restitution)
    ]
    assert sum(within) >= 0.95 * len(within)


@pytest.mark.parametrize(("later_s", "fits"), [(0.06, True), (0.06, False), (1.0, True)])
def test_the_velocity_after_the_contact_is_the_reported_one_less_what_the_thrust_has_added(later_s, fits):
    # Given a contact of 20 ms whose own force is less than 1 g
    found, strapdown = reckoned((1.5, -2.5, 0.0), fits=fits), Strapdown()

    def go_on(seconds, acceleration):
        for _ in range(round(seconds / 0.004)):
            strapdown.time_boot_us = (strapdown.time_boot_us or HIT_US) + 4_000
            strapdown.imu(strapdown.time_boot_us, minus(acceleration, (0.0, 0.0, GRAVITY_M_S2)), ZERO)
            found.imu(strapdown)

    go_on(0.02, (-9.0, 0.0, 0.0))
    found.note_contact(True, strapdown.time_boot_us, found.normal, 0.0)
    # and a vehicle that leaves at 1 m/s to the south and 2 m/s to the west, and brakes with 3 m/s^2 from then on
    go_on(later_s, (1.0, 3.0, 0.0))
    # When the first velocity comes, soon or late
    velocity = (-1.0 + 1.0 * later_s, -2.0 + 3.0 * later_s, 0.0)
    found.update(LocalPosition(strapdown.time_boot_us, AT, velocity))
    # Then it is known how the vehicle left, the worse the later
    assert found.after_ned_m_s == pytest.approx((-1.0, -2.0, 0.0), abs=0.06)
    assert found.has_converged and found.after_error_m_s == pytest.approx(0.5 * later_s, abs=0.01)
    # and a later one, which is known worse, does not count
    go_on(0.1, (1.0, 3.0, 0.0))
    found.update(LocalPosition(strapdown.time_boot_us, AT, (5.0, 5.0, 0.0)))
    assert found.after_ned_m_s == pytest.approx((-1.0, -2.0, 0.0), abs=0.06)
    # until it is pushed again, or a part of the contact turns out to be hidden
    pushed_us = strapdown.time_boot_us
    for is_fully_measured in (True, False):
        found.note_contact(is_fully_measured, pushed_us, found.normal, 0.0)
        assert found.after_error_m_s == math.inf
        go_on(0.04, ZERO)
        found.update(LocalPosition(strapdown.time_boot_us, AT, velocity))
        assert found.after_error_m_s < math.inf


@pytest.mark.parametrize(
    ("force_frd_m_s2", "faster_m_s2"),
    [((0.0, 0.0, -21.5), 15.2), ((-12.0, 0.0, -9.8), 0.0), ((0.0, 12.0, -21.5), 0.0), ((0.0, 0.0, 12.0), 0.0)],
    ids=["thrust", "wall", "wall beside it", "ceiling"],
)
def test_a_thrust_of_twice_the_weight_moves_a_vehicle_and_a_contact_of_its_weight_has_done_so(
    force_frd_m_s2, faster_m_s2
):
    # Given a vehicle that leans north by 45 degrees after a hit, before the first report
    found, strapdown = reckoned(), Strapdown()
    was_m_s, leans_rad = found.motion.velocity_ned_m_s[0], math.radians(-45.0)
    strapdown.attitude(HIT_US, (math.cos(0.5 * leans_rad), 0.0, math.sin(0.5 * leans_rad), 0.0))
    for tick in range(51):
        strapdown.imu(HIT_US + 4_000 * tick, force_frd_m_s2, ZERO)
        found.imu(strapdown)
    assert found.motion.velocity_ned_m_s[0] - was_m_s == pytest.approx(0.2 * faster_m_s2, abs=0.1)


def test_the_height_is_the_reported_one_while_a_hit_is_corrected_and_after_it():
    # Given a vehicle whose velocity is wrong downwards, too, and whose heights stand
    found, strapdown = reckoned((3.0, 0.0, 1.0)), Strapdown()
    for since_s, lacks_m_s, lacks_m in reports(found, strapdown, 3.0):
        place = (AT[0] - 0.6 * since_s + 3.6 * lacks_m, 0.0, AT[2])
        found.update(LocalPosition(strapdown.time_boot_us, place, (-0.6 + 3.6 * lacks_m_s, 0.0, 1.5 * lacks_m_s)))
        assert found.motion.position_ned_m[2] == pytest.approx(AT[2], abs=0.02)
    assert found.has_converged and found.position_error_m[0] != 0.0 and found.position_error_m[2] == 0.0


def test_an_estimate_that_knows_the_hit_is_believed_soon_and_later_one_that_is_lost_or_follows_no_model():
    ways = ({"hides": 0.0}, {"until_s": 2.0}, {"hides": 0.0, "fits": False})
    runs = (followed(PX4, 2.0, 0.5, **how) for how in ways)
    right_s, lost_s, later_s = (next(since_s for since_s, *_, found in run if found.has_converged) for run in runs)
    # Then one that flies into the wall is not, and one without a model once its receiver could have spoken
    assert right_s < 0.5 and lost_s > 0.9 and right_s < 1e-6 * CURRENT_US < later_s


def test_a_report_from_within_the_contact_says_nothing_of_the_motion_after_it():
    found, strapdown = reckoned(), Strapdown(time_boot_us=HIT_US + 80_000)
    found.note_contact(False, HIT_US + 80_000, found.normal, 0.0)
    found.imu(strapdown)
    expected = found.motion
    found.update(LocalPosition(HIT_US + 76_000, AT, (5.0, 0.0, 0.0)))
    assert found.motion == expected


def test_overshoot_and_rebound_are_the_beliefs_once_what_is_wrong_of_the_report_is_known():
    record = flight_with(estimator=reckoned()).collisions[0]
    estimator, record.setpoint_ned_m = record.estimator, (2.4, *AT[1:])
    estimator.motion = MotionState(record.setpoint_ned_m, (-0.5, 0.0, 0.0))
    for estimator.has_converged, shown in ((True, (0.0, 0.5)), (False, (1.0, 2.0))):
        record.follow_recovery(LocalPosition(HIT_US + 50_000, (1.4, *AT[1:]), (-2.0, 0.0, 0.0)))
        assert (record.overshoot_m, record.rebound_speed_m_s) == pytest.approx(shown)


@pytest.mark.parametrize("way", WAYS)
def test_a_velocity_that_a_wrong_tilt_makes_across_the_hit_is_no_motion(way):
    # Given a hit at 3 m/s that turns the vehicle: from 0.3 s on its tilt is wrong across it, and so is its velocity
    _, rad_s, damping = way
    found, strapdown = reckoned((3.0, 0.0, 0.0), restitution=0.8), Strapdown()
    lacks_m = lacks_m_s = 0.0
    for tick in range(1, 350):
        since_s = 0.004 * tick
        level_m_s2 = -2.0 if since_s > 0.3 else 0.0
        lacks_m_s += 0.004 * (-level_m_s2 - rad_s**2 * lacks_m)
        lacks_m += 0.004 * (lacks_m_s - 2.0 * damping * rad_s * lacks_m)
        strapdown.time_boot_us, strapdown.level_acceleration_m_s2 = HIT_US + 4_000 * tick, (0.0, level_m_s2, 0.0)
        found.imu(strapdown)
        if tick % 5 == 0:
            swing_m_s, swing_m = missing(since_s, *way)
            velocity = (-2.4 + 5.4 * swing_m_s, lacks_m_s, 0.0)
            found.update(
                LocalPosition(strapdown.time_boot_us, (3.0 - 2.4 * since_s + 5.4 * swing_m, lacks_m, -2.0), velocity)
            )
            # Then no motion across is taken from it, and none goes with the positions
            assert abs(found.motion.velocity_ned_m_s[1]) < 0.15
            assert not found.has_converged or abs(velocity[1] - found.velocity_error_m_s[1]) < 0.15


def test_a_climb_that_a_wrong_tilt_makes_of_a_lean_is_no_motion_of_a_copter():
    # Given a vehicle that flies level to the south after a hit, and by its wrong tilt takes itself for climbing
    found, strapdown = reckoned((3.0, 0.0, 0.0), restitution=0.8, fits=False), Strapdown()
    strapdown.sinks_m_s2, climbs_m_s, climbed_m = 0.5, 0.0, 0.0
    for tick in range(1, 250):
        strapdown.imu(HIT_US + 4_000 * tick, (0.0, 0.0, -GRAVITY_M_S2), ZERO)
        found.imu(strapdown)
        climbs_m_s += 0.004 * (0.5 - PX4[1] ** 2 * climbed_m)
        climbed_m += 0.004 * (climbs_m_s - 2.0 * PX4[2] * PX4[1] * climbed_m)
        if tick % 5 == 0:
            lacks_m_s, lacks_m = missing(0.004 * tick, *PX4)
            place = (AT[0] - 2.4 * 0.004 * tick + 5.4 * lacks_m, AT[1], AT[2] - climbed_m)
            found.update(LocalPosition(strapdown.time_boot_us, place, (-2.4 + 5.4 * lacks_m_s, 0.0, -climbs_m_s)))
    assert climbs_m_s > 0.05
    # Then it is known to fly level
    assert abs(found.motion.velocity_ned_m_s[2]) < 0.02


@pytest.mark.parametrize(("told_deg", "flown_deg"), [(0.0, 10.0), (10.0, 20.0), (20.0, 10.0)])
def test_a_tilt_that_is_told_too_small_lifts_less_than_it_tells(told_deg, flown_deg):
    told, flown = (math.radians(each) for each in (told_deg, flown_deg))
    strapdown = Strapdown()
    strapdown.valid_wxyz = (math.cos(0.5 * flown), 0.0, math.sin(0.5 * flown), 0.0)
    strapdown.attitude(0, (math.cos(0.5 * told), 0.0, math.sin(0.5 * told), 0.0), math.radians(15.0))
    assert strapdown.sinks_m_s2 == pytest.approx(9.80665 * (math.cos(told) - math.cos(flown)))
    # And nothing is left of it once the attitude is valid
    strapdown.attitude(0, strapdown.valid_wxyz)
    assert strapdown.sinks_m_s2 == 0.0


@pytest.mark.parametrize(
    ("known_m_s2", "across_m_s2", "wind_m_s2"),
    [
        (0.0, 1.9, 1.9),
        (0.0, 2.4, 0.62),  # more is no wind, but what it lies on
        (0.0, -0.9, -0.9),
        (0.0, -1.1, -0.54),  # off what was hit sooner
        (2.3, 0.2, 0.2),  # and where that ends nothing pushes
        (1.2, 0.9, 0.9),
        (1.2, 2.4, 2.4),
    ],
)
def test_what_pushes_after_a_hit_is_wind_unless_it_is_what_was_hit(known_m_s2, across_m_s2, wind_m_s2):
    # Given a level vehicle after a hit, the wind before it, and a force across its thrust
    found, strapdown = reckoned(known_wind_m_s2=(known_m_s2, 0.0, 0.0)), Strapdown()
    assert found.wind_m_s2 == (known_m_s2, 0.0, 0.0)
    for tick in range(1, 2500):
        strapdown.imu(HIT_US + 4_000 * tick, (across_m_s2, 0.0, -9.81), ZERO)
        found.imu(strapdown)
        # Then little of it counts at once: it may be drag, which is none at rest
        assert tick > 50 or abs(found.wind_m_s2[0] - known_m_s2) < 0.1 * abs(across_m_s2 - known_m_s2)
    # And as wind what lasts
    assert found.belief(strapdown).external_m_s2 == pytest.approx((wind_m_s2, 0.0, 0.0), abs=0.01)


def test_the_wind_that_a_vehicle_at_rest_stands_against_is_not_its_sensors_noise():
    # Given a noisy sensor at 50 Hz, and two seconds since a hit that was measured whole
    found, strapdown, draw = reckoned(), Strapdown(), random.Random(1)
    found.note_contact(True, HIT_US, found.normal, 0.0)
    winds = []
    for tick in range(1, 400):
        strapdown.imu(HIT_US + 20_000 * tick, (1.0 + draw.gauss(0.0, 0.5), 0.0, -9.81), ZERO)
        found.imu(strapdown)
        winds.append(found.wind_m_s2[0])
    # Then what is asked of the vehicle against the wind hardly changes
    assert statistics.fmean(winds[300:]) == pytest.approx(1.0, abs=0.1)
    assert statistics.stdev(winds[300:]) < 0.08


@pytest.mark.parametrize("ahead_us", [1_000_000, 120_000, -70_000])
@pytest.mark.parametrize("hides", [0.0, 1.0])
def test_a_place_of_another_time_leaves_the_motion_one_that_a_vehicle_can_have(ahead_us, hides):
    # Given a hit, and now and then in the second after it a place that is stamped ahead of its time, or behind
    found, strapdown = reckoned(), Strapdown()
    for number, (since_s, lacks_m_s, lacks_m) in enumerate(reports(found, strapdown, 2.4), start=1):
        place = (3.0 - 0.4 * since_s + 2.4 * hides * lacks_m, 0.0, -2.0)
        at_us = round(1e6 * since_s) + (ahead_us if number % 5 == 0 and number < 50 else 0)
        found.update(LocalPosition(HIT_US + at_us, place, (-0.4 + 2.4 * hides * lacks_m_s, 0.0, 0.0)))
        # Then the motion stays one that a vehicle can have
        assert math.isfinite(found.spread_m_s)
        assert -2.5 < found.motion.velocity_ned_m_s[0] < 2.5
    assert found.motion.velocity_ned_m_s[0] == pytest.approx(-0.4, abs=0.15)


def test_the_thrust_of_a_vehicle_that_turns_counts_as_it_points_when_a_setpoint_has_reached_its_motors():
    # Given a level one whose nose goes down at 2 rad/s: by 0.1 rad within 0.05 s
    strapdown = Strapdown(time_boot_us=HIT_US, rates_frd_rad_s=(0.0, -2.0, 0.0))
    assert reckoned().belief(strapdown).tilt_m_s2 == pytest.approx((0.98, 0.0, 0.0), abs=0.02)


@pytest.mark.parametrize(
    ("heading_deg", "asked_deg"), [(10.0, 0.0), (-15.0, 0.0), (-120.0, -104.0), (120.0, 104.0), (350.0, 0.0)]
)
def test_a_vehicle_that_a_hit_has_turned_is_turned_back_at_leisure(heading_deg, asked_deg):
    # Given a vehicle that is to head north
    recover = recover_in(flight := flight_with(estimator=reckoned()))
    flight.yaw_rad, half_rad = 0.0, math.radians(0.5 * heading_deg)
    attitude_wxyz = (math.cos(half_rad), 0.0, 0.0, math.sin(half_rad))
    flight.vehicle.attitude = Attitude(HIT_US, attitude_wxyz)
    flight.reflex.monitor.estimator.strapdown.attitude(HIT_US, attitude_wxyz)
    # When it recovers, then it is asked for no heading far from its own, and with the first attitude for none but that
    target = recover.target(flight, 0)
    assert math.degrees(target.yaw_rad) == pytest.approx(asked_deg, abs=0.1)
    off_rad = yaw_rad(target.setpoint(0).attitude_wxyz) - 2.0 * half_rad
    assert abs(math.remainder(off_rad, math.tau)) < 0.2
    recover.step(flight, Inputs(), 100_000)
    # And for its heading of before when that is over
    assert recover.step(flight, Inputs(), 11_000_000) is not None
    assert flight.target.yaw_rad == 0.0
