"""The obstacle's normal: several directions that show it, each with its own error."""

import math

import numpy as np
import pytest

from companion.reflex.config import APPROACH_RAD, IMPULSE_RAD, UNKNOWN_RAD
from companion.reflex.normal import Normal, normal_of, with_change

SOUTH = (-1.0, 0.0, 0.0)


def turned(angle_deg, size=1.0):
    """South, turned towards the west."""
    angle = math.radians(angle_deg)
    return (-size * math.cos(angle), -size * math.sin(angle), 0.0)


def deg(normal):
    n, e, _ = normal.direction_ned
    return math.degrees(math.atan2(-e, -n))


@pytest.mark.parametrize("size", [1e-3, 1.0, 500.0])
def test_a_direction_counts_by_its_error_and_not_by_its_size(size):
    # Given a force, and a vehicle that came from 30 degrees beside it
    normal = normal_of(turned(30.0, size), (2.0, 0.0, 0.0))
    # Then the normal is nearer to the force, which is 20 degrees off where the way that it came is 34
    assert deg(normal) == pytest.approx(22.5, abs=0.5)
    assert math.degrees(normal.error_rad) == pytest.approx(17.3, abs=0.2)
    assert np.linalg.norm(normal.direction_ned) == pytest.approx(1.0)


@pytest.mark.parametrize(("speed_m_s", "normal_deg"), [(0.4, 30.0), (0.6, 22.5)])
def test_of_a_vehicle_that_hovered_the_force_alone_tells(speed_m_s, normal_deg):
    assert deg(normal_of(turned(30.0), (speed_m_s, 0.0, 0.0))) == pytest.approx(normal_deg, abs=0.5)


def test_without_a_force_it_is_where_the_vehicle_came_from():
    normal = normal_of((0.0, 0.0, 0.0), (2.0, 0.0, 0.0))
    assert normal.direction_ned == SOUTH and normal.error_rad == pytest.approx(APPROACH_RAD)


@pytest.mark.parametrize(("pushed_deg", "normal_deg"), [(110.0, 90.1), (130.0, 130.0)])
def test_what_pushes_along_the_flight_came_from_behind(pushed_deg, normal_deg):
    assert deg(normal_of(turned(pushed_deg), (2.0, 0.0, 0.0))) == pytest.approx(normal_deg, abs=1.5)


def test_of_nothing_nothing_is_known():
    assert normal_of((0.0, 0.0, 0.0), (0.0, 0.0, 0.0)) == Normal()
    assert Normal().direction_ned == (0.0, 0.0, 0.0) and Normal().error_rad == UNKNOWN_RAD


@pytest.mark.parametrize(
    ("change_m_s", "normal_deg", "error_deg"), [(0.2, 38.0, 19.5), (1.0, 22.3, 14.9), (4.0, 14.3, 12.0)]
)
def test_a_large_change_of_velocity_decides_and_a_small_one_is_noise(change_m_s, normal_deg, error_deg):
    # Given a force 40 degrees beside the change of the velocity
    normal = with_change(Normal(turned(40.0), IMPULSE_RAD), (1.0, 0.0, 0.0), (1.0 - change_m_s, 0.0, 0.0))
    # Then the change counts by its own error, which falls with its size
    assert deg(normal) == pytest.approx(normal_deg, abs=0.5)
    assert math.degrees(normal.error_rad) == pytest.approx(error_deg, abs=0.2)


def test_the_error_is_that_of_directions_with_their_errors():
    # Given directions about south, in the plane, each with its error
    rng, errors = np.random.default_rng(1), []
    for _ in range(2000):
        normal = Normal().with_direction(turned(math.degrees(rng.normal(0.0, 0.2))), 0.2)
        normal = normal.with_direction(turned(math.degrees(rng.normal(0.0, 0.4))), 0.4)
        errors.append(math.radians(deg(normal)) / normal.error_rad)
    # Then 95 % of the normals lie within two of the stated standard deviations
    assert np.mean(np.abs(errors) < 2.0) == pytest.approx(0.954, abs=0.015)
