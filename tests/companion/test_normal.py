"""The obstacle's normal: several directions that show it, each with its own error."""

import math

import pytest

from companion.reflex.config import HIDDEN_RAD
from companion.reflex.surface import normal_of


def turned(angle_deg, size=1.0):
    """South, turned towards the west."""
    angle = math.radians(angle_deg)
    return (-size * math.cos(angle), -size * math.sin(angle), 0.0)


# A force counts by its direction alone; in a hover it alone tells; what pushes along the flight came from behind.
@pytest.mark.parametrize(
    ("force", "speed_m_s", "normal_deg"),
    [
        *((turned(30.0, size), 2.0, 22.5) for size in (1e-3, 1.0, 500.0)),
        (turned(30.0), 0.4, 30.0),
        (turned(30.0), 0.6, 22.5),
        ((0.0, 0.0, 0.0), 2.0, 0.0),
        (turned(110.0), 2.0, 90.1),
        (turned(130.0), 2.0, 130.0),
    ],
)
def test_force_and_approach_show_the_normal_each_by_its_error(force, speed_m_s, normal_deg):
    n, e, _ = normal_of(force, (speed_m_s, 0.0, 0.0)).direction_ned
    assert math.degrees(math.atan2(-e, -n)) == pytest.approx(normal_deg, abs=0.5)


def test_two_directions_leave_less_error_than_either():
    assert math.degrees(normal_of(turned(30.0), (2.0, 0.0, 0.0)).error_rad) == pytest.approx(17.3, abs=0.2)


def test_an_impulse_that_may_be_clipped_turns_the_normal_less():
    n, e, _ = normal_of(turned(45.0), (2.0, 0.0, 0.0), HIDDEN_RAD).direction_ned
    assert 5.0 < math.degrees(math.atan2(-e, -n)) < 15.0
