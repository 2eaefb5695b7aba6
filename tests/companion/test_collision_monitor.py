"""The watch: detector, estimate and sight joined; what it says of itself."""

import math

import pytest

from bench.detectors.config import BaselineConfig
from companion.messages import Attitude, ImuSample, LocalPosition, Sample
from companion.mission.config import CompanionConfig
from companion.reflex.detector import Phase, Situation
from companion.reflex.monitor import advance, start_monitor
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
