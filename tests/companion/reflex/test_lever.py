"""Where the accelerometer is: what a turn shows there is allowed for, and its height is learnt; on a rigid body."""

import math
import random
from typing import Any

import numpy as np
import pytest

from companion.messages import GpsFix, ImuSample, LocalPosition
from companion.motion.config import GRAVITY_M_S2
from companion.motion.strapdown import VelocityFix
from companion.motion.vector import ZERO
from companion.reflex.belief.motion_estimator import MotionEstimator
from companion.reflex.config import TURNS_PER_S2, EstimateConfig, FusedConfig
from companion.reflex.detection.free_flight import Lever
from companion.reflex.detection.impact import ImpactEstimator
from companion.reflex.detection.jumps import RateJump, VelocityJump
from companion.reflex.surface import Contact

WINDOW_US = 4_000
STEPS = 4  # of a window


class Turning:
    """It turns about x and y in bursts (rad/s^2), and about z evenly; its sensor is at a place (FRD, m)."""

    def __init__(self, place_m, burst_rad_s2, every_us=WINDOW_US, yaw_rad_s=0.0, noise_rad_s=0.0, period_s=0.25):
        self.place_m, self.burst_rad_s2, self.every_us = np.array(place_m), burst_rad_s2, every_us
        self.period_s = period_s
        self.rates = np.array([0.0, 0.0, yaw_rad_s])
        self.noise_rad_s, self.rng = noise_rad_s, random.Random(2)

    def _turns_rad_s2(self, t_s):
        # To and fro: motors take an eighth of the period from one to the other.
        burst = self.burst_rad_s2 * math.sin(2.0 * math.pi * t_s / self.period_s) ** 3
        return np.array([0.6 * burst, -0.8 * burst, 0.0])

    def samples(self, until_s):
        """Force and rates, each the mean of a window."""
        step_s, kept = 1e-6 * WINDOW_US / STEPS, []
        for step in range(1, round(until_s / step_s)):
            turns = self._turns_rad_s2(step * step_s)
            self.rates = self.rates + step_s * turns
            force = np.cross(turns, self.place_m) + np.cross(self.rates, np.cross(self.rates, self.place_m))
            kept = [*kept[1 - STEPS :], (force, self.rates)]
            if step % (STEPS * self.every_us // WINDOW_US) == 0:
                f, w = np.mean(kept, axis=0)
                yield tuple(f.tolist()), tuple(rate + self.rng.gauss(0.0, self.noise_rad_s) for rate in w.tolist())

    def fly(self, lever, until_s):
        """The sideways force at the centre, and from where on that is a hit, m/s^2."""
        config, turn = FusedConfig(), RateJump()
        for number, (f, w) in enumerate(self.samples(until_s)):
            turn.imu(number * self.every_us, (number + 1) * self.every_us, w, config)
            lever.imu(self.every_us, f, w, WINDOW_US)
            x, y, _ = lever.force_frd_m_s2
            turned_m_s2 = config.noise_factor * math.hypot(*lever.error_frd_m_s2)
            yield math.hypot(x, y), math.hypot(config.side_threshold_m_s2, turned_m_s2) + lever.unseen_m_s2
            if turn.turns_rad_s2 > TURNS_PER_S2 or lever.spins_per_s2 > TURNS_PER_S2:
                lever.learn(0.25, 1e-6 * self.every_us)


@pytest.mark.parametrize(
    ("place_m", "burst_rad_s2", "every_us", "yaw_rad_s"),
    [
        ((0.0, 0.0, -0.08), 60.0, WINDOW_US, 0.0),
        ((0.0, 0.0, -0.08), 160.0, WINDOW_US, 0.0),  # more than most motors make
        ((0.0, 0.0, -0.08), 95.0, 5 * WINDOW_US, 0.0),  # most of it is between the samples
        ((0.05, 0.01, 0.0), 30.0, WINDOW_US, 6.0),
        ((0.05, 0.0, -0.05), 60.0, 2 * WINDOW_US, 3.0),
    ],
)
def test_what_a_turn_shows_beside_the_centre_is_no_hit(place_m, burst_rad_s2, every_us, yaw_rad_s):
    lever = Lever()
    shown = list(Turning(place_m, burst_rad_s2, every_us, yaw_rad_s).fly(lever, 6.0))
    assert max(size / limit for size, limit in shown[1:]) < 0.9
    assert lever.place_frd_m[2] == pytest.approx(place_m[2], abs=0.015)


def test_a_turn_that_begins_sooner_than_the_rates_show_is_no_hit_either() -> None:
    # Two rates differ by what was half an interval ago.
    lever, turning = Lever((0.0, 0.0, -0.08), (0.05, 0.05, 0.002)), Turning((0.0, 0.0, -0.08), 160.0, period_s=0.08)
    assert max(size / limit for size, limit in list(turning.fly(lever, 6.0))[1:]) < 0.9


def test_a_turn_about_two_axes_at_once_is_taken_off_once_the_height_is_known() -> None:
    rates = np.array([3.0, -2.0, 4.0])
    force = tuple(np.cross(rates, np.cross(rates, (0.0, 0.0, -0.1))).tolist())
    assert math.hypot(*force[:2]) > 1.4
    lever = Lever((0.0, 0.0, -0.1))
    for _ in range(60):
        lever.imu(WINDOW_US, force, tuple(rates.tolist()), WINDOW_US)
    assert math.hypot(*lever.force_frd_m_s2[:2]) < 1e-6


@pytest.mark.parametrize("noise_rad_s", [0.005, 0.03])
def test_the_height_is_learnt_however_noisy_the_gyroscopes_are(noise_rad_s) -> None:
    lever, turning = Lever(), Turning((0.0, 0.0, -0.07), 40.0, noise_rad_s=noise_rad_s)
    list(turning.fly(lever, 12.0))
    assert lever.place_frd_m[2] == pytest.approx(-0.07, rel=0.1)
    assert lever.errors_m[2] < 0.01


def test_one_forged_rate_makes_little_of_a_force_and_none_after_it() -> None:
    lever = Lever((0.0, 0.0, -0.05))
    rates = [(0.0, 0.0, 0.0)] * 5 + [(30.0, 0.0, 0.0)] + [(0.0, 0.0, 0.0)] * 5
    shown = []
    for rate in rates:
        lever.imu(WINDOW_US, (0.0, 0.0, -9.8), rate, WINDOW_US)
        shown.append(math.hypot(*lever.force_frd_m_s2[:2]))
    assert shown[5] == pytest.approx(0.05 * 100.0)
    assert max(shown[:5] + shown[6:]) < 0.1


def test_across_a_gap_nothing_is_known_of_a_turn() -> None:
    lever = Lever((0.0, 0.0, -0.05))
    lever.imu(WINDOW_US, (0.0, 0.0, -9.8), (0.0, 0.0, 0.0), WINDOW_US)
    lever.imu(200_000, (1.0, 0.0, -9.8), (3.0, 2.0, 1.0), WINDOW_US)
    assert lever.force_frd_m_s2 == (1.0, 0.0, -9.8)
    assert (lever.error_frd_m_s2, lever.unseen_m_s2) == ((0.0, 0.0), 0.0)


PLACE_M = (0.06, -0.02, -0.05)


def spinning(rates, turns):
    """What an accelerometer there shows of it, FRD, beside a hover's thrust."""
    return np.cross(turns, PLACE_M) + np.cross(rates, np.cross(rates, PLACE_M)) - (0.0, 0.0, GRAVITY_M_S2)


def test_a_spin_that_a_hit_leaves_shows_all_of_the_place() -> None:
    lever, rates = Lever(), np.array([8.0, -6.0, 14.0])
    lever.imu(WINDOW_US, ZERO, tuple(rates.tolist()), WINDOW_US)  # the contact
    lever.imu(WINDOW_US, ZERO, tuple(rates.tolist()), WINDOW_US)
    for _ in range(120):
        turns = -rates / (0.1, 0.3, 0.2)
        force, rates = spinning(rates, turns), rates + 0.004 * turns
        lever.imu(WINDOW_US, tuple(force.tolist()), tuple(rates.tolist()), WINDOW_US)
        lever.learn(0.2, 0.004)
    assert lever.place_frd_m == pytest.approx(PLACE_M, abs=0.01)
    assert max(lever.errors_m) < 0.02
    assert lever.force_frd_m_s2[:2] == pytest.approx((0.0, 0.0), abs=0.5)


def test_a_spin_that_goes_on_as_fast_shows_the_place_too_as_drag_turns_against_it() -> None:
    lever, rates = Lever(), np.array([0.0, 0.0, 5.0])
    for tick in range(1000):
        yaw_rad = 0.004 * 5.0 * tick
        force = spinning(rates, ZERO) + np.array([math.cos(yaw_rad), -math.sin(yaw_rad), 0.0])
        lever.imu(WINDOW_US, tuple(force.tolist()), tuple(rates.tolist()), WINDOW_US)
        lever.learn(0.2, 0.004)
    assert lever.place_frd_m[:2] == pytest.approx(PLACE_M[:2], abs=0.01)


def spun_up(known_from_tick, pushed_m_s2=0.0):
    """A vehicle at rest in the air that spins up about its thrust within 0.1 s, and on for 0.22 s; and the belief.

    The sensor's place is known from that sample on. What turns it pushes it, too.
    """
    source, now_us = ImpactEstimator(EstimateConfig()), 1_000_000
    source.strapdown.time_boot_us = now_us
    source.update(LocalPosition(now_us, ZERO, ZERO))
    contact = Contact(ZERO, ZERO, (-1.0, 0.0, 0.0))
    source.followed = [found := MotionEstimator(contact, now_us, contact.rebound(0.0), EstimateConfig())]
    rates: Any = np.zeros(3)
    for tick in range(80):
        source.lever.place_frd_m = PLACE_M if tick >= known_from_tick else ZERO
        turns = np.array([0.0, 0.0, 80.0 if tick < 25 else 0.0])
        rates, now_us = rates + 0.004 * turns, now_us + 4_000
        force = spinning(rates - 0.002 * turns, turns) + np.array([pushed_m_s2 if tick < 25 else 0.0, 0.0, 0.0])
        source.update(ImuSample(now_us, tuple(force.tolist()), tuple(rates.tolist())))
        if tick == 15:
            source.update(LocalPosition(now_us, ZERO, ZERO))
    return source, found


def test_what_a_sensor_beside_the_centre_shows_of_a_spin_moves_neither_the_belief_nor_a_receivers_velocity() -> None:
    source, found = spun_up(known_from_tick=0)
    # The sensor moves, the vehicle does not.
    assert math.hypot(*source.strapdown.sum_ned_m_s) > 0.3
    assert math.hypot(*found.motion.velocity_ned_m_s) < 0.05 and math.hypot(*found.external_m_s2) < 0.3
    source.update(GpsFix((0.0, 0.0), 47.0, 8.0, 0.0))
    assert math.hypot(*source.doppler.velocity_ned_m_s) < 0.05


def test_a_place_that_is_known_late_counts_for_all_of_the_turn() -> None:
    late_m_s, never_m_s = (math.hypot(*spun_up(tick)[1].motion.velocity_ned_m_s) for tick in (60, 80))
    assert late_m_s < 0.2 and never_m_s > 0.3


def test_a_turn_that_the_contact_itself_makes_is_in_the_expected_rebound() -> None:
    _, found = spun_up(known_from_tick=0, pushed_m_s2=30.0)
    assert math.hypot(*found.motion.velocity_ned_m_s) < 0.05


@pytest.mark.parametrize("is_told", [False, True])
def test_velocities_are_those_of_the_sensor_or_of_the_centre_as_the_vehicle_has_been_told(is_told) -> None:
    # Given a vehicle that rolls to and fro, its sensor 0.08 m above the centre, and velocities with 0.01 m/s of noise
    jump, noise, fixes, sizes = VelocityJump(), random.Random(3), list[VelocityFix](), list[tuple[float, float]]()
    for tick in range(300):
        turns = (0.0, 0.4 * math.sin(0.3 * tick), 0.0)
        seen = (noise.gauss(0.0, 0.01), (0.0 if is_told else turns[1]) + noise.gauss(0.0, 0.01), 0.0)
        fixes.append(VelocityFix(33_000 * tick, seen, turns, turns))
        step = jump.step_m_s(fixes)
        if step is not None:
            sizes.append((math.hypot(*step), jump.error_m_s))
            jump.learn(step)
    # Then what is left of either is noise, once that is known, and until then no more than may be
    assert max(size for size, _ in sizes[20:]) < 0.06
    assert max(size - 4.2 * error for size, error in sizes) < 0.06
    assert sizes[-1][1] < 0.02
    assert jump.told.found(jump.variance_m2_s2)[0] == pytest.approx(float(is_told), abs=0.02)
