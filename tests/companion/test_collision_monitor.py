"""The watch: detector, estimate and sight joined; what it says of itself."""

import math
import pickle

import pytest

from bench.detectors.config import BaselineConfig
from companion.messages import Attitude, ImuSample, LocalPosition, Sample
from companion.mission.config import CompanionConfig
from companion.reflex.config import StreamHealthConfig
from companion.reflex.detector import Phase, Situation
from companion.reflex.monitor import advance, start_monitor
from companion.reflex.stream_health import StreamHealth
from tests.companion.watching import Watch

INTERVAL_US = 4_000
WANTED = Situation()


def lateral(**changes):
    return BaselineConfig(detector="lateral", **changes)


def fly(monitor, until_us, push=lambda t: 0.0, every_us=INTERVAL_US, situation=WANTED, start_us=INTERVAL_US):
    """North at 2 m/s, level; `push` is the contact's force per unit mass on body x, m/s^2."""
    impacts, finished, notices = [], [], []
    for t in range(start_us, until_us, every_us):
        north_m = 2.0 * t * 1e-6
        samples: list[Sample] = [ImuSample(t, (push(t), 0.0, -9.81), (0.0, 0.0, 0.0))]
        samples.append(LocalPosition(t, (north_m, 0.0, -1.5), (2.0, 0.0, 0.0)))
        samples.append(Attitude(t, (1.0, 0.0, 0.0, 0.0)))
        seen = advance(monitor, samples, situation, t)
        impacts += seen.impacts
        finished += seen.finished
        notices += seen.notices
    return impacts, finished, notices


def hit(t):
    return -30.0 if 1_000_000 <= t < 1_020_000 else 0.0


def test_an_impact_comes_at_its_first_sample_and_its_final_estimate_when_the_contact_is_over():
    monitor = start_monitor(lateral(), 0)
    impacts, finished, _ = fly(monitor, 1_500_000, hit)

    assert [e.impact.sample_time_boot_us for e in impacts] == [1_000_000]
    assert not impacts[0].is_final
    assert impacts[0].velocity_ned_m_s == pytest.approx((2.0, 0.0, 0.0), abs=0.01)
    assert len(finished) == 1 and finished[0].is_final
    assert finished[0].normal.direction_ned == pytest.approx((-1.0, 0.0, 0.0), abs=0.01)
    assert monitor.estimator.estimate == finished[0]


def test_a_watch_survives_pickling_in_mid_flight():
    """Campaigns send watches between processes."""
    monitor = start_monitor(lateral(), 0)
    fly(monitor, 900_000)
    copy = pickle.loads(pickle.dumps(monitor))
    assert fly(copy, 1_500_000, hit, start_us=900_000)[0] == fly(monitor, 1_500_000, hit, start_us=900_000)[0] != []


def test_late_and_doubled_samples_are_dropped_and_a_reboot_is_not():
    monitor = start_monitor(lateral(), 0)
    fly(monitor, 2_900_000)
    at = monitor.estimator.strapdown.time_boot_us
    late = ImuSample(at - INTERVAL_US, (-50.0, 0.0, -9.81), (0.0, 0.0, 0.0))
    assert advance(monitor, [late], WANTED, 2_900_000).impacts == []
    fly(monitor, 500_000)
    assert monitor.estimator.strapdown.time_boot_us < 500_000


@pytest.mark.parametrize(
    ("spoil", "reason"),
    [
        (lambda monitor: advance(monitor, [], WANTED, 1_500_000), "no HIGHRES_IMU for 250 ms"),
        (
            lambda monitor: fly(monitor, 4_000_000, every_us=100_000, start_us=1_000_000),
            "HIGHRES_IMU at 10 Hz, below 20",
        ),
        (lambda monitor: fly(monitor, 4_000_000, lambda t: 12.0 * math.sin(t), start_us=1_000_000), "vibration hides"),
    ],
)
def test_a_blind_watch_says_why_and_a_seeing_one_says_it_sees_again(spoil, reason):
    monitor = start_monitor(lateral(), 0)
    fly(monitor, 1_000_000)
    assert monitor.no_data_reason is None
    spoil(monitor)
    assert reason in monitor.no_data_reason
    assert monitor.describe().startswith("blind (")

    _, _, notices = fly(monitor, 12_000_000, start_us=4_000_000)

    assert monitor.no_data_reason is None
    assert monitor.state.phase is Phase.ARMED
    assert "the detector sees again" in [notice.text for notice in notices]


def imu_every(monitor, every_us, start_us, until_us):
    """Samples with an attitude each, looked after every 4 ms; when the watch became seeing or blind."""
    changes, was = [], monitor.no_data_reason is None
    for t in range(start_us, until_us, INTERVAL_US):
        pair: list[Sample] = [ImuSample(t, (0.0, 0.0, -9.81), (0.0, 0.0, 0.0)), Attitude(t, (1.0, 0.0, 0.0, 0.0))]
        heard = pair if (t - start_us) % every_us == 0 else []
        advance(monitor, heard, WANTED, t)
        if (monitor.no_data_reason is None) is not was:
            was = not was
            changes.append(t - start_us)
    return changes


@pytest.mark.parametrize(("every_us", "seeing_us"), [(4_000, 76_000), (20_000, 380_000), (40_000, 760_000)])
def test_after_a_silence_the_samples_of_a_second_at_the_least_rate_prove_the_rate(every_us, seeing_us):
    monitor = start_monitor(lateral(), 0)
    fly(monitor, 1_000_000)
    advance(monitor, [], WANTED, 1_500_000)
    advance(monitor, [], WANTED, 2_600_000)
    assert monitor.no_data_reason is not None
    assert imu_every(monitor, every_us, 3_000_000, 6_000_000) == [seeing_us]


def test_a_stream_at_the_least_rate_is_not_told_blind_between_its_samples():
    # Given samples every 50 ms, each up to 8 ms late
    arrivals = {50_000 * number + (0, 8_000, 4_000)[number % 3] for number in range(1, 180)}
    health, config, was = StreamHealth(0, 0), StreamHealthConfig(), None
    # When it is looked at every 2 ms, after the first second
    for now_us in range(2_000, 9_000_000, 2_000):
        health.imu(int(now_us in arrivals), config, now_us)
        fault = health.fault(config, now_us)
        # Then what is told of it changes with a sample, and not between two
        assert now_us <= 1_000_000 or now_us in arrivals or fault == was
        was = fault


def test_samples_that_a_link_held_back_and_delivers_at_once_prove_no_rate():
    monitor = start_monitor(lateral(), 0)
    fly(monitor, 1_000_000)
    late = [ImuSample(1_000_000 + INTERVAL_US * n, (0.0, 0.0, -9.81), (0.0, 0.0, 0.0)) for n in range(20)]
    advance(monitor, late, WANTED, 2_000_000)
    advance(monitor, [], WANTED, 2_200_000)
    assert "below 20" in monitor.no_data_reason


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


def test_a_watch_that_is_not_wanted_is_off_not_blind():
    monitor = start_monitor(lateral(), 0)
    fly(monitor, 1_000_000, situation=Situation("landing"))
    seen = advance(monitor, [], Situation("landing"), 3_000_000)
    assert (seen.notices, monitor.no_data_reason, monitor.describe()) == ([], None, "off (landing)")


def test_what_is_lost_without_a_message_is_said_once():
    monitor = start_monitor(CompanionConfig(detector="fused"), 0)
    _, _, notices = fly(monitor, 8_000_000)
    losses = [notice.text for notice in notices if notice.text.startswith("no ")]
    assert [text.split(":")[0] for text in losses] == ["no ATTITUDE_TARGET", "no ODOMETRY"]


@pytest.mark.parametrize("turns", [False, True])
def test_samples_that_are_the_same_to_the_last_bit_are_none_only_of_a_vehicle_that_turned_between(turns):
    """At rest a sensor without noise repeats itself; nothing that turns does."""
    monitor = start_monitor(lateral(), 0)
    fly(monitor, 1_000_000)
    notices = []
    for t in range(1_000_000, 2_000_000, INTERVAL_US):
        roll = 1e-4 * (t % 3) if turns else 0.0
        samples: list[Sample] = [ImuSample(t, (0.0, 0.0, -9.81), (0.0, 0.0, 0.0)), Attitude(t, (1.0, roll, 0.0, 0.0))]
        notices += advance(monitor, samples, WANTED, t).notices
    assert [notice.text for notice in notices] == (["detector blind: IMU stuck at one value"] if turns else [])


def test_under_vibration_that_hides_all_but_crashes_the_detector_is_silent_and_says_so():
    # Given a vehicle that begins to shake so much that the threshold passes the largest one
    def shaking(t):
        return 20.0 * (-1.0) ** (t // INTERVAL_US) if t > 2_000_000 else 0.0

    config = CompanionConfig()
    monitor = start_monitor(config, 0)
    fly(monitor, 2_000_000)
    fly(monitor, 4_000_000, shaking, start_us=2_000_000)
    assert monitor.state.threshold_m_s2 > config.sight.max_threshold_m_s2
    # When it is struck harder than that
    impacts, _, _ = fly(monitor, 4_100_000, lambda t: shaking(t) - 200.0, start_us=4_000_000)
    # Then nothing is reported but why
    assert impacts == [] and "vibration hides hits" in monitor.no_data_reason
    # But a crash is: the same on a vehicle that falls
    low = Situation(armed=True, height_m=0.2)
    monitor.detector.step(monitor.state, LocalPosition(4_100_000, (0.0, 0.0, -0.2), (0.0, 0.0, 5.0)), low)
    state, impact = monitor.detector.step(
        monitor.state,
        ImuSample(4_104_000, (-2000.0, 0.0, -9.81), (0.0, 0.0, 0.0)),
        low._replace(off_reason="vibration"),
    )
    assert state.phase is Phase.OFF and impact is not None and impact.kind.value == "crash"


def test_a_touch_that_tips_the_vehicle_over_is_a_crash_as_soon_as_it_lies_there():
    # Given a vehicle that has touched the ground, upright, and is in its next take-off for the detector
    down = Situation(armed=True, height_m=0.2, descent_commanded=True)
    monitor = start_monitor(CompanionConfig(), 0)
    fly(monitor, 2_000_000, situation=down._replace(height_m=3.0))
    (touch,), *_ = fly(monitor, 2_020_000, lambda t: -60.0, situation=down, start_us=2_000_000)
    assert touch.impact.kind.value == "landing"
    # When it tumbles 0.2 s later
    monitor.estimator.strapdown.valid_wxyz = (0.5, math.sqrt(0.75), 0.0, 0.0)
    tilted = down._replace(off_reason="below 0.5 m", strapdown=monitor.estimator.strapdown)
    sample = ImuSample(2_220_000, (-60.0, 0.0, -9.81), (0.0, 0.0, 0.0))
    _, impact = monitor.detector.step(monitor.state, sample, tilted)
    assert impact is not None and impact.kind.value == "crash"
    # Then it is one crash
    again = ImuSample(2_240_000, (-60.0, 0.0, -9.81), (0.0, 0.0, 0.0))
    assert monitor.detector.step(monitor.state, again, tilted)[1] is None


def test_a_vehicle_that_lies_on_its_back_does_not_crash_again():
    # Given a vehicle in the air that turns over near the ground, where no hit is looked for
    monitor = start_monitor(CompanionConfig(), 0)
    fly(monitor, 2_000_000)
    monitor.estimator.strapdown.valid_wxyz = (0.0, 1.0, 0.0, 0.0)
    low = Situation(armed=True, height_m=0.2, off_reason="below 0.5 m", strapdown=monitor.estimator.strapdown)
    # When its accelerometer then shows gravity from the other side for seconds
    crashes = [
        impact
        for t in range(2_004_000, 5_000_000, 4_000)
        if (impact := monitor.detector.step(monitor.state, ImuSample(t, (0.0, 0.0, 9.81), (0.0, 0.0, 0.0)), low)[1])
    ]
    # Then it is one crash
    assert [impact.kind.value for impact in crashes] == ["crash"]
    assert crashes[0].sample_time_boot_us == 2_004_000
