"""What hits leave behind: touches become patches, patches of one surface become one."""

import math

import pytest

from companion.memory.patch import (
    GOES_ON_MOST_M,
    LEAST_SPEED_M_S,
    REACHES_M,
    Patch,
    is_same,
    remembered,
    touch_of,
)
from companion.memory.stored import KnownPatch, ObstacleFile, as_data, file_data
from companion.reflex.normal import Normal

CLEARANCE_M = 0.55
SOUTH, NORTH = (-1.0, 0.0, 0.0), (1.0, 0.0, 0.0)

ERROR_RAD = math.radians(15.0)


def wall_touch(
    east_m: float, height_m: float = 1.5, normal=SOUTH, error_deg: float = 15.0, north_m: float = 4.0
) -> Patch:
    return Patch(((north_m, east_m, -height_m),), normal, math.radians(error_deg), REACHES_M, 1)


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


def test_what_came_to_a_hovering_vehicle_is_not_believed_to_be_a_wall():
    touch = touch_of((0, 0, -1.5), (0.5 * LEAST_SPEED_M_S, 0.0, 0.0), Normal(SOUTH, ERROR_RAD), 0.2, 0)
    assert touch.reaches_m == 0.0


def test_a_hit_of_which_nothing_is_known_leaves_nothing():
    assert touch_of((0, 0, -1.5), (0.0, 0.0, 0.0), Normal(), 0.2, 0) is None


# --- patches of the same surface


def test_one_touch_is_believed_to_reach_a_little_to_all_sides():
    (patch,) = remembered((), [wall_touch(1.0)], CLEARANCE_M)
    # someone who looks south has the west on the right
    assert patch.assumed_along_m() == pytest.approx((-REACHES_M, REACHES_M))
    assert patch.assumed_heights_m() == pytest.approx((1.0, 2.0))
    assert patch.hits == 1


def test_two_touches_of_a_wall_are_one_patch_that_spans_both():
    (patch,) = remembered((), [wall_touch(0.0), wall_touch(1.05)], CLEARANCE_M)
    low_m, high_m = patch.assumed_along_m()
    assert patch.hits == 2 and high_m - low_m == pytest.approx(1.05 + 2 * 0.525, abs=0.01)


def test_the_longer_a_wall_is_known_to_be_the_further_it_is_believed_to_go_on():
    known = remembered((), [wall_touch(east_m) for east_m in (0, 1, 2, 3, 4, 5, 6)], CLEARANCE_M)
    (low_m, high_m), (touched_low_m, touched_high_m) = known[0].assumed_along_m(), known[0].touched_along_m()
    assert high_m - touched_high_m == touched_low_m - low_m == GOES_ON_MOST_M


def test_the_places_give_a_better_normal_than_the_pushes():
    """Two touches 2 m apart on a wall turned by 10 degrees, each with a normal 20 degrees off."""
    slope = math.tan(math.radians(10.0))
    touches = [wall_touch(east_m, normal=turned(30.0), north_m=4.0 - slope * east_m) for east_m in (0.0, 1.0, 2.0)]
    (patch,) = remembered((), touches, CLEARANCE_M)
    assert patch.normal_ned == pytest.approx(turned(10.0), abs=0.02)
    assert deg(patch.normal_error_rad) < 6.0


@pytest.mark.parametrize(
    "other",
    [
        wall_touch(0.3, normal=turned(90.0)),  # the other wall of a corner
        wall_touch(0.0, normal=(1.0, 0.0, 0.0), north_m=4.2),  # its other face
        wall_touch(4.0),  # far off: a vehicle fits between
        wall_touch(0.2, north_m=5.0),  # a parallel wall a metre behind
        wall_touch(0.0, height_m=4.0),  # high above
    ],
)
def test_another_surface_is_another_patch(other):
    assert len(remembered((), [wall_touch(0.0), other], CLEARANCE_M)) == 2
    assert not is_same(wall_touch(0.0), other, CLEARANCE_M)


def test_a_touch_between_two_patches_joins_them():
    apart = remembered((), [wall_touch(0.0), wall_touch(2.4)], CLEARANCE_M)
    joined = remembered(apart, [wall_touch(1.2)], CLEARANCE_M)
    assert len(apart) == 2 and len(joined) == 1 and joined[0].hits == 3


def test_an_uncertain_normal_does_not_split_a_wall():
    """Rigid hits have been 50 degrees off: sure normals so far apart are two surfaces, unsure ones may be one."""
    for error_deg, patches in ((10.0, 2), (30.0, 1)):
        touches = [wall_touch(0.0, error_deg=error_deg), wall_touch(0.9, normal=turned(45.0), error_deg=error_deg)]
        assert len(remembered((), touches, CLEARANCE_M)) == patches


def test_a_ceiling_is_believed_upwards_without_an_end():
    lid = Patch(((1.0, 1.0, -2.5),), (0.0, 0.0, 1.0), math.radians(15.0), REACHES_M, 0)
    (patch,) = remembered((), [lid], CLEARANCE_M)
    assert patch.is_steep and patch.assumed_heights_m() == (2.5, math.inf)


# --- files


def test_a_patch_comes_back_from_a_file_as_it_was():
    known = remembered((), [wall_touch(0.0), wall_touch(1.05), wall_touch(0.0, normal=turned(90.0))], CLEARANCE_M)
    stored = ObstacleFile.model_validate(file_data(known))
    for before, after in zip(known, stored.patches, strict=True):
        patch = after.patch()
        assert patch.hits == before.hits and patch.found_at_us == before.found_at_us
        assert patch.normal_ned == pytest.approx(before.normal_ned, abs=1e-3)
        assert patch.assumed_along_m() == pytest.approx(before.assumed_along_m(), abs=1e-3)
        # and a second time to the last digit
        assert as_data(KnownPatch.model_validate(as_data(patch)).patch()) == as_data(patch)
