"""Hanging on what was hit: when a vehicle does, until when, and what is asked for meanwhile."""

import math

import pytest

from companion.flight.pinned import BEGUN_US, LONGEST_US, Hanging, let_go
from companion.messages import Attitude

WALL_IN_THE_NORTH = (-1.0, 0.0, 0.0)


def leaning_north(lean_deg, forward_rad_s=0.0):
    """Nose north; a forward pitch is negative."""
    half = -0.5 * math.radians(lean_deg)
    return Attitude(0, (math.cos(half), 0.0, math.sin(half), 0.0), (0.0, -forward_rad_s, 0.0))


@pytest.mark.parametrize(
    ("lean_deg", "forward_rad_s", "since_hit_us", "hangs"),
    [
        (10.0, 0.0, 20_000, False),  # as it came
        (30.0, 0.0, 60_000, True),
        (10.0, 5.0, 20_000, True),  # on its way there
        (30.0, -5.0, 60_000, False),  # on its way back
        (-30.0, 0.0, 60_000, False),  # away from the wall
        (30.0, 0.0, BEGUN_US, False),  # braking
    ],
)
def test_a_vehicle_hangs_that_leans_into_what_it_has_just_hit(lean_deg, forward_rad_s, since_hit_us, hangs):
    attitude = leaning_north(lean_deg, forward_rad_s)
    assert Hanging().step(attitude, WALL_IN_THE_NORTH, since_hit_us, 1_000_000) is hangs


def test_it_hangs_until_it_is_nearly_level_or_for_too_long():
    hanging = Hanging()
    assert hanging.step(leaning_north(30.0), WALL_IN_THE_NORTH, 60_000, 1_000_000)
    assert hanging.step(leaning_north(15.0), WALL_IN_THE_NORTH, 400_000, 1_340_000)
    assert not hanging.step(leaning_north(11.0), WALL_IN_THE_NORTH, 420_000, 1_360_000)
    assert hanging.step(leaning_north(30.0), WALL_IN_THE_NORTH, 60_000, 2_000_000)
    assert not hanging.step(leaning_north(70.0), WALL_IN_THE_NORTH, 1_200_000, 2_000_001 + LONGEST_US)


def test_little_thrust_away_from_the_wall_is_asked_for():
    away, _, down = let_go(WALL_IN_THE_NORTH)
    assert away < 0.0 and 0.0 < down < 9.81
