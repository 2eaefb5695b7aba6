"""Whether the accelerometer has shown the whole of a contact, by the means over its windows."""

import math

import pytest

from companion.estimate.clipping import Clipping

RANGE_M_S2 = 156.9
WINDOW_S = 0.005


def windows(forces_m_s2, range_m_s2=RANGE_M_S2, raw_s=0.000125):
    """Means over windows of raw samples that are clipped one by one; what was hidden, m/s."""
    per_window = round(WINDOW_S / raw_s)
    forces = [*forces_m_s2, *[0.0] * (3 * per_window - len(forces_m_s2) % per_window)]
    seen = [max(-range_m_s2, min(range_m_s2, force)) for force in forces]
    means = [sum(seen[at : at + per_window]) / per_window for at in range(0, len(seen), per_window)]
    return means, raw_s * sum(abs(a - b) for a, b in zip(forces, seen, strict=True))


def half_sine(peak_m_s2, lasts_s, begins_s, raw_s=0.000125):
    free = [0.0] * round(begins_s / raw_s)
    count = round(lasts_s / raw_s)
    return free + [peak_m_s2 * math.sin(math.pi * (at + 0.5) / count) for at in range(count)]


def clipping_of(means, contiguous=True):
    clipping = Clipping(5_000, RANGE_M_S2)
    for mean in means:
        clipping.add((mean, 0.0, -9.81), (mean, 0.0, 0.0), contiguous)
    return clipping


@pytest.mark.parametrize("begins_s", [0.0, 0.002, 0.0035, 0.0045, 0.0048])
@pytest.mark.parametrize("lasts_s", [0.001, 0.0015, 0.003, 0.006])
def test_a_stiff_frames_hit_that_hid_a_velocity_is_known_wherever_the_windows_cut_it(lasts_s, begins_s):
    """Given 400 m/s^2 or 3000 for a millisecond and more, when the means stay far below the range, it is told."""
    for peak_m_s2 in (400.0, 3000.0):
        means, hidden_m_s = windows(half_sine(peak_m_s2, lasts_s, begins_s))
        assert hidden_m_s > 0.1
        assert clipping_of(means).may_hide


@pytest.mark.parametrize("begins_s", [0.0, 0.001, 0.0025, 0.004])
@pytest.mark.parametrize("lasts_s", [0.02, 0.03, 0.06, 0.12])
def test_springs_that_push_for_long_and_within_the_range_are_shown_whole(lasts_s, begins_s):
    means, hidden_m_s = windows(half_sine(50.0, lasts_s, begins_s))
    assert hidden_m_s == 0.0
    assert not clipping_of(means).may_hide


def test_a_touch_too_weak_to_have_reached_the_range_in_a_millisecond_is_shown_whole():
    means, hidden_m_s = windows(half_sine(150.0, 0.001, 0.002))
    assert hidden_m_s == 0.0
    assert not clipping_of(means).may_hide


def test_pushes_that_turn_round_from_window_to_window_do_not_explain_each_other():
    """A rigid vehicle's guards clatter along a pole: 24 m/s^2 to the right between 19 and 13 to the left."""
    assert clipping_of([-19.0, 23.6, -13.1, -4.7, 0.0]).may_hide
    assert not clipping_of([19.0, 23.6, 13.1, 4.7, 0.0]).may_hide


def test_the_newest_sample_may_hide_something_until_the_next_one_is_there():
    clipping = clipping_of([8.0, 15.0, 38.0])
    assert clipping.may_hide
    clipping.add((30.0, 0.0, -9.81), (30.0, 0.0, 0.0), True)
    assert not clipping.may_hide


def test_windows_with_gaps_between_them_do_not_cut_one_pulse_in_two():
    """Twenty milliseconds apart, two means of 24 are two pushes or one that lasted."""
    assert clipping_of([0.0, 24.0, 24.0, 0.0], contiguous=True).may_hide
    assert not clipping_of([0.0, 24.0, 24.0, 0.0], contiguous=False).may_hide
