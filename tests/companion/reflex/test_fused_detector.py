"""Detector `fused` on a point mass that flies by eq. 1, its messages thinned as a link thins them; what it promises."""

import math
import random
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import pytest

from companion.messages import Attitude, AttitudeTarget, ImuSample, LocalPosition, Odometry
from companion.motion.strapdown import VelocityFix
from companion.motion.vector import ZERO, plus
from companion.reflex.config import EXCESS, LEVER_M, EstimateConfig, FusedConfig
from companion.reflex.detection.detector import ON_THE_GROUND, Evidence, ImpactKind, Phase, Situation
from companion.reflex.detection.free_flight import ForceNoise
from companion.reflex.detection.fused import FusedDetector, FusedState
from companion.reflex.detection.health import promise_of
from companion.reflex.detection.impact import ImpactEstimator

TICK_US = 1_000
WINDOW_US = 4_000
GRAVITY = 9.81
HOVER_FRACTION = 0.35
IN_FLIGHT = Situation(may_crash=True, height_m=5.0)
HIT_US = 3_001_000


def nothing(t_us):
    return (0.0, 0.0, 0.0)


def pulse(force_frd, start_us=HIT_US, length_us=1_000):
    return lambda t_us: force_frd if start_us <= t_us < start_us + length_us else (0.0, 0.0, 0.0)


@dataclass
class Flight:
    """Level at `velocity`, pushed by `push(t)` (m/s^2, body)."""

    push: Callable = nothing
    imu_every_us: int = 4_000
    velocity: tuple = (2.0, 0.0, 0.0)
    noise: float = 0.25
    lift: Callable = lambda t: GRAVITY  # what the propellers push up, m/s^2
    rates: Callable = nothing
    jump: tuple | None = None  # (time, velocity step, counted): the estimator's own
    heard: tuple = (LocalPosition, Odometry, Attitude, AttitudeTarget)
    situation: Callable = lambda t: IN_FLIGHT
    lost_us: tuple = ()  # IMU samples
    slower: int = 1  # velocities come so much more seldom
    velocity_noise: float = 0.01
    is_filtered: bool = False  # samples come through a low-pass filter

    def __post_init__(self):
        self.rng = random.Random(1)

    def samples(self, until_us):
        window, resets, offset = [], 0, (0.0, 0.0, 0.0)
        for t in range(TICK_US, until_us, TICK_US):
            push, lift = self.push(t), self.lift(t)
            force = (push[0], push[1], push[2] - lift)
            self.velocity = plus(self.velocity, 1e-6 * TICK_US, (force[0], force[1], force[2] + GRAVITY))
            window = [*window[-(WINDOW_US // TICK_US - 1) :], force]
            if self.jump is not None and t == self.jump[0]:
                offset, resets = self.jump[1], resets + self.jump[2]
            seen: Any = tuple(
                v + o + self.rng.gauss(0.0, self.velocity_noise) for v, o in zip(self.velocity, offset, strict=True)
            )
            if t % self.imu_every_us == 0 and t not in self.lost_us:
                mean = [
                    sum(f[axis] for f in window) / len(window) + self.rng.gauss(0.0, self.noise * lift / GRAVITY)
                    for axis in (0, 1, 2)
                ]
                yield t, ImuSample(t, tuple(mean), self.rates(t))
            if t % (20_000 * self.slower) == 0:
                yield t, LocalPosition(t, (0.0, 0.0, -5.0), seen)
            if t % 20_000 == 0:
                yield t, Attitude(t, (1.0, 0.0, 0.0, 0.0))
                yield t, AttitudeTarget(t, HOVER_FRACTION * lift / GRAVITY)
            if t % (32_000 * self.slower) == 0:
                yield t, Odometry(t, (0.0, 0.0, -5.0), seen, resets)

    def fly(self, until_us=4_000_000, **config):
        detector = FusedDetector(FusedConfig(**config), WINDOW_US)
        self.state, impacts = detector.initial(), []
        motion = self.motion = ImpactEstimator(EstimateConfig())
        motion.hides_clipping = self.is_filtered
        for t, sample in self.samples(until_us):
            if not isinstance(sample, ImuSample) and not isinstance(sample, self.heard):
                continue
            motion.update(sample)
            impact = detector.step(self.state, sample, self.situation(t), motion)
            if impact is not None:
                impacts.append(impact)
        return impacts


# --- force --------------------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("push", "kind"), [((0.0, 0.0, 900.0), ImpactKind.CEILING), ((0.0, 0.0, -900.0), ImpactKind.STRUCK)]
)
def test_a_stiff_push_along_thrust_is_seen_because_propellers_cannot_do_it(push, kind):
    velocity = (0.0, 0.0, -1.0) if kind is ImpactKind.CEILING else (0.0, 0.0, 0.0)
    impacts = Flight(pulse(push), velocity=velocity).fly()
    assert [(i.sample_time_boot_us, i.kind) for i in impacts] == [(3_004_000, kind)]


# It hovers with 0.35 of its thrust, which is 28 m/s^2, known to 15 %; 4 m/s^2 more is a hit. Where it is unknown it may
# be 5 g.
@pytest.mark.parametrize(
    ("up_m_s2", "knows_thrust", "hits"), [(25.4, True, 0), (27.4, True, 1), (30.0, False, 0), (60.0, False, 1)]
)
def test_a_push_along_the_thrust_shows_where_it_is_more_than_the_propellers_can_make(up_m_s2, knows_thrust, hits):
    heard = (LocalPosition, Attitude, AttitudeTarget) if knows_thrust else (LocalPosition, Attitude)
    flight = Flight(pulse((0.0, 0.0, -up_m_s2), length_us=8_000), heard=heard)
    assert len(flight.fly(until_us=3_018_000)) == hits


# --- velocity jump ------------------------------------------------------------------------------------------


@pytest.mark.parametrize("imu_every_us", [10_000, 20_000])
@pytest.mark.parametrize("push", [(-950.0, 0.0, 0.0), (0.0, 0.0, 950.0), (400.0, 400.0, -400.0)])
def test_a_hit_between_the_samples_is_found_from_the_velocity_it_leaves(push, imu_every_us):
    """A rigid hit of 1 ms at 0.5 m/s, where the wire shows 4 ms of every 10 or 20."""
    impacts = Flight(pulse(push), imu_every_us=imu_every_us, velocity=(0.5, 0.0, 0.0)).fly()
    assert [i.evidence for i in impacts] == [Evidence.VELOCITY_JUMP]
    assert impacts[0].contact_free_until_boot_us <= HIT_US < impacts[0].sample_time_boot_us <= HIT_US + 100_000
    along = sum(a * b for a, b in zip(impacts[0].specific_force_frd_m_s2, push, strict=True))
    assert along > 0.97 * math.hypot(*impacts[0].specific_force_frd_m_s2) * math.hypot(*push)


@pytest.mark.parametrize(
    ("change_m_s", "slower", "hits"),
    [
        # Straight into a ceiling, without a turn: a sensor that clips at 16 g shows the estimator 1 ms of that
        ((0.0, 0.0, 0.16), 1, 1),
        ((0.0, 0.0, 0.08), 1, 0),
        # Velocities ten times a second are not compared
        ((1.5, 0.0, 0.0), 2, 1),
        ((1.5, 0.0, 0.0), 3, 0),
    ],
)
def test_of_what_no_sample_showed_the_velocity_that_it_leaves_tells(change_m_s, slower, hits):
    flight = Flight(imu_every_us=20_000, jump=(3_002_000, change_m_s, 0), slower=slower, velocity=(0.0, 0.0, -1.0))
    impacts = flight.fly(until_us=3_002_000 + 35_000 * slower**2)
    assert [impact.evidence for impact in impacts] == [Evidence.VELOCITY_JUMP] * hits


@pytest.mark.parametrize(("jump_m_s", "turns_rad_s2", "hits"), [(-0.1, 0.0, 1), (0.1, 0.0, 0), (-0.1, 60.0, 0)])
def test_a_weak_force_and_a_weak_jump_are_a_hit_together_but_for_the_force_that_begins_a_turn(
    jump_m_s, turns_rad_s2, hits
):
    """A sensor beside the centre, where no turn has shown it yet: the next rates tell what the force was."""
    flight = Flight(
        lambda t: (-1.5 * (3_015_000 < t <= 3_020_000), 0.0, 0.0),
        imu_every_us=20_000,
        jump=(3_021_000, (jump_m_s, 0.0, 0.0), 0),
        rates=lambda t: (0.0, 1e-6 * turns_rad_s2 * min(max(t - 3_020_000, 0), 40_000), 0.0),
        velocity=(1.0, 0.0, 0.0),
    )
    assert len(flight.fly(until_us=3_070_000)) == hits


# --- rate jump ----------------------------------------------------------------------------------------------


def at_once(yaw=0.0, roll=0.0, pitch=0.0):
    """Rates, rad/s, that a contact between the samples makes, and that stay."""
    return lambda t: (roll, pitch, yaw) if t > HIT_US else (0.0, 0.0, 0.0)


@pytest.mark.parametrize(
    ("rates", "scene", "hits"),
    [
        (at_once(1.4), {}, 1),
        (at_once(roll=2.8, pitch=-2.8), {}, 1),
        # Motors brake it
        (lambda t: (5.0 if HIT_US < t < 3_030_000 else 3.0 if t > HIT_US else 0.0, 0.0, 0.0), {}, 1),
        (at_once(-1.0), {}, 0),
        # It has stopped the vehicle by then
        (at_once(1.4), {"is_filtered": True, "jump": (3_002_000, (-0.7, 0.0, 0.0), 0)}, 1),
        # A broken sample after a step the other way, one before a gap, motors that turn it all they can, vibration
        (lambda t: (0.0, 0.0, {3_000_000: -0.01, 3_020_000: 9.0}.get(t, 0.0)), {}, 0),
        (lambda t: (0.0, 0.0, 9.0 if t == 3_020_000 else 0.0), {"lost_us": (3_040_000, 3_060_000)}, 0),
        (lambda t: (0.0, 0.0, 50e-6 * max(0, t - HIT_US)), {}, 0),
        (lambda t: (0.0, 0.0, random.Random(t).gauss(0.0, 2.0)), {}, 0),
        # They turn the vehicle by as much in the longer time, and tilt it as soon as that
        (at_once(2.2), {"imu_every_us": 40_000}, 0),
        (at_once(roll=1.8, pitch=-1.8), {}, 0),
        # What turns a vehicle that hovers may be a hand
        (at_once(1.4), {"velocity": (0.2, 0.0, 0.0)}, 1),
        (at_once(1.4), {"velocity": (0.1, 0.0, 0.0)}, 0),
        # A person who turns it on the ground
        (at_once(1.4), {"situation": lambda t: IN_FLIGHT._replace(off_reason="below 0.5 m")}, 0),
    ],
)
def test_an_edge_that_only_turns_a_vehicle_is_a_hit_once_the_turn_has_stayed(rates, scene, hits):
    scene = {"imu_every_us": 20_000, "velocity": (1.0, 0.0, 0.0), "rates": rates} | scene
    impacts = Flight(**scene).fly(until_us=3_100_000)
    found = [(impact.evidence, impact.kind, impact.sample_time_boot_us) for impact in impacts]
    assert found == [(Evidence.RATE_JUMP, ImpactKind.WALL, 3_040_000)] * hits
    assert all(impact.contact_free_until_boot_us == 3_000_000 for impact in impacts)


@pytest.mark.parametrize(("turns_rad_s2", "hits"), [(50.0, 0), (120.0, 1)])
def test_a_contact_of_many_samples_turns_a_vehicle_faster_than_motors_do(turns_rad_s2, hits):
    def contact(t_us):
        return (0.0, 0.0, 1e-6 * turns_rad_s2 * min(max(0, t_us - HIT_US), 50_000))

    impacts = Flight(imu_every_us=4_000, velocity=(1.0, 0.0, 0.0), rates=contact).fly(until_us=3_150_000)
    assert [impact.evidence for impact in impacts] == [Evidence.RATE_JUMP] * hits


def test_what_a_felt_contact_still_turns_is_no_other_hit():
    flight = Flight(pulse((-30.0, 0.0, 0.0), 3_009_000, 12_000), imu_every_us=20_000)
    flight.rates = lambda t: (0.0, 0.0, 3.0 if t > 3_020_000 else 0.0)
    assert [impact.evidence for impact in flight.fly(until_us=3_150_000)] == [Evidence.FORCE]


@pytest.mark.parametrize(
    ("counted", "heard_odometry", "is_filtered", "hits"),
    [(1, True, False, 0), (0, True, False, 1), (1, False, False, 1), (0, True, True, 0)],
)
def test_a_jump_that_the_estimator_counts_or_that_no_filtered_sample_shows_is_no_hit(
    counted, heard_odometry, is_filtered, hits
):
    """Without ODOMETRY nothing tells the two apart: that is what is lost. Behind a filter a hit is a pulse."""
    heard = (LocalPosition, Odometry, Attitude) if heard_odometry else (LocalPosition, Attitude)
    jump = (3_000_000, (0.8, 0.0, 0.0), counted)
    assert len(Flight(imu_every_us=20_000, jump=jump, heard=heard, is_filtered=is_filtered).fly()) == hits


def test_a_sudden_climb_is_no_hit_before_it_is_known_how_late_velocities_are():
    assert Flight(lift=lambda t: GRAVITY * (2.6 if t >= 2_976_000 else 1.0)).fly(3_600_000) == []


@pytest.mark.parametrize("jump_m_s", [0.0, -1.0])
def test_vibration_that_comes_to_beat_with_the_stream_is_no_jump_and_hides_none(jump_m_s):
    # Given rotors that turn faster, until 4 ms in 20 show their vibration always at nearly the same phase
    def shakes(t_us):
        turns = 1e-6 * (t_us - HIT_US) * (95.0 if t_us > HIT_US else 87.0)
        return 6.0 * math.sin(2.0 * math.pi * turns), 0.0, 0.0

    jump = (4_001_000, (jump_m_s, 0.0, 0.0), 0)
    impacts = Flight(shakes, imu_every_us=20_000, noise=0.1, velocity_noise=0.005, jump=jump).fly(4_200_000)
    assert [impact.evidence for impact in impacts] == [Evidence.VELOCITY_JUMP] * bool(jump_m_s)


def test_a_hit_is_no_noise_that_would_hide_the_next_one():
    struck, free = (Flight(pulse((f, 0.0, 0.0)), 20_000, velocity_noise=0.05) for f in (-3000.0, 0.0))
    assert (len(struck.fly(3_400_000)), len(free.fly(3_400_000))) == (1, 0)
    assert struck.state.velocity.limit < 1.1 * free.state.velocity.limit


def test_a_hit_against_a_wind_shows_by_how_it_differs_from_that():
    def push(t):
        return (1.6 if HIT_US < t < HIT_US + 60_000 else -0.6, 0.0, 0.0)

    assert len(Flight(push, noise=0.05).fly()) == 1


# --- no collision -------------------------------------------------------------------------------------------


def gone(t):
    return max(0.0, 1.0 - (t - HIT_US) / 60_000) if t > HIT_US else 1.0


@pytest.mark.parametrize("imu_every_us", [4_000, 20_000])
@pytest.mark.parametrize(
    "scene",
    [
        {"lift": lambda t: GRAVITY * gone(t)},  # free fall
        {
            "lift": lambda t: GRAVITY * (0.75 + 0.25 * gone(t)),
            "rates": lambda t: (80e-6 * max(0, t - HIT_US), 0.0, 0.0),
        },
        {"lift": lambda t: GRAVITY * (1.0 if t < HIT_US else 1.3)},  # payload dropped: 30 % more lift for its mass
        {"lift": lambda t: GRAVITY * (1.0 + 0.4 * math.sin(t * 20e-6))},  # climbs and dives
        {"push": lambda t: (1.1 * min(1.0, max(0.0, (t - HIT_US) / 3e5)), 0.0, 0.0)},  # a gust of 5 m/s in 0.3 s
        {
            "push": lambda t: (10.4 * min(1.0, max(0.0, (t - HIT_US) / 8e5)), 0.0, 0.0),
            "noise": 0.05,
        },  # a storm in 0.8 s
        {"noise": 2.5},
        {"noise": 1.0, "lift": lambda t: GRAVITY * (1.0 + min(1.5, max(0, t - HIT_US) / 6e4))},  # and more as it climbs
        {"push": lambda t: (1.5 * (t > HIT_US), 0.0, 0.0)},  # an accelerometer whose zero moves at once
        {"push": lambda t: (-3.0 * min(1.0, max(0.0, (t - HIT_US) / 1.5e6)) * (t < 5_000_000), 0.0, 0.0)},  # a door
    ],
    ids=[
        "free fall",
        "motor fails",
        "payload drop",
        "climbs",
        "gust",
        "storm",
        "shaking",
        "shaking climb",
        "zero moves",
        "end",
    ],
)
def test_what_a_flight_does_to_itself_is_no_hit(scene, imu_every_us):
    until_us = 3_150_000 if "rates" in scene else 6_000_000
    assert Flight(imu_every_us=imu_every_us, **scene).fly(until_us) == []


def rolling(rad_s2, from_us=1_500_000, turns_rad_s=6e-6 * math.pi):
    """Angular acceleration and rate of a vehicle that rolls to and fro, by time."""
    return (
        lambda t_us: rad_s2 * math.sin(turns_rad_s * max(t_us - from_us, 0)),
        lambda t_us: (1e-6 * rad_s2 / turns_rad_s * (1.0 - math.cos(turns_rad_s * max(t_us - from_us, 0))), 0.0, 0.0),
    )


@pytest.mark.parametrize("above_m", [0.08, -0.05])
def test_what_a_sensor_beside_the_centre_shows_of_a_turn_is_no_hit_and_a_push_then_is(above_m):
    # Given a vehicle that rolls, its sensor above the centre or below, and a push of 4 m/s^2
    turned, rates = rolling(60.0, turns_rad_s=12e-6 * math.pi)

    def push(t_us):
        return (0.0, above_m * turned(t_us) + (4.0 if t_us >= HIT_US else 0.0), 0.0)

    flight = Flight(push, rates=rates, heard=(Attitude, AttitudeTarget))
    # When it flies on, then the push alone is a hit, in its first whole sample; where the sensor is has been learnt
    assert [i.sample_time_boot_us for i in flight.fly(3_500_000)] == [pytest.approx(HIT_US + 4_000, abs=4_000)]
    assert flight.motion.lever.place_frd_m[2] == pytest.approx(-above_m, abs=0.01)


@pytest.mark.parametrize(("rad_s2", "is_known"), [(8.0, False), (20.0, True)])
def test_a_turn_needs_a_stronger_force_until_one_beyond_the_gyroscopes_noise_has_shown_where_the_sensor_is(
    rad_s2, is_known
):
    flight = Flight(rates=rolling(rad_s2)[1], heard=(Attitude, AttitudeTarget))
    assert flight.fly(3_500_000) == []
    flight.state.threshold_m_s2 = 1.75
    for rate_rad_s in (0.0, 0.0, 0.24, 0.48):
        flight.motion.lever.imu(4_000, ZERO, (rate_rad_s, 0.0, 0.0), 4_000)
    # Then it does along what the turn makes of a sensor above or below, and across that none
    most_m_s2 = 1.9 if is_known else math.hypot(1.75, 4.2 * 0.05 * 60.0)
    lever = flight.motion.lever
    along, across = (flight.state.side_m_s2(*push, FusedConfig(), lever) for push in ((0.0, 1.0), (1.0, 0.0)))
    assert along == pytest.approx((1.75 + lever.unseen_m_s2) / most_m_s2, rel=0.1) and across == pytest.approx(1.0)


def test_a_hit_that_turns_the_vehicle_shows_across_what_the_turn_makes_of_a_sensor_of_unknown_height():
    # Given a hit that rolls a vehicle with 100 rad/s^2, and pushes it back through a filter
    def rolls(t_us):
        return (1e-4 * min(max(t_us - HIT_US, 0), 20_000), 0.0, 0.0)

    flight = Flight(lambda t_us: (-6.0 * (0 <= t_us - HIT_US < 20_000), 0.0, 0.0), rates=rolls)
    # Then its first whole sample shows it
    (hit,) = flight.fly(3_500_000)
    assert hit.sample_time_boot_us == pytest.approx(HIT_US + 4_000, abs=4_000) and hit.evidence is Evidence.FORCE


def test_a_spin_about_the_thrust_shows_where_the_sensor_is_though_drag_changes_with_it():
    # Given a sensor 0.06 m ahead, a vehicle that spins to and fro, and 1 m/s^2 of drag since it first did
    def yaw_rad_s(t_us):
        return 6.0 * math.sin(0.5e-6 * math.pi * max(t_us - 1_500_000, 0))

    def push(t_us):
        turns_rad_s2 = 1e3 * (yaw_rad_s(t_us) - yaw_rad_s(t_us - 1_000))
        since_s = 1e-6 * max(t_us - 1_500_000, 0)
        drag, yaw_rad = since_s > 0.0, 12.0 / math.pi * (1.0 - math.cos(0.5 * math.pi * since_s))
        ahead, right = drag * math.cos(yaw_rad), -drag * math.sin(yaw_rad)
        return (ahead - 0.06 * yaw_rad_s(t_us) ** 2, right + 0.06 * turns_rad_s2, 0.0)

    flight = Flight(push, rates=lambda t_us: (0.0, 0.0, yaw_rad_s(t_us)), heard=(Attitude, AttitudeTarget))
    # When it flies on, then that is learnt of it, and nothing was a hit
    assert flight.fly(7_500_000) == []
    assert flight.motion.lever.place_frd_m == pytest.approx((0.06, 0.0, 0.0), abs=0.01)


def test_one_sample_of_a_fast_spin_may_be_a_contacts_and_teaches_little():
    def spin(t_us):
        return (0.0, 0.0, 10.0 * (t_us > 3_000_000))

    flight = Flight(imu_every_us=20_000, rates=spin, heard=(Attitude, AttitudeTarget))
    flight.fly(3_070_000)
    assert 0.015 < flight.motion.lever.errors_m[0] < LEVER_M


def test_what_comes_just_before_a_hit_teaches_nothing_of_the_sensors_place():
    # Given a spin within which a contact begins with less than its limit
    def spin(t_us):
        return (0.0, 0.0, 10.0 * (t_us > 3_000_000))

    def contact(t_us):
        return (-6.0 if 3_045_000 < t_us < 3_065_000 else -40.0 if 3_065_000 <= t_us < 3_085_000 else 0.0, 0.0, 0.0)

    flight = Flight(contact, imu_every_us=20_000, rates=spin, noise=0.0, heard=(Attitude, AttitudeTarget))
    (impact,) = flight.fly(3_300_000)
    assert impact.sample_time_boot_us == 3_080_000
    assert flight.motion.lever.place_frd_m == pytest.approx(ZERO, abs=0.001)


def test_a_vehicle_that_shakes_must_show_a_weak_force_twice_and_a_strong_one_once():
    once = Flight(pulse((0.0, 10.5, 0.0), 3_000_500, 4_000), noise=1.5, heard=(Attitude, AttitudeTarget))
    assert once.fly() == [] and once.state.threshold_m_s2 > 8.0
    (twice,) = Flight(pulse((0.0, 13.0, 0.0), 3_000_500, 20_000), noise=1.5).fly()
    assert twice.sample_time_boot_us in (3_004_000, 3_008_000)
    together = Flight(pulse((0.0, 8.5, 0.0), 3_000_500, 8_000), noise=1.5)
    assert [i.contact_free_until_boot_us for i in together.fly()] == [3_000_000]
    assert together.state.peak_specific_force_m_s2 < together.state.threshold_m_s2
    pushes = {750: (0.0, 10.0, 0.0), 751: (9.5, 0.0, 0.0)}
    (turning,) = Flight(lambda t: pushes.get((t - 500) // 4_000, ZERO), noise=1.5).fly()
    ahead, right, _ = turning.specific_force_frd_m_s2  # of both
    assert 0.5 < ahead / right < 2.0
    pushes = {750: (0.0, 6.0, 0.0), 751: (0.0, 6.0, 80.0)}
    (from_above,) = Flight(lambda t: pushes.get((t - 500) // 4_000, ZERO), noise=1.5).fly()
    assert from_above.specific_force_frd_m_s2[2] > 70.0  # one sample's alone
    strong = Flight(pulse((0.0, 100.0, 0.0), 3_000_500, 4_000), noise=1.5).fly()
    assert [i.sample_time_boot_us for i in strong] == [3_004_000]
    (with_jump,) = Flight(once.push, noise=1.5).fly()
    assert with_jump.is_shown_twice and with_jump.specific_force_frd_m_s2[1] > 0.9 * with_jump.size_m_s2
    assert Flight(once.push, noise=1.5, jump=(3_005_000, (0.0, -0.1, 0.0), 0)).fly() == []  # as of a bias
    for until_us in (3_008_500, 3_012_500):  # two together point where their sum does, though the last is opposite
        two = Flight(lambda t: (0.0, {750: 9.0, 751: -3.0}.get((t - 500) // 4_000, 0.0), 0.0), noise=1.5)
        assert two.fly(until_us) == [] and two.state.both(0.9, (0.0, 1.0, 0.0)) is not None
    assert Flight(lambda t: (0.0, {750: 10.0, 751: -10.0}.get((t - 500) // 4_000, 0.0), 0.0), noise=1.5).fly() == []


def test_a_hits_first_sample_does_not_raise_what_it_must_reach_with_its_second():
    # Given a graze at 50 Hz that either sample shows too weakly, and the first beyond what noise ever is
    graze = Flight(
        lambda t: (0.0, {150: 16.0, 151: 8.0}.get((t - 500) // 20_000, 0.0), 0.0), noise=1.5, imu_every_us=20_000
    )
    assert [i.sample_time_boot_us for i in graze.fly()] == [3_040_000]


def test_a_sample_that_is_a_hit_alone_is_no_mean_with_the_weak_one_before_it():
    hit = Flight(
        lambda t: (0.0, {150: 8.0, 151: 20.0}.get((t - 500) // 20_000, 0.0), 0.0), noise=1.5, imu_every_us=20_000
    )
    assert [i.specific_force_frd_m_s2[1] for i in hit.fly()] == [pytest.approx(20.0, abs=3.0)]


@pytest.mark.parametrize(("before_m_s2", "is_shown_twice"), [(1.0, False), (1.7, True)])
def test_a_sample_that_almost_was_a_hit_shows_the_next_one_too(before_m_s2, is_shown_twice):
    hit = Flight(lambda t: (0.0, {750: before_m_s2, 751: 20.0}.get((t - 500) // 4_000, 0.0), 0.0), noise=0.02)
    assert [i.is_shown_twice for i in hit.fly()] == [is_shown_twice]


def test_a_hand_is_a_contact_and_a_thrown_ball_is_not():
    def grip(t):
        return (6.0 * min(1.0, (t - HIT_US) / 150_000), 0.0, 0.0) if HIT_US < t < HIT_US + 400_000 else (0.0, 0.0, 0.0)

    hand = Flight(grip, velocity=(0.0, 0.0, 0.0)).fly()
    ball = Flight(pulse((80.0, 0.0, 0.0), length_us=8_000), velocity=(0.0, 0.0, 0.0)).fly()
    assert [(i.kind, i.is_collision) for i in hand] == [(ImpactKind.CONTACT, False)]
    assert [(i.kind, i.is_collision) for i in ball] == [(ImpactKind.STRUCK, True)]


@pytest.mark.parametrize(("force_m_s2", "kind"), [(4.0, ImpactKind.CONTACT), (6.0, ImpactKind.STRUCK)])
def test_a_soft_strike_on_a_hovering_vehicle_is_known_by_how_suddenly_it_begins(force_m_s2, kind):
    flight = Flight(pulse((force_m_s2, 0.0, 0.0), length_us=100_000), velocity=(0.0, 0.0, 0.0), noise=0.02)
    assert [impact.kind for impact in flight.fly(3_300_000)] == [kind]


@pytest.mark.parametrize(("speed_m_s", "own_m_s2", "from_us"), [(0.3, -1.0, 2_400_000), (0.0, -1.5, 2_560_000)])
def test_what_stops_a_vehicle_that_turns_back_or_has_left_its_hover_is_no_hand(speed_m_s, own_m_s2, from_us):
    def soft(t):
        own, grip = max(0, t - from_us) / 100_000, max(0, t - HIT_US) / 150_000
        return (6.0 * min(1.0, grip) + own_m_s2 * min(1.0, own), 0.0, 0.0)

    touched = Flight(soft, velocity=(speed_m_s, 0.0, 0.0)).fly(HIT_US + 150_000)
    assert [i.is_collision for i in touched] == [True]


# --- phases -------------------------------------------------------------------------------------------------


@pytest.mark.parametrize(("after_us", "hits"), [(200_000, 0), (400_000, 1)])
def test_after_take_off_the_rotors_noise_is_learnt_before_a_hit_counts(after_us, hits):
    off_us = 2_700_000

    def situation(t_us):
        return IN_FLIGHT._replace(off_reason=ON_THE_GROUND if t_us < off_us else None)

    flight = Flight(pulse((-30.0, 0.0, 0.0), off_us + after_us, 8_000), situation=situation)
    assert len(flight.fly(off_us + 700_000)) == hits


def test_one_contact_is_one_impact_and_a_shaking_that_stays_is_learnt():
    loud = Flight(lambda t: (20.0 * math.sin(t * 1e-3), 0.0, 0.0) if t > HIT_US else (0.0, 0.0, 0.0))
    assert len(loud.fly(8_000_000)) == 1
    assert loud.state.phase is Phase.ARMED
    assert loud.state.threshold_m_s2 > 20.0


def test_what_shakes_along_its_thrust_may_shake_sideways_a_third_as_much_at_once():
    def shakes(t):
        return (-1) ** (t // WINDOW_US)

    calm: dict[str, Any] = {"lift": lambda t: GRAVITY + 3.0 * shakes(t), "heard": (Attitude, AttitudeTarget)}
    assert Flight(lambda t: (4.5 * shakes(t) * (t > HIT_US), 0.0, 0.0), **calm).fly() == []
    assert len(Flight(pulse((0.0, 4.0, 0.0), HIT_US, 20_000), **calm).fly()) == 1


@pytest.mark.parametrize(("before", "now", "shakes"), [(1.0, 1.0, 1.0), (1.0, 1.5, 1.5), (1.5, 1.0, 1.0)])
def test_vibration_grows_with_the_load_at_once_and_falls_as_it_is_seen_to(before, now, shakes):
    # Given four seconds of noise at one load, then a sample at another
    noise, draw = ForceNoise(), random.Random(1)
    for load in [before] * 800 + [now]:
        noise.learn((draw.gauss(0.0, 1.0), 0.0, -GRAVITY * load), 0.005, load)
    assert noise.side_m_s2 == pytest.approx(EXCESS * shakes, rel=0.1)


def test_what_thrust_there_is_is_learnt_before_the_detector_trusts_its_noise():
    # Given half a second in free air, which is enough to recover by (THRUST_LEARNT_S)
    flown = Flight()
    flown.fly(until_us=700_000)
    assert flown.state.phase is Phase.QUIET and flown.state.thrust.known_s > 0.5
    assert flown.state.thrust.full_m_s2 == pytest.approx(GRAVITY / HOVER_FRACTION, rel=0.02)


FIXES = [VelocityFix(time_us, ZERO, ZERO) for time_us in range(0, 1_000_001, 20_000)]
CONFIG = FusedConfig()


def promise(side_m_s2, imu_hz=250):
    state = FusedState()
    state.floor.side_m_s2 = EXCESS * side_m_s2
    state.threshold_m_s2 = max(CONFIG.side_threshold_m_s2, CONFIG.noise_factor * EXCESS * side_m_s2)
    state.jump.known = 100
    return promise_of(state, CONFIG, FIXES, imu_hz, True)


def test_noise_exceeds_its_bound_once_in_half_a_thousand_hours_and_a_quiet_vehicle_promises_less_and_sees_more():
    quiet, loud = promise(side_m_s2=0.1), promise(side_m_s2=2.0)
    # 6.3 standard deviations, 250 samples a second
    assert loud.false_alarms_per_h == pytest.approx(1.0 / 460.0, rel=0.1)
    assert promise(side_m_s2=2.0, imu_hz=50).false_alarms_per_h == pytest.approx(1.0 / 2300.0, rel=0.1)
    assert quiet.false_alarms_per_h < 1e-6 * loud.false_alarms_per_h
    assert quiet.force_m_s2 == CONFIG.side_threshold_m_s2 < loud.force_m_s2
