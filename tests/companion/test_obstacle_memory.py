"""What hits leave behind: touches become patches, patches of one surface become one."""

import math

import pytest

from companion.memory.patch import REACHES_M, Patch, is_same, remembered, touch_of
from companion.memory.stored import KnownPatch, ObstacleFile, as_data, file_data
from companion.reflex.surface import Normal

CLEARANCE_M = 0.55
SOUTH, NORTH = (-1.0, 0.0, 0.0), (1.0, 0.0, 0.0)

ERROR_RAD = math.radians(15.0)


def wall(*easts_m: float, height_m: float = 1.5, normal=SOUTH, north_m: float = 4.0) -> Patch:
    """A wall as it is remembered, touched at these places."""
    places = tuple((north_m, east_m, -height_m) for east_m in easts_m)
    return Patch(places, normal, ERROR_RAD, REACHES_M, found_at_us=1)


def turned(deg: float):
    return (-math.cos(math.radians(deg)), -math.sin(math.radians(deg)), 0.0)


def deg(rad: float) -> float:
    return math.degrees(rad)


# --- from a hit to a touch


def test_the_surface_is_a_guards_reach_ahead_of_the_centre():
    touch = touch_of((3.8, 1.0, -1.5), (2.0, 0.0, 0.0), Normal(SOUTH, ERROR_RAD), 0.2, 7)
    assert touch.centre_ned_m == pytest.approx((4.0, 1.0, -1.5))
    assert (touch.normal_ned, touch.normal_error_rad) == (SOUTH, ERROR_RAD)
    assert touch.reaches_m == REACHES_M and touch.found_at_us == 7


def test_what_pushes_a_vehicle_on_came_after_it_and_is_no_wall():
    """A screen that overtakes is behind the vehicle, where it comes from, and not in its way."""
    touch = touch_of((3.0, 1.0, -1.5), (1.0, 0.0, 0.0), Normal(NORTH, ERROR_RAD), 0.2, 0)
    assert touch.centre_ned_m == pytest.approx((2.8, 1.0, -1.5))
    assert touch.normal_ned == NORTH and touch.reaches_m == 0.0


# --- patches of the same surface


def test_two_touches_of_a_wall_are_one_patch_that_spans_both():
    (patch,) = remembered((), [wall(0.0), wall(1.05)], CLEARANCE_M)
    low_m, high_m = patch.assumed_along_m()
    assert patch.hits == 2 and high_m - low_m == pytest.approx(1.05 + 2 * 0.525, abs=0.01)


def test_the_places_give_a_better_normal_than_the_pushes():
    """Two touches 2 m apart on a wall turned by 10 degrees, each with a normal 20 degrees off."""
    slope = math.tan(math.radians(10.0))
    touches = [wall(east_m, normal=turned(30.0), north_m=4.0 - slope * east_m) for east_m in (0.0, 1.0, 2.0)]
    (patch,) = remembered((), touches, CLEARANCE_M)
    assert patch.normal_ned == pytest.approx(turned(10.0), abs=0.02)
    assert deg(patch.normal_error_rad) < 6.0


@pytest.mark.parametrize(
    "other",
    [
        wall(0.3, normal=turned(90.0)),  # the other wall of a corner
        wall(0.0, normal=(1.0, 0.0, 0.0), north_m=4.2),  # its other face
        wall(4.0),  # far off: a vehicle fits between
        wall(0.2, north_m=5.0),  # a parallel wall a metre behind
        wall(0.0, height_m=4.0),  # high above
    ],
)
def test_another_surface_is_another_patch(other):
    assert len(remembered((), [wall(0.0), other], CLEARANCE_M)) == 2
    assert not is_same(wall(0.0), other, CLEARANCE_M)


# --- files


def test_a_patch_comes_back_from_a_file_as_it_was():
    known = remembered((), [wall(0.0), wall(1.05), wall(0.0, normal=turned(90.0))], CLEARANCE_M)
    stored = ObstacleFile.model_validate(file_data(known))
    for before, after in zip(known, stored.patches, strict=True):
        patch = after.patch()
        assert patch.hits == before.hits and patch.found_at_us == before.found_at_us
        assert patch.normal_ned == pytest.approx(before.normal_ned, abs=1e-3)
        assert patch.assumed_along_m() == pytest.approx(before.assumed_along_m(), abs=1e-3)
        # and a second time to the last digit
        assert as_data(KnownPatch.model_validate(as_data(patch)).patch()) == as_data(patch)
