"""The obstacle's normal: several directions that show it, each with its own error."""

import math

import pytest

from companion.reflex.config import CHANGE_RAD, IMPULSE_RAD
from companion.reflex.surface import Normal, normal_of, with_change


def turned(angle_deg, size=1.0):
    """South, turned towards the west."""
    angle = math.radians(angle_deg)
    return (-size * math.cos(angle), -size * math.sin(angle), 0.0)


def angle_deg(normal):
    n, e, _ = normal.direction_ned
    return math.degrees(math.atan2(-e, -n))


# A force counts by its direction alone.
@pytest.mark.parametrize("size", [1e-3, 1.0, 500.0])
@pytest.mark.parametrize("speed_m_s", [0.0, 0.4, 2.0])
def test_the_force_shows_the_normal_however_the_vehicle_came(size, speed_m_s):
    normal = normal_of(turned(30.0, size), (speed_m_s, 0.0, 0.0))
    assert angle_deg(normal) == pytest.approx(30.0) and normal.error_rad == pytest.approx(IMPULSE_RAD)


# In a hover the force alone tells, and what pushes along the flight came from behind.
@pytest.mark.parametrize(
    ("force", "speed_m_s", "normal_deg"),
    [
        (turned(45.0), 2.0, 0.0),
        ((0.0, 0.0, 0.0), 2.0, 0.0),
        (turned(110.0), 2.0, 0.0),
        (turned(130.0), 2.0, 130.0),
        (turned(45.0), 0.4, 45.0),
    ],
)
def test_where_clipping_is_hidden_the_way_that_the_vehicle_came_takes_the_forces_place(force, speed_m_s, normal_deg):
    assert angle_deg(normal_of(force, (speed_m_s, 0.0, 0.0), is_hidden=True)) == pytest.approx(normal_deg, abs=0.1)


def test_without_a_force_the_way_that_it_came_is_all_that_is_known():
    assert angle_deg(normal_of((0.0, 0.0, 0.0), (2.0, 0.0, 0.0))) == pytest.approx(0.0)
    assert normal_of((0.0, 0.0, 0.0), (0.4, 0.0, 0.0)) == Normal()


def test_the_change_of_the_velocity_turns_it_and_leaves_less_error_than_either():
    by_force = normal_of(turned(30.0), (2.0, 0.0, 0.0))
    both, unsure = (with_change(by_force, (2.0, 0.0, 0.0), (-1.0, 0.0, 0.0), error_m_s) for error_m_s in (0.05, 1.0))
    assert angle_deg(both) == pytest.approx(10.1, abs=0.5) and both.error_rad < CHANGE_RAD
    assert angle_deg(both) < angle_deg(unsure) < 30.0 and both.error_rad < unsure.error_rad < IMPULSE_RAD
