"""Detector `fused` on a point mass that flies by eq. 1, its messages thinned as a link thins them."""

import math
import random
from dataclasses import replace

import pytest

from companion.messages import Attitude, AttitudeTarget, ImuSample, LandedState, LocalPosition, Odometry
from companion.motion.strapdown import Strapdown
from companion.reflex.config import FusedConfig
from companion.reflex.detector import Evidence, ImpactKind, Phase, Situation
from companion.reflex.fused import FusedDetector
from companion.reflex.thrust import ThrustGain
from companion.reflex.velocity_jump import VelocityJump

TICK_US = 1_000
WINDOW_US = 4_000
GRAVITY = 9.81
HOVER_FRACTION = 0.7
IN_FLIGHT = Situation(armed=True, landed_state=LandedState.IN_AIR, height_m=5.0)
HIT_US = 3_001_000


def nothing(t_us):
    return (0.0, 0.0, 0.0)


def pulse(force_frd, start_us=HIT_US, length_us=1_000):
    return lambda t_us: force_frd if start_us <= t_us < start_us + length_us else (0.0, 0.0, 0.0)


class Flight:
    """Level at `velocity`, pushed by `push(t)` (m/s^2, body); everything else is the scene's."""

    def __init__(self, push=nothing, imu_every_us=4_000, velocity=(2.0, 0.0, 0.0), noise=0.25, seed=1, **scene):
        self.push, self.imu_every_us, self.noise = push, imu_every_us, noise
        self.velocity = list(velocity)
        self.lift = scene.pop("lift", lambda t: GRAVITY)  # what the propellers push up, m/s^2
        self.rates = scene.pop("rates", lambda t: (0.0, 0.0, 0.0))
        self.jump = scene.pop("jump", None)  # (time, velocity step, counted): the estimator's own
        self.heard = scene.pop("heard", (LocalPosition, Odometry, Attitude, AttitudeTarget))
        self.situation = scene.pop("situation", lambda t: IN_FLIGHT)
        self.slower = scene.pop("slower", 1)  # velocities come so much more seldom
        self.late_us = scene.pop("late_us", 0)  # the velocities are those of so long ago
        assert not scene
        self.rng = random.Random(seed)

    def samples(self, until_us):
        window, resets, offset, flown = [], 0, (0.0, 0.0, 0.0), []
        for t in range(TICK_US, until_us, TICK_US):
            push, lift = self.push(t), self.lift(t)
            force = (push[0], push[1], push[2] - lift)
            self.velocity = [
                v + a * TICK_US * 1e-6
                for v, a in zip(self.velocity, (force[0], force[1], force[2] + GRAVITY), strict=True)
            ]
            window = [*window[-(WINDOW_US // TICK_US - 1) :], force]
            if self.jump is not None and t == self.jump[0]:
                offset, resets = self.jump[1], resets + self.jump[2]
            flown = [*flown[-(self.late_us // TICK_US) :], self.velocity] if self.late_us else [self.velocity]
            seen = tuple(v + o + self.rng.gauss(0.0, 0.01) for v, o in zip(flown[0], offset, strict=True))
            if t % self.imu_every_us == 0:
                mean = [
                    sum(f[axis] for f in window) / len(window) + self.rng.gauss(0.0, self.noise) for axis in (0, 1, 2)
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
        self.state, impacts, strapdown = detector.initial(), [], Strapdown()
        for t, sample in self.samples(until_us):
            if not isinstance(sample, ImuSample) and not isinstance(sample, self.heard):
                continue
            match sample:
                case ImuSample():
                    f, w = sample.specific_force_frd_m_s2, sample.angular_velocity_frd_rad_s
                    strapdown.imu(sample.time_boot_us, f, w)
                case Attitude():
                    strapdown.attitude(sample.time_boot_us, sample.attitude_wxyz)
                case LocalPosition() | Odometry():
                    strapdown.velocity(sample)
            known = self.situation(t)._replace(strapdown=strapdown)
            self.state, impact = detector.step(self.state, sample, known)
            if impact is not None:
                impacts.append(impact)
        return impacts


# --- force --------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("direction_deg", [0, 77, 180, 301])
@pytest.mark.parametrize("speed_m_s", [0.5, 5.0])
def test_a_foldable_hit_shows_in_the_first_sample_that_holds_it(speed_m_s, direction_deg):
    c, s = math.cos(math.radians(direction_deg)), math.sin(math.radians(direction_deg))
    force = 30.0 * speed_m_s
    impacts = Flight(pulse((force * c, force * s, 0.0), length_us=20_000)).fly()
    assert [(i.sample_time_boot_us, i.evidence) for i in impacts] == [(3_004_000, Evidence.FORCE)]
    assert impacts[0].contact_free_until_boot_us <= HIT_US
    assert impacts[0].kind is ImpactKind.WALL


@pytest.mark.parametrize(
    ("push", "kind"),
    [((0.0, 0.0, 900.0), ImpactKind.CEILING), ((0.0, 0.0, -900.0), ImpactKind.STRUCK)],
)
def test_a_stiff_push_along_thrust_is_seen_because_propellers_cannot_do_it(push, kind):
    velocity = (0.0, 0.0, -1.0) if kind is ImpactKind.CEILING else (0.0, 0.0, 0.0)
    impacts = Flight(pulse(push), velocity=velocity).fly()
    assert [(i.sample_time_boot_us, i.kind) for i in impacts] == [(3_004_000, kind)]


def test_a_vehicle_on_its_back_teaches_nothing_of_its_thrust():
    gain = ThrustGain()
    gain.set_fraction(0, 0.5)
    for force_m_s2 in (GRAVITY, -GRAVITY):
        for _ in range(1_000):
            gain.learn(0, force_m_s2, 0.004)
    assert gain.is_known and gain.full_m_s2 == pytest.approx(GRAVITY / 0.5)


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


def test_a_hit_far_from_the_centre_moves_little_and_turns_much():
    def rates(t):
        return (0.0, 0.0, 4.0 if t > HIT_US else 0.0)

    slight = pulse((-105.0, 0.0, 0.0))
    assert Flight(slight, imu_every_us=20_000).fly() == []
    assert [i.evidence for i in Flight(slight, imu_every_us=20_000, rates=rates).fly()] == [Evidence.VELOCITY_JUMP]


def stepped(change_m_s, at_us=3_002_000, turn_frd_rad_s=(0.0, 0.0, 0.0), **scene):
    """Hits told at 50 Hz of a velocity that changes at once, between the samples, while the vehicle begins to turn."""
    rates = {"rates": lambda t: turn_frd_rad_s if t > at_us else (0.0, 0.0, 0.0)}
    flight = Flight(imu_every_us=20_000, jump=(at_us, change_m_s, 0), **rates, **scene)
    return [impact.evidence for impact in flight.fly(until_us=at_us + 35_000 * scene.get("slower", 1) ** 2)]


@pytest.mark.parametrize(
    ("change_m_s", "scene", "hits"),
    [
        # Straight into a ceiling, without a turn: a sensor that clips at 16 g shows the estimator 1 ms of that
        ((0.0, 0.0, 0.16), {"velocity": (0.0, 0.0, -1.0)}, 1),
        ((0.0, 0.0, 0.08), {"velocity": (0.0, 0.0, -1.0)}, 0),
        # Velocities ten times a second show a large step alone
        ((1.5, 0.0, 0.0), {"slower": 3}, 1),
        ((0.6, 0.0, 0.0), {"slower": 3}, 0),
        # A beam met in the climb: within 20 ms the nimblest motors turn the vehicle by 10 rad/s at most, and by a third
        # of that about yaw; beside a turn that no motor makes little of a step is enough
        ((0.0, 0.0, 0.1), {"at_us": 3_010_000, "turn_frd_rad_s": (7.7, 7.7, 0.0)}, 1),
        ((0.0, 0.0, 0.1), {"at_us": 3_010_000, "turn_frd_rad_s": (2.1, 2.1, 0.0)}, 0),
        ((0.0, 0.0, 0.1), {"at_us": 3_010_000, "turn_frd_rad_s": (3.4, 0.0, 0.0)}, 0),
        ((0.0, 0.0, 0.1), {"at_us": 3_010_000, "turn_frd_rad_s": (0.0, 0.0, 3.4)}, 1),
    ],
)
def test_of_what_no_sample_showed_the_velocity_that_it_leaves_and_the_turn_tell(change_m_s, scene, hits):
    assert stepped(change_m_s, **scene) == [Evidence.VELOCITY_JUMP] * hits


@pytest.mark.parametrize(("degrees_of_freedom", "quantile"), [(30, 4.95), (75, 4.48)])
def test_what_few_steps_say_of_the_noise_counts_as_student_says(degrees_of_freedom, quantile):
    """4.2 normal standard deviations are exceeded once in 75 000 times; the quantiles are those of t."""
    # Given a noise of 0.2 m/s, known from steps of which four are worth as much as one of their three axes
    jump = VelocityJump(averaging_us=1_000, variance_m2_s2=0.04, known=degrees_of_freedom * 4 // 3)
    # Then a larger step is as rare as Student's t says
    asked = (FusedConfig(noise_factor=4.2), 0, 1.0, 0.0, 0.0)
    assert jump.least_m_s(*asked) == pytest.approx(0.2 * quantile, rel=0.03)
    assert VelocityJump(averaging_us=1_000).least_m_s(*asked) == math.inf


@pytest.mark.parametrize(("counted", "heard_odometry", "hits"), [(1, True, 0), (0, True, 1), (1, False, 1)])
def test_a_jump_that_the_estimator_counts_as_its_own_is_no_hit(counted, heard_odometry, hits):
    """Without ODOMETRY nothing tells the two apart: that is what is lost."""
    heard = (LocalPosition, Odometry, Attitude) if heard_odometry else (LocalPosition, Attitude)
    jump = (3_000_000, (0.8, 0.0, 0.0), counted)
    assert len(Flight(imu_every_us=20_000, jump=jump, heard=heard).fly()) == hits


def test_velocities_that_stood_still_to_the_digit_and_then_jump_are_no_evidence():
    """An estimator that has stopped for half a second, as a vehicle falls, and goes on."""

    class Stuck(Flight):
        def samples(self, until_us):
            kept = {}
            for t, sample in super().samples(until_us):
                if isinstance(sample, (Odometry, LocalPosition)) and 2_500_000 < t < 3_000_000:
                    held = kept.setdefault(type(sample), sample.velocity_ned_m_s)
                    sample = replace(sample, velocity_ned_m_s=held)
                yield t, sample

    assert Stuck(imu_every_us=20_000, lift=lambda t: 4.0 if 2_600_000 < t < 3_000_000 else GRAVITY).fly() == []


def test_a_scrape_that_ends_in_a_strike_is_two_hits():
    def scrape(t):
        return (
            (-8.0, 0.0, 0.0)
            if HIT_US <= t < HIT_US + 150_000
            else (-90.0, 0.0, 0.0)
            if t < HIT_US + 170_000
            else nothing(t)
        )

    impacts = Flight(lambda t: scrape(t) if t >= HIT_US else nothing(t)).fly()
    assert [i.sample_time_boot_us for i in impacts] == [3_004_000, 3_152_000]


# --- no collision -------------------------------------------------------------------------------------------


def gone(t):
    return max(0.0, 1.0 - (t - HIT_US) / 60_000) if t > HIT_US else 1.0


@pytest.mark.parametrize("late_us", [20_000, 50_000])
def test_what_lags_behind_a_manoeuvre_is_no_hit_once_the_vehicle_has_manoeuvred(late_us):
    """Gentle climbs and dives for some seconds show how late its velocity is; then come wild ones."""

    def lift(t):
        return GRAVITY * (1.0 + (0.05 if t < HIT_US else 0.6) * math.sin(t * 30e-6))

    assert Flight(lift=lift, late_us=late_us).fly(6_000_000) == []


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
        {"noise": 2.5},
        {"push": lambda t: (1.5 * (t > HIT_US), 0.0, 0.0)},  # an accelerometer whose zero moves at once
    ],
    ids=["free fall", "motor failure", "payload drop", "climbs", "gust", "shaking", "zero moves"],
)
def test_what_a_flight_does_to_itself_is_no_hit(scene, imu_every_us):
    until_us = 3_150_000 if "rates" in scene else 6_000_000
    assert Flight(imu_every_us=imu_every_us, **scene).fly(until_us) == []


def test_a_vehicle_that_shakes_must_show_a_weak_force_twice_and_a_strong_one_once():
    once = Flight(pulse((0.0, 10.0, 0.0), 3_000_500, 4_000), noise=1.5)
    assert once.fly() == []
    assert once.state.threshold_m_s2 > 8.0
    twice = Flight(pulse((0.0, 13.0, 0.0), 3_000_500, 20_000), noise=1.5)
    assert [i.sample_time_boot_us for i in twice.fly()] in ([3_004_000], [3_008_000])
    together = Flight(pulse((0.0, 8.5, 0.0), 3_000_500, 8_000), noise=1.5)
    assert [i.contact_free_until_boot_us for i in together.fly()] == [3_000_000]
    assert together.state.peak_specific_force_m_s2 < together.state.threshold_m_s2
    strong = Flight(pulse((0.0, 100.0, 0.0), 3_000_500, 4_000), noise=1.5)
    assert [i.sample_time_boot_us for i in strong.fly()] == [3_004_000]
    to_and_fro = Flight(lambda t: (0.0, {750: 10.0, 751: -10.0}.get((t - 500) // 4_000, 0.0), 0.0), noise=1.5)
    assert to_and_fro.fly() == []


def test_the_gyroscope_of_a_vehicle_that_shakes_makes_no_graze_of_its_shaking():
    """Given rates that jump to and fro by 3 rad/s, which of a calm vehicle is more than its motors can."""
    shaking = Flight(noise=3.0, rates=lambda t: (1.5 * (-1.0) ** (t // 4_000), 0.0, 0.0))
    assert shaking.fly() == []
    assert shaking.state.threshold_m_s2 > 8.0


def test_a_vehicle_that_shakes_until_the_detector_is_blind_is_hit_only_by_what_is_clear():
    def shaken(push_m_s2):
        flight = Flight(pulse((0.0, push_m_s2, 0.0), 3_000_500, 20_000), noise=9.0)
        return len(flight.fly()), flight.state.threshold_m_s2

    assert shaken(0.0)[1] > 30.0
    assert shaken(30.0)[0] == 0
    assert shaken(120.0)[0] == 1


@pytest.mark.parametrize("landed_until_us", [0, 2_500_000])
def test_rotors_that_begin_to_shake_as_the_vehicle_leaves_the_ground_are_no_hit(landed_until_us):
    """Given nothing learnt of them: in the air when the first sample is heard, or on the ground until then."""
    ground = Situation(armed=True, landed_state=LandedState.ON_GROUND, height_m=0.0)
    shaking = Flight(
        lambda t: (0.0, 6.0 * math.sin(t * 6e-4), 0.0) if t > landed_until_us - 100_000 else (0.0, 0.0, 0.0),
        situation=lambda t: ground if t < landed_until_us else IN_FLIGHT,
    )
    assert shaking.fly() == []


@pytest.mark.parametrize("scale", [0.5, 1.0, 2.0])
def test_landing_and_strike_are_told_apart_by_what_was_asked_for_not_by_their_force(scale):
    touch = pulse((0.0, 5.0 * scale, -60.0 * scale), length_us=20_000)
    down = Situation(armed=True, landed_state=LandedState.IN_AIR, height_m=0.3, descent_commanded=True)
    hop = Situation(armed=True, landed_state=LandedState.IN_AIR, height_m=0.3)

    landing = Flight(touch, velocity=(0.0, 0.0, 0.7), situation=lambda t: down).fly()
    strike = Flight(touch, velocity=(0.0, 0.0, 0.7), situation=lambda t: hop).fly()

    assert [(i.kind, i.is_collision) for i in landing] == [(ImpactKind.LANDING, False)]
    assert [(i.kind, i.is_collision) for i in strike] == [(ImpactKind.FLOOR, True)]


def test_a_hand_is_a_contact_and_a_thrown_ball_is_not():
    def grip(t):
        return (6.0 * min(1.0, (t - HIT_US) / 150_000), 0.0, 0.0) if HIT_US < t < HIT_US + 400_000 else (0.0, 0.0, 0.0)

    hand = Flight(grip, velocity=(0.0, 0.0, 0.0)).fly()
    ball = Flight(pulse((80.0, 0.0, 0.0), length_us=8_000), velocity=(0.0, 0.0, 0.0)).fly()
    assert [(i.kind, i.is_collision) for i in hand] == [(ImpactKind.CONTACT, False)]
    assert [(i.kind, i.is_collision) for i in ball] == [(ImpactKind.STRUCK, True)]


@pytest.mark.parametrize("imu_every_us", [4_000, 20_000])
@pytest.mark.parametrize("speed_m_s", [0.0, 0.12])
def test_a_hand_that_soon_moves_what_it_holds_is_still_a_hand(speed_m_s, imu_every_us):
    """Given a hover that drifts, when a push carries it past a hover's speed and lets go a second later."""

    def push(t):
        since_s = min(t - HIT_US, HIT_US + 1_000_000 - t) * 1e-6
        return (5.0 * min(1.0, max(0.0, since_s / 0.1)), 0.0, 0.0)

    told = Flight(push, imu_every_us, velocity=(speed_m_s, 0.0, 0.0)).fly(5_000_000)
    assert {impact.kind for impact in told} == {ImpactKind.CONTACT}


@pytest.mark.parametrize("imu_every_us", [4_000, 8_000, 20_000])
def test_a_soft_strike_on_a_hover_jumps_and_is_no_hand(imu_every_us):
    """Given a door at half a metre a second, when its push is no harder than a hand's and there at once."""
    struck = Flight(pulse((7.0, 0.0, 0.0), length_us=60_000), imu_every_us, velocity=(0.0, 0.0, 0.0)).fly()
    assert [impact.kind for impact in struck] == [ImpactKind.STRUCK]
    assert struck[0].sample_time_boot_us <= HIT_US + imu_every_us + WINDOW_US


def test_what_a_hand_holds_can_still_be_struck():
    def held_and_struck(t):
        struck = HIT_US + 200_000 <= t < HIT_US + 230_000
        return (30.0 if struck else 4.0 * min(1.0, max(0.0, (t - HIT_US) * 1e-5)), 0.0, 0.0)

    told = Flight(held_and_struck, velocity=(0.0, 0.0, 0.0)).fly(3_400_000)
    assert [impact.is_collision for impact in told] == [False, True]


# --- phases -------------------------------------------------------------------------------------------------


def test_on_the_ground_nothing_is_a_hit():
    ground = Situation(armed=True, landed_state=LandedState.ON_GROUND, height_m=0.0)
    flight = Flight(pulse((50.0, 0.0, 0.0), length_us=20_000), situation=lambda t: ground)
    assert flight.fly() == []
    assert flight.state.describe() == "off (on the ground)"


def test_one_contact_is_one_impact_and_a_shaking_that_stays_is_learnt():
    loud = Flight(lambda t: (20.0 * math.sin(t * 1e-3), 0.0, 0.0) if t > HIT_US else (0.0, 0.0, 0.0))
    assert len(loud.fly(8_000_000)) == 1
    assert loud.state.phase is Phase.ARMED
    assert loud.state.threshold_m_s2 > 20.0
