"""How late the vehicle's velocity is, learnt from its own steps."""

import random

import pytest

from companion.motion.config import LATEST_S
from companion.motion.delay import Delay

NOISE_M_S = 0.05


def learnt(late_s, changes):
    """After steps of velocity less sum of a vehicle whose acceleration changes so."""
    rng, delay = random.Random(1), Delay()
    for change in changes:
        step = tuple(-late_s * part + rng.gauss(0.0, NOISE_M_S) for part in change)
        delay.learn(step, change)
    return delay.delay_s(NOISE_M_S**2)


def manoeuvres(count, size_m_s2, seed=2):
    rng = random.Random(seed)
    return [tuple(rng.gauss(0.0, size_m_s2) for _ in range(3)) for _ in range(count)]


@pytest.mark.parametrize("late_s", [0.0, 0.02, 0.05, 0.08])
def test_a_flight_with_manoeuvres_shows_how_late_the_velocity_is(late_s):
    # Given half a minute at 30 Hz in which the acceleration changes by 0.5 m/s^2
    assert learnt(late_s, manoeuvres(1_000, 0.5)) == pytest.approx(late_s, abs=0.005)


def test_one_step_that_was_a_hit_moves_it_little_and_never_beyond_what_can_be_flown():
    delay = Delay()
    delay.learn((-1.0, 0.0, 0.0), (1.0, 0.0, 0.0))
    assert delay.delay_s(NOISE_M_S**2) < 0.06
    delay.learn((-100.0, 0.0, 0.0), (10.0, 0.0, 0.0))
    assert delay.delay_s(NOISE_M_S**2) == LATEST_S
