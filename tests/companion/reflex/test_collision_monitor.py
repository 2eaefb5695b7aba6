"""The watch and the reflex around it: samples in, hits out; what it says of itself, and what a hit leaves in doubt.

A `Watch` in flight hears what a test says the vehicle measures: every 4 ms its IMU, every 32 ms the rest.
"""

import math
from collections.abc import Callable
from dataclasses import dataclass, field
from types import SimpleNamespace
from typing import Any
from unittest.mock import patch

import pytest

from bench.detectors.config import BaselineConfig
from companion import messages
from companion.messages import Attitude, ImuSample, LandedState, LocalPosition, Odometry, Quaternion, Sample, Vector3
from companion.mission.config import CompanionConfig
from companion.motion.config import GRAVITY_M_S2
from companion.motion.history import Lateness
from companion.motion.strapdown import LEVEL
from companion.motion.vector import ZERO
from companion.reflex.belief.motion_estimator import MotionEstimator
from companion.reflex.config import RecoveryConfig
from companion.reflex.detection.confirmation import hypothesis_of
from companion.reflex.detection.detector import Impact, ImpactKind, Phase, Situation
from companion.reflex.detection.monitor import advance, start_monitor
from companion.reflex.reflex import Reflex

STILL = (0.0, 0.0, 0.0)
IN_FLIGHT = Situation(may_crash=True, height_m=3.0)
# Noise by a hair's breadth: what stands still to the last digit is no estimate, and no measurement.
HAIR_M_S = 1e-3
INTERVAL_US = 4_000


@dataclass
class Watch:
    """`impacts` and `told`: of all that has been heard, notices with their times."""

    config: CompanionConfig = field(default_factory=CompanionConfig)
    impacts: list = field(default_factory=list)
    told: list[tuple[int, str, str]] = field(default_factory=list)

    def __post_init__(self) -> None:
        self.monitor = start_monitor(self.config, 0)

    def texts(self, kind: str) -> list[str]:
        return [text for _, of, text in self.told if of == kind]

    def fly(
        self,
        until_us: int,
        push: Callable[[int], Vector3] = lambda t: STILL,
        velocity: Callable[[int], Vector3] = lambda t: STILL,
        place: Callable[[int], Vector3] = lambda t: STILL,
        rates: Callable[[int], Vector3] = lambda t: STILL,
        attitude: Callable[[int], Quaternion | None] = lambda t: LEVEL,
        imu: Callable[[ImuSample], Sample] = lambda sample: sample,
        look: Callable[[int], None] = lambda t: None,
        situation: Situation = IN_FLIGHT,
        from_us: int = INTERVAL_US,
        every_us: int = INTERVAL_US,
    ) -> "Watch":
        """`push` is what moves it beside its thrust, body m/s^2; no attitude comes where there is none."""
        for t in range(from_us, until_us, every_us):
            x, y, z = push(t)
            samples: list[Sample] = [imu(ImuSample(t, (x, y, z - 9.80665), rates(t)))]
            if t % 32_000 == 0:
                n, e, d = velocity(t)
                told = (n + HAIR_M_S * (t // 32_000 % 2), e, d)
                samples += [LocalPosition(t, place(t), told), Odometry(t, place(t), told, 0)]
                wxyz = attitude(t)
                samples += [] if wxyz is None else [Attitude(t, wxyz, rates(t))]
            impacts, notices = advance(self.monitor, samples, situation, t)
            self.impacts += impacts
            self.told += [(t, notice.kind, notice.text) for notice in notices]
            look(t)
        return self


def test_late_and_doubled_samples_are_dropped_and_a_reboot_is_not():
    watch = Watch().fly(2_900_000, rates=lambda t: (0.0, 0.0, 0.9 * (2_800_000 <= t < 2_860_000)))
    strapdown, turn = watch.monitor.estimator.strapdown, watch.monitor.state.turn
    late = ImuSample(strapdown.time_boot_us - INTERVAL_US, (-50.0, 0.0, -9.81), STILL)
    assert not advance(watch.monitor, [late], IN_FLIGHT, 2_900_000)[0]
    watch.fly(16_000, rates=lambda t: (0.0, 0.0, 0.3))
    assert strapdown.time_boot_us < 16_000 and 0.0 <= turn.mean_rad_s[2] <= 0.3


@pytest.mark.parametrize(
    ("spoil", "reason"),
    [
        (lambda watch: advance(watch.monitor, [], IN_FLIGHT, 1_500_000), "no HIGHRES_IMU for 250 ms"),
        (lambda watch: watch.fly(4_000_000, from_us=1_000_000, every_us=100_000), "HIGHRES_IMU at 10 Hz, below 20"),
        (
            lambda watch: watch.fly(4_000_000, lambda t: (12.0 * math.sin(t), 0.0, 0.0), from_us=1_000_000),
            "vibration hides",
        ),
    ],
)
def test_a_blind_watch_says_why_and_a_seeing_one_says_it_sees_again(spoil, reason):
    watch = Watch(BaselineConfig(detector="lateral")).fly(1_000_000)
    assert watch.monitor.no_data_reason is None
    spoil(watch)
    assert reason in watch.monitor.no_data_reason
    assert watch.monitor.describe().startswith("blind (")
    watch.fly(12_000_000, from_us=4_000_000)
    assert watch.monitor.no_data_reason is None
    assert watch.monitor.state.phase is Phase.ARMED
    assert watch.texts("link")[-1] == "the detector sees again"


def test_a_vehicle_that_hides_only_the_slowest_hits_by_shaking_is_watched():
    # Given vibration that leaves a hit at 1 m/s, which begins with 30 m/s^2, visible
    watch = Watch(BaselineConfig(detector="lateral")).fly(4_000_000, lambda t: (6.0 * math.sin(t), 0.0, 0.0))
    assert 20.0 < watch.monitor.state.threshold_m_s2 < 30.0
    assert watch.monitor.no_data_reason is None


def test_a_lean_of_which_no_attitude_tells_is_no_hit_and_the_watch_says_that_it_is_blind():
    # Given a level vehicle that flies north; no attitude comes from 4 s on, and at 4.4 s it leans to gain 1.8 m/s
    from_us, until_us, speeding_up_m_s2 = 4_400_000, 5_000_000, 3.0
    thrust = 9.80665 - math.hypot(9.80665, speeding_up_m_s2)
    watch = Watch().fly(
        6_000_000,
        push=lambda t: (0.0, 0.0, thrust if from_us < t <= until_us else 0.0),
        velocity=lambda t: (1.0 + speeding_up_m_s2 * max(0, min(t, until_us) - from_us) * 1e-6, 0.0, 0.0),
        attitude=lambda t: None if 4_000_000 < t <= until_us else (1.0, 0.0, 0.0, 0.0),
    )
    # Then a velocity that no force explains is no hit, and it is told
    assert watch.impacts == []
    assert watch.texts("link") == ["detector blind: no ATTITUDE_QUATERNION for 250 ms", "the detector sees again"]


@pytest.mark.parametrize(
    ("imu", "reason"),
    [
        (lambda sample: ImuSample(sample.time_boot_us, (0.1, 0.0, -9.8), STILL), "IMU stuck at one value"),
        (lambda sample: messages.Refused("HIGHRES_IMU", "it reads zero"), "HIGHRES_IMU not accepted: it reads zero"),
    ],
    ids=["stuck", "refused"],
)
def test_an_imu_that_measures_nothing_is_told_and_the_braking_that_it_does_not_show_is_no_hit(imu, reason):
    # Given a vehicle that leans back for a second, and is slower by 1.5 m/s for it
    def braked_s(t):
        return 1e-6 * (min(max(t, 4_000_000), 5_000_000) - 4_000_000)

    def half_rad(t):
        return 0.075 * math.sin(math.pi * braked_s(t))

    flown: dict[str, Any] = {
        "push": lambda t: (HAIR_M_S * (t // INTERVAL_US % 2), 0.0, 0.0),
        "velocity": lambda t: (2.0 - 1.5 * braked_s(t), 0.0, 0.0),
        "attitude": lambda t: (math.cos(half_rad(t)), 0.0, math.sin(half_rad(t)), 0.0),
    }
    # When its IMU measures nothing of it until shortly before its end
    watch = Watch().fly(4_000_000, **flown)
    watch.fly(4_900_000, **flown, from_us=4_000_000, imu=imu)
    watch.fly(8_000_000, **flown, from_us=4_900_000)
    # Then the detector is blind until it has heard twenty samples
    assert watch.impacts == []
    assert watch.texts("link") == [f"detector blind: {reason}", "the detector sees again"]
    assert watch.told[-1][0] == pytest.approx(4_976_000, abs=INTERVAL_US)


def test_a_touch_that_tips_the_vehicle_over_is_a_crash_as_soon_as_it_lies_there():
    # Given a vehicle that has touched the ground, upright, and is in its next take-off for the detector
    down = Situation(may_crash=True, height_m=0.2, descent_commanded=True)
    watch = Watch().fly(2_000_000, situation=down._replace(height_m=3.0))
    watch.fly(2_020_000, lambda t: (-60.0, 0.0, 0.0), situation=down, from_us=2_000_000)
    (touch,), monitor = watch.impacts, watch.monitor
    assert touch.impact.kind is ImpactKind.LANDING
    # When it tumbles 0.2 s later
    monitor.estimator.strapdown.valid_wxyz = (0.5, math.sqrt(0.75), 0.0, 0.0)
    tilted = down._replace(off_reason="below 0.5 m")
    sample = ImuSample(2_220_000, (-60.0, 0.0, -9.81), (0.0, 0.0, 0.0))
    impact = monitor.detector.step(monitor.state, sample, tilted, monitor.estimator)
    assert impact is not None and impact.kind is ImpactKind.CRASH
    # Then it is one crash
    again = ImuSample(2_240_000, (-60.0, 0.0, -9.81), (0.0, 0.0, 0.0))
    assert monitor.detector.step(monitor.state, again, tilted, monitor.estimator) is None


def test_the_watch_tells_t_c_v_c_normal_impulse_and_class():
    """North at 1.5 m/s, a wall stops the vehicle with 30 m/s^2 for 50 ms."""
    hit_us = 3_002_000

    def pushed_us(t):
        return max(0, min(t - hit_us, 50_000))

    watch = Watch().fly(
        4_400_000,
        push=lambda t: (-30.0 * (pushed_us(t) - pushed_us(t - 4_000)) / 4_000, 0.0, 0.0),
        velocity=lambda t: (1.5 - 30e-6 * pushed_us(t), 0.0, 0.0),
        place=lambda t: (1.5e-6 * t, 0.0, -3.0),
    )
    final = watch.monitor.estimator.estimate
    assert len(watch.impacts) == 1 and final.is_final
    assert final.impact.kind is ImpactKind.WALL
    assert abs(final.time_boot_us - hit_us) < 2_000
    assert final.velocity_ned_m_s == pytest.approx((1.5, 0.0, 0.0), abs=0.03)
    assert final.position_ned_m[0] == pytest.approx(1.5 * hit_us * 1e-6, abs=0.03)
    assert final.normal.direction_ned == pytest.approx((-1.0, 0.0, 0.0), abs=0.15)
    assert final.impulse_m_s == pytest.approx(1.5, abs=0.05)
    assert not final.is_lower_bound
    assert final.is_fully_measured


def after_a_hit(seconds, peak_m_s2, lasts, error_m_s, speed=0.0, left_m_s=math.inf, rates=lambda t: STILL, **more_m_s2):
    """Flying north, or still; a push at 2.0 s; then velocities that are off by what `error_m_s` of the time says.

    `more_m_s2`: what else pushes: the push's `first` sample, its last where arms meet their `stop`, one sample of the
    `other_guard` at 2.04 s, or a touch `again` at 2.12 s, for 40 ms.
    """
    until_us = 2_000_000 + 4_000 * lasts
    spans_us = {"first": (2_000_000, 2_004_000), "stop": (until_us - 4_000, until_us)}
    spans_us |= {"other_guard": (2_040_000, 2_044_000), "again": (2_120_000, 2_160_000)}
    pushes = [(peak_m_s2, 2_000_000, until_us), *((more_m_s2[name], *spans_us[name]) for name in more_m_s2)]
    north_m_s, trusted, watch = {0: speed}, [], Watch()

    def push(t):
        pushed_m_s2 = -sum(size for size, from_us, to_us in pushes if from_us <= t < to_us)
        north_m_s[t] = north_m_s[t - 4_000] + 0.004 * pushed_m_s2
        return pushed_m_s2, 0.0, 0.0

    def velocity(t):
        return north_m_s[t] + (error_m_s(t * 1e-6 - 2.0) if t > 2_000_000 else 0.0), 0.0, 0.0

    def look(t):
        trusted.append(watch.monitor.estimator.is_valid)

    with patch.object(MotionEstimator, "left_m_s", left_m_s):
        watch.fly(round(seconds * 1e6), push, velocity, rates=rates, look=look)
    return watch.impacts, [(t, text) for t, kind, text in watch.told if kind == "estimate"], trusted


def swing(since_s):
    """What a real PX4's velocity is off by after a clipped hit: 3 m/s, late, then a swing back through the truth."""
    late_s = max(0.0, since_s - 0.14)
    return 3.0 * math.exp(-2.6 * late_s) * (math.cos(3.6 * late_s) + 0.73 * math.sin(3.6 * late_s))


IN_DOUBT, AGAIN = "velocity not valid: part of the hit was not measured", "velocity valid again"


@pytest.mark.parametrize(
    ("peak_m_s2", "lasts", "more"),
    [
        (120.0, 3, {}),
        (120.0, 3, {"speed": 2.0}),
        # Arms that meet their stop late in a hit: springs push for six samples, and the seventh clips
        (30.0, 7, {"stop": 90.0}),
        # A stiff hit of a millisecond, whose means stay far below the range, and which rings
        (3.0, 4, {"first": 23.0}),
        # A push measured whole, and the other guard that swings in 30 ms later and clips
        (20.0, 4, {"other_guard": 90.0}),
    ],
    ids=["hovering", "into a wall", "stops", "stiff", "other guard"],
)
def test_an_estimator_that_finds_back_after_a_clipped_hit_is_no_second_hit(peak_m_s2, lasts, more):
    impacts, told, trusted = after_a_hit(7.0, peak_m_s2, lasts, swing, **more)
    assert len(impacts) == 1 and trusted[-1]
    assert [text for _, text in told] == [IN_DOUBT, AGAIN]
    assert told[1][0] == pytest.approx(6_500_000, abs=150_000)


@pytest.mark.parametrize(("jump_m_s", "later_s", "hits"), [(1.0, 1.5, 2), (0.3, 3.0, 2), (0.3, 0.6, 1)])
def test_a_hit_that_only_the_velocity_shows_is_found_while_another_is_corrected(jump_m_s, later_s, hits):
    """After a clipped hit at 2 m/s a contact is one where no correction makes such a jump; it makes nothing valid."""
    impacts, told, _ = after_a_hit(7.0, 120.0, 3, lambda s: swing(s) + jump_m_s * (s >= later_s), speed=2.0)
    assert len(impacts) == hits
    assert [text for _, text in told].count(IN_DOUBT) == 1


@pytest.mark.parametrize(
    ("speed", "later_s", "left_m_s", "hits"),
    [(0.0, 1.5, math.inf, 1), (0.0, 1.5, 0.9, 1), (0.0, 1.5, 0.6, 2), (2.0, 0.3, math.inf, 1), (2.0, 0.3, 0.2, 2)],
)
def test_a_jump_beyond_what_is_left_of_a_hit_is_another(speed, later_s, left_m_s, hits):
    """What struck a hovering vehicle may have done so at any speed; once its error is known, it no longer may."""
    impacts, _, _ = after_a_hit(4.0, 120.0, 3, lambda since_s: 0.8 * (since_s >= later_s), speed, left_m_s)
    assert len(impacts) == hits


def test_what_the_next_hit_changes_is_not_taken_for_what_is_left_of_the_last():
    """A belief that has heard the next hit's first velocity takes a part of it for an error of the estimate."""
    left_m_s = property(lambda found: 0.6 + math.hypot(*found.velocity_error_m_s))
    impacts, _, _ = after_a_hit(4.0, 120.0, 3, lambda since_s: 1.1 * (since_s >= 1.5), left_m_s=left_m_s)
    assert len(impacts) == 2


@pytest.mark.parametrize(("left_m_s", "hits"), [(math.inf, 1), (0.3, 2)])
def test_a_turn_is_a_hit_where_it_is_known_whereto_the_vehicle_flies(left_m_s, hits):
    rates = {"rates": lambda t: (0.0, 0.0, 3.0 if t >= 2_500_000 else 0.0)}
    impacts, _, _ = after_a_hit(2.6, 120.0, 3, lambda since_s: 0.0, speed=2.0, left_m_s=left_m_s, **rates)
    assert len(impacts) == hits


@pytest.mark.parametrize(
    ("push", "normal", "error_rad"),
    [(STILL, (-1.0, 0.0, 0.0), 0.6), ((-20.0, 20.0, 0.0), (-0.707, 0.707, 0.0), 0.35)],
)
def test_a_turn_shows_no_direction_and_needs_no_other_evidence(push, normal, error_rad):
    watch = Watch().fly(
        2_600_000,
        push=lambda t: push if 2_516_000 <= t < 2_540_000 else STILL,
        velocity=lambda t: (2.0, 0.0, 0.0),
        rates=lambda t: (0.0, 0.0, 3.0 if t >= 2_500_000 else 0.0),
    )
    (hit,), known = watch.impacts, watch.monitor.estimator.estimate
    assert hit.normal.error_rad == 0.6 and known.time_boot_us == hit.time_boot_us
    assert known.normal.direction_ned == pytest.approx(normal, abs=0.1)
    assert known.normal.error_rad == error_rad and not known.is_fully_measured
    assert hypothesis_of(hit, hit.impact.specific_force_frd_m_s2, 0.005, 0.0) is None


def test_a_hit_that_was_measured_whole_leaves_the_velocity_believed():
    impacts, told, trusted = after_a_hit(3.0, 20.0, 8, lambda since_s: 0.0)
    assert len(impacts) == 1 and not told
    assert trusted.count(False) <= 2


@pytest.mark.parametrize(("turns", "leans_m_s2"), [(False, 9.80665 * math.tan(math.radians(4.0))), (True, 0.0)])
def test_a_tilt_that_the_gyroscopes_do_not_show_is_the_filters(turns, leans_m_s2):
    """Told to be level, a vehicle whose filter says nose up by 4 degrees too much leans forward by as much."""
    rate_rad_s, watch = math.radians(20.0), Watch()
    strapdown = watch.monitor.estimator.strapdown

    def up_rad(t):
        return rate_rad_s * 1e-6 * (min(max(t, 2_140_000), 2_340_000) - 2_140_000)

    def leans(t):
        assert t >= 2_140_000 or strapdown.level_acceleration_m_s2 == STILL

    # Given a clipped hit at 2.0 s, from 0.14 s after which the nose is told to come up at 20 degrees a second
    watch.fly(
        2_500_000,
        push=lambda t: (-120.0 if 2_000_000 <= t < 2_012_000 else 0.0, 0.0, 0.0),
        # When the gyroscopes show that turn, or nothing of it
        rates=lambda t: (0.0, rate_rad_s if turns and 2_140_000 < t <= 2_340_000 else 0.0, 0.0),
        attitude=lambda t: (math.cos(0.5 * up_rad(t)), 0.0, math.sin(0.5 * up_rad(t)), 0.0),
        look=leans,
    )
    # Then it is the filter's in the one case and the vehicle's in the other
    assert not watch.monitor.estimator.is_valid
    assert strapdown.level_acceleration_m_s2 == pytest.approx((leans_m_s2, 0.0, 0.0), abs=0.02)


def test_an_imu_sample_that_is_stamped_ahead_hides_what_comes_after_it_for_a_tenth_of_a_second_at_most():
    order, newest_us, taken_us = Lateness(), 3_900_000, []
    # Given one that is ahead by 1.9 s, amid some that are late by an interval
    for us in range(2_000_000, 2_200_000, INTERVAL_US):
        if not order.is_late(us, newest_us):
            newest_us = us
            taken_us.append(us)
            assert order.is_late(us - INTERVAL_US, newest_us)
    assert taken_us[0] == 2_100_000 and len(taken_us) == 100_000 // INTERVAL_US


@pytest.mark.parametrize(
    ("force_m_s2", "turns_rad_s", "is_none"), [(0.0, 0.0, True), (40.0, 0.0, False), (0.0, 3.0, False)]
)
def test_a_velocity_is_confirmed_by_a_force_of_its_time_in_whichever_order_they_come_or_by_a_turn(
    force_m_s2, turns_rad_s, is_none
):
    # Given a vehicle that flies north, whose estimator takes a jump back, as of a hit that clipping hides whole
    config, rejected = CompanionConfig(), []
    # Nothing else is known, and there is no fence
    room: Any = SimpleNamespace(surfaces=lambda contact: (), inside=lambda contact_ned_m, goal_ned_m: goal_ned_m)
    reflex = Reflex(config, RecoveryConfig(restitution=0.2), config.settled)
    for us in range(INTERVAL_US, 3_600_000, INTERVAL_US):
        force, rates = (-force_m_s2 if us == 3_000_000 else 0.0, 0.0, -GRAVITY_M_S2), (0.0, 0.0, turns_rad_s)
        samples: list[Sample] = [ImuSample(us, force, rates if us > 3_000_000 else ZERO)]
        if us % (5 * INTERVAL_US) == 0:
            place = (2e-6 * us, 0.0, -2.0)
            velocity = (1.0 if us == 3_000_000 else 2.0, 0.0, 1e-3 * (us // (5 * INTERVAL_US) % 2))
            told = [Odometry(us, place, velocity, 0), Attitude(us, LEVEL, ZERO), LocalPosition(us, place, velocity)]
            samples = [*told, messages.AttitudeTarget(us, 0.6), *samples]
        for estimate in reflex.step(samples, IN_FLIGHT, us).collisions:
            assert us == 3_000_000, "told with the first sample that shows it"
            reflex.begin(estimate, room, us)
        if reflex.newest is not None:
            shown = [reflex.newest.take(sample) for sample in samples if isinstance(sample, LocalPosition)]
            rejected += [progress for progress in shown if progress.is_rejected]
        reflex.follow(samples, 2.0, LandedState.IN_AIR)
    # Then the jump alone was none, and with a force of the same time or a turn it was a hit
    assert len(reflex.hits) == 1
    assert reflex.hits[0].estimator.start.velocity_ned_m_s[0] == pytest.approx(-0.2 * 2.0, abs=0.05)
    assert bool(rejected) is is_none
    # And velocities that it may have spoilt do not reject the next one
    source, first = reflex.monitor.estimator, reflex.hits[0]
    first.is_over, may_be_wrong_m_s = True, first.estimator.left_m_s
    impact = Impact(us, us - INTERVAL_US, (-40.0, 0.0, 0.0), ImpactKind.WALL)
    second = reflex.begin(source.begin(impact), room, us)
    assert second.hypothesis is not None and second.hypothesis.left_m_s == may_be_wrong_m_s > 0.0
    # which, taken back, leaves what is known of the first, of which nothing is left at last
    reflex.take_back()
    assert reflex.newest is first and source.followed == [first.estimator] and not source.is_valid
    reflex.take_back()
    assert reflex.hits == [] and source.is_valid
    # Velocities behind a filter may show nothing of a true hit, and reject none
    source.hides_clipping = True
    assert reflex.begin(source.begin(impact), room, us).hypothesis is None
