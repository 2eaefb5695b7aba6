"""What a hit that was not measured whole leaves in doubt: the velocity of the vehicle, and its tilt."""

import math

import pytest

from tests.companion.watching import STILL, Watch


def after_a_hit(seconds, peak_m_s2, lasts, error_m_s, speed=0.0, **more_m_s2):
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

    watch.fly(
        round(seconds * 1e6), push, velocity, look=lambda t: trusted.append(watch.monitor.estimator.validity.is_valid)
    )
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
    """Given a clipped hit at 2 m/s, a contact between the samples is one where no correction makes such a jump."""
    impacts, _, _ = after_a_hit(7.0, 120.0, 3, lambda s: swing(s) + jump_m_s * (s >= later_s), speed=2.0)
    assert len(impacts) == hits


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
    assert not watch.monitor.estimator.validity.is_valid
    assert strapdown.level_acceleration_m_s2 == pytest.approx((leans_m_s2, 0.0, 0.0), abs=0.02)
