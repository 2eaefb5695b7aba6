"""A vehicle's motion by what it tells: history, attitude, how late its velocity is, and the satellites' own."""

import math
import random

import pytest

from companion.mavlink.readers import _gps_raw
from companion.messages import GpsFix, LocalPosition, Refused
from companion.motion.config import (
    DELAY_S,
    EARTH_M,
    FINEST_DOPPLER_M_S,
    LATEST_S,
    RECEIVER_DELAY_S,
    RECEIVER_LATEST_S,
    SAME_M_S,
    SettledConfig,
)
from companion.motion.doppler import Doppler
from companion.motion.history import MotionHistory
from companion.motion.rotation import tilt_rad, turned, yaw_rad
from companion.motion.settling import SettlingMonitor
from companion.motion.slope import Slope
from companion.motion.strapdown import LEVEL, Strapdown
from companion.motion.vector import ZERO, plus
from companion.reflex.belief.motion_estimator import MotionEstimator
from companion.reflex.config import EstimateConfig
from companion.reflex.surface import Contact

CONTACT_US = 10_000_000


def test_history_keeps_two_seconds_drops_late_packets_and_starts_anew_after_a_reboot():
    history = MotionHistory()
    samples = [LocalPosition(t_us, ZERO, ZERO) for t_us in range(CONTACT_US - 5_000_000, CONTACT_US, 20_000)]
    assert all(history.add(sample) for sample in samples)
    kept = history.between(0, CONTACT_US)
    assert kept[-1] is samples[-1]
    assert 1.95 <= (kept[-1].time_boot_us - kept[0].time_boot_us) * 1e-6 <= 2.0
    assert not history.add(samples[-2])
    assert history.latest is samples[-1]
    rebooted = LocalPosition(1000, ZERO, ZERO)
    assert history.add(rebooted)
    assert history.between(0, CONTACT_US) == [rebooted]
    assert history.before(1001) is rebooted and history.before(1000) is None


NOISE_M_S = 0.05


@pytest.mark.parametrize("axis", [(1.0, 0.0, 0.0), (0.0, 1.0, 0.0), (0.0, 0.0, 1.0)])
def test_one_step_that_was_a_hit_moves_the_delay_little_and_never_beyond_what_can_be_flown(axis):
    delay = Slope(DELAY_S, DELAY_S, 0.0, LATEST_S)
    delay.learn(plus(ZERO, -1.0, axis), axis)
    assert delay.found(NOISE_M_S**2)[0] < 0.06
    delay.learn(plus(ZERO, -100.0, axis), plus(ZERO, 10.0, axis))
    assert delay.found(NOISE_M_S**2)[0] == LATEST_S


G = 9.80665
SOUTH, HIT_US = (-1.0, 0.0, 0.0), 10_000_000


class Air:
    """A vehicle without tilt that speeds up north as it is told; IMU 250 Hz, reports 50 Hz, receiver 10 Hz."""

    def __init__(self, late_s, noise_m_s=0.0, began_us=0):
        self.strapdown, self.doppler, self.draw = Strapdown(), Doppler(), random.Random(1)
        self.late, self.noise_m_s = round(late_s / 0.004), noise_m_s
        self.now_us, self.velocities, self.reported_off_m_s = began_us, [0.0], 0.0
        self.newest, self.reported_off_m, self.place_noise_m = None, 0.0, 0.0

    def step(self, acceleration_m_s2=0.0, is_free=True, receives=True, turns_rad_s=0.0, unseen_m_s2=0.0):
        self.now_us += 4_000
        self.velocities.append(self.velocities[-1] + 0.004 * (acceleration_m_s2 + unseen_m_s2))
        self.strapdown.imu(self.now_us, (acceleration_m_s2, 0.0, -G), (0.0, turns_rad_s, 0.0))
        tick, sample = len(self.velocities), None
        if tick % 5 == 0:
            velocity = (self.velocities[-1] + self.reported_off_m_s, 0.0, 0.0)
            place = (4.0 + 0.004 * sum(self.velocities) + self.reported_off_m, 0.0, -2.0)
            self.newest = sample = LocalPosition(self.now_us, place, velocity)
            self.strapdown.velocity(sample)
        if receives and tick % 25 == 0 and tick > self.late:
            noise = [self.draw.gauss(0.0, self.noise_m_s) for _ in range(2)]
            measured = self.velocities[: tick - self.late]
            north_m = 0.004 * sum(measured) + self.draw.gauss(0.0, self.place_noise_m)
            fix = GpsFix((measured[-1] + noise[0], noise[1]), 47.0 + math.degrees(north_m / EARTH_M), 8.0, 0.0)
            self.doppler.take(fix, self.strapdown, self.newest, is_free)
        return sample


def test_between_two_reports_the_gyroscope_turns_the_attitude():
    # Half of the 2 rad/s that a turn from rest has after 0.1 s, for that time
    for p, q, r in ((0.08, 0.0, 0.0), (0.0, 0.08, 0.0), (0.0, 0.0, 0.08)):
        strapdown = Strapdown()
        for number in range(1, 26):
            strapdown.imu(4_000 * number, (0.0, 0.0, -G), (p * number, q * number, r * number))
        assert 2.0 * math.asin(sum(strapdown.valid_wxyz[1:])) == pytest.approx(0.1, abs=1e-4)


@pytest.mark.parametrize(
    ("silent_us", "told_rad", "roll_rad"), [(20_000, 0.0, 0.0), (250_000, 0.0, 0.3), (20_000, 0.6, 0.3)]
)
def test_after_a_gap_or_when_wrong_no_gyroscope_carries_the_attitude_until_the_vehicles_is_right(
    silent_us, told_rad, roll_rad
):
    strapdown, time_us, rolled = Strapdown(time_boot_us=4_000), 4_000 + silent_us, turned(LEVEL, (0.3, 0.0, 0.0), 1.0)
    strapdown.imu(time_us, (0.0, 0.0, -G), ZERO)
    for told_wxyz in (turned(LEVEL, (told_rad, 0.0, 0.0), 1.0), rolled):
        strapdown.attitude(time_us, told_wxyz, 0.4)
    assert tilt_rad(strapdown.valid_wxyz) == pytest.approx(roll_rad)
    strapdown.attitude(time_us, rolled, 0.0)
    strapdown.attitude(time_us, LEVEL, 0.4)
    assert tilt_rad(strapdown.valid_wxyz) == pytest.approx(0.3)


@pytest.mark.parametrize("most_wrong_rad", [0.0, 0.2])
def test_a_heading_that_is_reported_while_a_hit_is_corrected_is_compared_with_the_gyroscopes(most_wrong_rad):
    strapdown = Strapdown(time_boot_us=4_000)
    strapdown.attitude(4_000, turned(LEVEL, (0.0, 0.0, 0.3), 1.0), most_wrong_rad)
    is_wrong = most_wrong_rad > 0.0
    assert strapdown.heading_error_rad == pytest.approx(0.3 if is_wrong else 0.0)
    assert yaw_rad(strapdown.valid_wxyz) == pytest.approx(0.0 if is_wrong else 0.3)
    _, found = clipped()
    for time_us in (8_000, 12_000):
        strapdown.imu(time_us, (0.0, 0.0, -G), ZERO)
        found.imu(strapdown)
    assert found.belief(strapdown).heading_error_rad == strapdown.heading_error_rad


@pytest.mark.parametrize("late_s", [0.012, 0.06, 0.2])
def test_the_delay_is_learnt_where_the_vehicle_speeds_up_and_brakes(late_s):
    # Given a receiver that is late by another time than most, and a flight that speeds up and brakes for half a minute
    air = Air(late_s, noise_m_s=0.05)
    for tick in range(7_500):
        air.step(2.0 * math.sin(2.0e-3 * tick))
    # Then its delay is known, and its velocity is the vehicle's own as of now
    assert air.doppler.delay.found(air.doppler.variance_m2_s2)[0] == pytest.approx(late_s, abs=0.015)
    assert air.doppler.velocity_ned_m_s[0] == pytest.approx(air.velocities[-1], abs=0.2)
    assert air.doppler.variance_m2_s2 < 1.2 * FINEST_DOPPLER_M_S**2


def test_a_steady_flight_teaches_no_delay_and_the_receivers_noise_also_when_it_gets_worse():
    air = Air(0.2, noise_m_s=0.4)
    for air.noise_m_s in (0.4, 0.8):
        for _ in range(7_500):
            air.step()
        assert air.doppler.delay.found(air.doppler.variance_m2_s2)[0] == pytest.approx(RECEIVER_DELAY_S, abs=0.02)
        assert math.sqrt(air.doppler.variance_m2_s2) == pytest.approx(air.noise_m_s, rel=0.25)


def test_a_hit_that_the_receiver_shows_before_any_sample_is_neither_its_noise_nor_its_delay():
    air = Air(0.012, noise_m_s=0.05)
    for tick in range(7_500):
        air.step(2.0 * math.sin(2.0e-3 * tick))
    known, variance_m2_s2 = air.doppler.delay.found(air.doppler.variance_m2_s2)[0], air.doppler.variance_m2_s2
    air.velocities = [velocity - 7.0 for velocity in air.velocities]
    air.reported_off_m_s = 7.0
    for _ in range(25):
        air.step()
    assert air.doppler.delay.found(air.doppler.variance_m2_s2)[0] == pytest.approx(known, abs=0.002)
    assert air.doppler.variance_m2_s2 < 1.3 * variance_m2_s2


def clipped(rebound_m_s=-3.0, late_s=0.112):
    """A vehicle just after a hit of which its estimate knows nothing, and its belief."""
    air = Air(late_s, noise_m_s=0.02, began_us=HIT_US)
    contact = Contact((4.0, 0.0, -2.0), (3.0, 0.0, 0.0), SOUTH)
    found = MotionEstimator(contact, HIT_US, contact.rebound(0.45), EstimateConfig())
    air.velocities, air.reported_off_m_s = [rebound_m_s], 6.0
    return air, found


def go_on(air, found, seconds, **settings):
    """The newest report."""
    newest = None
    for _ in range(round(seconds / 0.004)):
        sample = air.step(is_free=False, **settings)
        found.imu(air.strapdown)
        found.measure(air.doppler)
        if sample is not None:
            newest = sample
            found.update(sample)
    return newest


def test_the_belief_goes_by_the_receiver_until_the_vehicles_estimate_agrees_for_a_while():
    # Given an estimate that is wrong by 6 m/s, in no way that any model has
    air, found = clipped()
    go_on(air, found, 0.5)
    # Then the receiver is believed, for as long as the two contradict each other
    assert found.motion.velocity_ned_m_s[0] == pytest.approx(-3.0, abs=0.25)
    go_on(air, found, 3.0)
    assert found.is_measured_apart
    assert found.motion.velocity_ned_m_s[0] == pytest.approx(-3.0, abs=0.15)
    # When the reported velocity passes the true one, as a swing does
    air.reported_off_m_s = 0.0
    go_on(air, found, 0.2)
    assert found.is_measured_apart
    air.reported_off_m_s = -1.0
    go_on(air, found, 0.5, acceleration_m_s2=4.0)
    assert found.is_measured_apart
    # When it stays there, as far as this receiver can tell
    air.reported_off_m_s = 0.18
    go_on(air, found, 0.7)
    # Then it counts again, and what the accelerometer has shown before does not once more
    assert found.motion.velocity_ned_m_s[0] == pytest.approx(air.velocities[-1], abs=0.25)
    assert not found.is_measured_apart and abs(found.velocity_error_m_s[0]) < SAME_M_S


def test_a_receiver_by_which_the_vehicle_goes_on_into_what_it_has_hit_is_later_than_believed():
    # Given one that is late by 0.2 s, though a flight seems to have shown that it is late by 0.11
    air, found = clipped(late_s=0.2)
    air.doppler.delay = Slope(0.112, 1e-3, 0.0, RECEIVER_LATEST_S)
    air.velocities = [3.0] * 75 + air.velocities
    for _ in range(70):
        go_on(air, found, 0.004)
        # Then that is not believed
        assert found.motion.velocity_ned_m_s[0] < 0.0
    # And what it shows of the motion since is
    go_on(air, found, 0.2)
    assert found.motion.velocity_ned_m_s[0] == pytest.approx(-3.0, abs=0.25)


def test_reports_that_look_as_expected_do_not_keep_the_belief_from_the_receivers_first_velocity():
    # Given a vehicle that leaves at 3 m/s, and reports of the expected 1.35 m/s, which make the belief sure and wrong
    air, found = clipped(rebound_m_s=-3.0)
    air.reported_off_m_s = 1.65
    go_on(air, found, 0.2, receives=False)
    assert found.motion.velocity_ned_m_s[0] > -1.6 and found.spread_m_s < 0.3
    go_on(air, found, 0.1)
    assert found.motion.velocity_ned_m_s[0] == pytest.approx(-3.0, abs=0.25)


def test_what_a_receiver_shows_of_the_velocity_is_shown_of_the_way_since_the_hit_too():
    # Given a vehicle that leaves at 3 m/s, not at the expected 1.35, and an estimate that flies on at 3 m/s
    air, found = clipped(rebound_m_s=-3.0)
    for _ in range(75):
        air.reported_off_m += 0.004 * air.reported_off_m_s
        go_on(air, found, 0.004)
    # When a receiver has shown it
    assert found.is_measured_apart
    assert found.motion.velocity_ned_m_s[0] == pytest.approx(-3.0, abs=0.25)
    # Then the place is not half a metre off by what was expected until then
    assert found.motion.position_ned_m[0] == pytest.approx(4.0 - 0.9, abs=0.1)


def test_how_good_a_receivers_place_is_is_learnt_from_half_a_metre_on():
    # Given one whose places are 7 cm off to the north, which is 5 cm on an axis
    air = Air(0.112)
    air.place_noise_m, known_m = 0.05 * math.sqrt(2.0), []
    for _ in range(2_500):
        air.step()
        known_m.append(math.sqrt(air.doppler.place_variance_m2))
    # Then it counts as PX4's default at first, half as good after two, and as it is in the end
    assert known_m[0] == 0.5 and 0.2 < known_m[100] < 0.36
    assert known_m[-1] == pytest.approx(0.05, rel=0.4)


def test_what_a_receiver_shows_of_the_tilt_is_learnt_on_when_the_vehicles_estimate_agrees():
    # Given a tilt that is wrong after a hit, and makes an acceleration that no accelerometer shows
    air, found = clipped()
    go_on(air, found, 2.0, unseen_m_s2=0.4)
    air.reported_off_m_s = 0.0
    go_on(air, found, 2.0, unseen_m_s2=0.4)
    assert not found.is_measured_apart
    assert found.belief(air.strapdown).level_m_s2[0] == pytest.approx(0.4, abs=0.1)
    # When it is right at last, then that is known, too, although the reported velocity counts by now
    go_on(air, found, 4.0)
    assert found.tilted_m_s2[0] == pytest.approx(0.0, abs=0.1)


def test_a_reported_velocity_that_is_right_is_believed_however_wrong_its_tilt_is():
    # Given an estimate that agrees with the receiver again, and gyroscopes by which its tilt is wrong by 3 degrees
    air, found = clipped(rebound_m_s=0.0)
    go_on(air, found, 2.0)
    air.strapdown.level_acceleration_m_s2 = (0.5, 0.0, 0.0)
    air.reported_off_m_s = 0.0
    go_on(air, found, 3.0)
    # Then its velocity counts as it is
    assert not found.is_measured_apart
    assert found.motion.velocity_ned_m_s[0] == pytest.approx(0.0, abs=0.01)


def test_an_error_that_no_model_has_is_followed_as_it_fades():
    # Given an estimate that stays wrong, as PX4's by satellites does for ten seconds
    air, found = clipped(rebound_m_s=0.0)
    go_on(air, found, 0.5)
    air.reported_off_m_s = -0.8
    go_on(air, found, 3.5)
    assert found.has_converged
    assert found.left_m_s == pytest.approx(0.8 + SAME_M_S, abs=0.1), "a jump beyond it is another hit's"
    # Then a next hit's velocity is the measured one's
    assert found.is_measured_apart
    # When it puts itself right slowly
    for _ in range(40):
        air.reported_off_m_s += 0.01
        newest = go_on(air, found, 0.1)
        # Then what is taken off it is its error, and the place is the reported one less its own
        assert found.velocity_error_m_s[0] == pytest.approx(air.reported_off_m_s, abs=0.12)
        assert abs(air.reported_off_m_s) < found.left_m_s
        north_m = newest.position_ned_m[0] - found.position_error_m[0]
        assert found.motion.position_ned_m[0] == pytest.approx(north_m, abs=0.05)
        assert 0.0 < found.spread_m_s < 0.2, "the velocity is the receiver's, and as good"
        jumps_m_s = found.correction_m_s([air.now_us - 60_000, air.now_us - 40_000, air.now_us], found.left_m_s)
        assert jumps_m_s == found.left_m_s and not found.is_valid, "for as long as that takes"
    assert found.motion.velocity_ned_m_s[0] == pytest.approx(0.0, abs=0.1)


@pytest.mark.parametrize(("noise_m", "within_m"), [(0.0, 0.1), (2.0, 0.35)])
def test_the_place_is_the_receivers_as_far_as_that_is_good_until_the_vehicles_estimate_agrees(noise_m, within_m):
    # Given a receiver whose places are known beside the vehicle's own, and an estimate that a hit leads off by 2 m
    air = Air(0.112, noise_m_s=0.02)
    air.place_noise_m = noise_m
    for _ in range(500):
        air.step()
    contact = Contact((4.0, 0.0, -2.0), (3.0, 0.0, 0.0), SOUTH)
    found = MotionEstimator(contact, air.now_us, contact.rebound(0.45), EstimateConfig())
    air.reported_off_m, air.reported_off_m_s = 2.0, 0.4
    # When it is off for longer than any model says
    for _ in range(20):
        newest = go_on(air, found, 1.0)
        air.reported_off_m = 2.0 + 0.1 * math.sin(air.now_us)
    # Then the vehicle is where the receiver has it, and what is wrong of the report is known
    assert found.is_measured_apart
    assert found.motion.position_ned_m[0] == pytest.approx(4.0, abs=within_m)
    assert found.position_error_m[0] == pytest.approx(newest.position_ned_m[0] - 4.0, abs=within_m)
    # And one fix that jumps by 50 m leads it by no more than a tenth of a metre
    before_m = found.motion.position_ned_m[0]
    jumps = GpsFix((0.0, 0.0), 47.0 + math.degrees(50.0 / EARTH_M), 8.0, 0.0)
    air.doppler.take(jumps, air.strapdown, air.newest, is_free=False)
    found.measure(air.doppler)
    assert abs(found.motion.position_ned_m[0] - before_m) < 0.1
    # When the reported velocity is right again, and the place is not
    air.reported_off_m, air.reported_off_m_s = 2.0, 0.0
    for _ in range(100):
        go_on(air, found, 0.02)
        # Then the belief stays where it was, all along
        assert found.motion.position_ned_m[0] == pytest.approx(before_m, abs=0.1 + within_m)
    assert not found.is_measured_apart


def test_gyroscopes_that_drift_mislead_the_belief_by_no_more_than_the_receivers_noise():
    # Given what a real PX4 makes of a clipped hit: 0.009 rad/s of the rates are its gyroscopes' bias
    air, found = clipped(rebound_m_s=0.0)
    go_on(air, found, 0.5, turns_rad_s=0.009)
    for _ in range(75):
        go_on(air, found, 0.1, turns_rad_s=0.009)
        # Then a vehicle at rest is known to be at rest, for as long as its own estimate is wrong
        assert found.is_measured_apart
        assert abs(found.motion.velocity_ned_m_s[0]) < 0.12


def test_one_velocity_beyond_belief_does_not_count_and_two_do():
    air, found = clipped()
    go_on(air, found, 1.0)
    belief_m_s = found.motion.velocity_ned_m_s[0]
    for expected_m_s in (belief_m_s, 20.0):
        air.now_us += 4_000
        air.strapdown.imu(air.now_us, (0.0, 0.0, -G), (0.0, 0.0, 0.0))
        found.imu(air.strapdown)
        air.doppler.take(GpsFix((30.0, 0.0), 47.0, 8.0, 0.0), air.strapdown, None, is_free=False)
        found.measure(air.doppler)
        shown_m_s = found.motion.velocity_ned_m_s[0]
        assert shown_m_s == pytest.approx(expected_m_s, abs=0.1) if expected_m_s < 0.0 else shown_m_s > expected_m_s / 4


@pytest.mark.parametrize("is_pushed", [False, True])
def test_a_receiver_that_is_silent_or_spoke_before_the_contacts_next_push_leaves_the_belief_to_the_reports(is_pushed):
    air, found = clipped()
    go_on(air, found, 1.0)
    assert found.is_measured_apart
    if is_pushed:
        found.note_contact(False, air.now_us, found.normal, 0.0)
    else:
        go_on(air, found, 0.7, receives=False)
    assert not found.is_measured_apart


def gps(**fields):
    place = {"lat": 471234567, "lon": -81234567, "alt": 488_000}
    return _gps_raw(**{"fix_type": 3, "vel": 250, "cog": 9000, **place, **fields})


def test_gps_raw_int_is_read_as_a_velocity_and_a_place():
    fix = gps()
    assert fix.velocity_ne_m_s == pytest.approx((0.0, 2.5))
    assert (fix.latitude_deg, fix.longitude_deg, fix.altitude_m) == pytest.approx((47.1234567, -8.1234567, 488.0))
    for unknown in ({"fix_type": 2}, {"vel": 0xFFFF}, {"cog": 0xFFFF}):
        assert gps(**unknown) is None
    assert isinstance(gps(vel=10_100), Refused)


@pytest.mark.parametrize(("m_s", "spread_m_s", "rests"), [(0.15, 0.04, False), (0.15, 0.06, True), (0.25, 2.0, False)])
def test_a_vehicle_rests_where_its_speed_is_above_the_limit_by_no_more_than_is_uncertain(m_s, spread_m_s, rests):
    monitor = SettlingMonitor(SettledConfig(speed_m_s=0.1, duration_s=0.5))
    found = [monitor.settled_since(t_us, 0.0, (m_s, 0.0, 0.0), spread_m_s) for t_us in range(0, 2_000_000, 20_000)]
    assert (found[-1] is not None) is rests
