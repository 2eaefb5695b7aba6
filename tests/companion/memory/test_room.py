"""A flight's room: its fence, the patches that touches leave, and ways round them: the shortest, or none."""

import math
from itertools import pairwise

import pytest
from hypothesis import example, given
from hypothesis import strategies as st
from pydantic import ValidationError
from shapely import LineString, Point

from companion.fence import Fence
from companion.memory.patch import REACHES_M, Patch, is_same, touch_of
from companion.memory.stored import ObstacleFile, as_data
from companion.memory.surroundings import LEAST_FREE_M, SLACK_M, ObstacleMap, assumed_area, route
from companion.mission.item_trajectory import SpeedLimits, home_around, left_of, looks, trajectory_around
from companion.mission.items import GoToItem, OrbitItem, PathItem, ReturnItem
from companion.mission.trajectory import CurveProfile
from companion.reflex.surface import Normal

# An L: the room to the north-east is not ours.
ROOM = Fence(polygon_ne_m=[[-2, -2], [6, -2], [6, 1], [2, 1], [2, 6], [-2, 6]], max_height_m=3)
ROUND = Fence(radius_m=5)
# One that bends round the room to the north-east, and a circle that cuts it.
HOOK = Fence(radius_m=5, polygon_ne_m=[[-1, -1], [2, -1], [2, 3], [8, 3], [8, 6], [-1, 6]])
COORDINATE = st.floats(-12, 12)


@pytest.mark.parametrize(
    ("polygon", "words"),
    [
        ([[1, 1], [2, 1], [2, 2]], "does not contain the arming position"),
        ([[-1, -1], [1, 1], [1, -1], [-1, 1]], "crosses another"),
        ([[-1, -1], [-1, -1], [1, -1], [1, 1]], "the same as the next"),
        ([[-1, -1], [1, 1]], "at least 3"),
    ],
)
def test_fences_that_make_no_sense(polygon, words):
    with pytest.raises(ValidationError, match=words):
        Fence(polygon_ne_m=polygon)


@example(0.0, 5e-324, HOOK)
@given(COORDINATE, COORDINATE, st.sampled_from([ROOM, ROUND, HOOK]))
def test_ways_from_home_end_inside(north_m, east_m, fence):
    """And what was inside already is left alone."""
    end = fence.shortened((0.0, 0.0), (north_m, east_m))
    assert fence.contains(end[0] * (1 - 1e-9), end[1] * (1 - 1e-9))
    if fence.contains(north_m, east_m) and fence is ROUND:
        assert end == (north_m, east_m)
    nearest = fence.nearest_inside(north_m, east_m)
    towards = tuple(0.999999 * value for value in nearest)
    assert fence.contains(*towards) or fence.outside_by_m((*nearest, -1.0)) < 1e-6


def test_a_way_of_no_length_has_its_end_also_on_the_edge_of_a_circle():
    on_it = (ROUND.radius_m * (1.0 + 1e-12), 0.0)
    assert ROUND.shortened(on_it, on_it) == on_it


CLEARANCE_M = 0.55
SOUTH, NORTH = (-1.0, 0.0, 0.0), (1.0, 0.0, 0.0)

ERROR_RAD = math.radians(15.0)


def wall(*easts_m: float, height_m: float = 1.5, normal=SOUTH, north_m: float = 4.0) -> Patch:
    """A wall as it is remembered, touched at these places."""
    places = tuple((north_m, east_m, -height_m) for east_m in easts_m)
    return Patch(touches_ned_m=places, normal_ned=normal, normal_error_deg=15.0, found_at_us=1)


def turned(deg: float):
    return (-math.cos(math.radians(deg)), -math.sin(math.radians(deg)), 0.0)


# --- from a hit to a touch


def test_the_surface_is_a_guards_reach_ahead_of_the_centre_or_behind_one_that_it_pushes_on():
    touch = touch_of((3.8, 1.0, -1.5), (2.0, 0.0, 0.0), Normal(SOUTH, ERROR_RAD), 0.2, 7)
    assert touch.centre_ned_m == pytest.approx((4.0, 1.0, -1.5))
    assert (touch.normal_ned, touch.normal_error_rad) == (SOUTH, ERROR_RAD)
    assert touch.reaches_m == REACHES_M and touch.found_at_us == 7
    # A screen that overtakes is behind the vehicle, where it comes from, and not in its way
    touch = touch_of((3.0, 1.0, -1.5), (1.0, 0.0, 0.0), Normal(NORTH, ERROR_RAD), 0.2, 0)
    assert touch.centre_ned_m == pytest.approx((2.8, 1.0, -1.5))
    assert touch.normal_ned == NORTH and touch.reaches_m == 0.0
    # Nor is there anything where an estimate has run away to
    assert touch_of((2e5, 1.0, -1.5), (1.0, 0.0, 0.0), Normal(NORTH, ERROR_RAD), 0.2, 0) is None


# --- patches of the same surface


def test_the_places_give_a_better_normal_than_the_pushes():
    """Two touches 2 m apart on a wall turned by 10 degrees, each with a normal 20 degrees off."""
    slope = math.tan(math.radians(10.0))
    touches = [wall(east_m, normal=turned(30.0), north_m=4.0 - slope * east_m) for east_m in (0.0, 1.0, 2.0)]
    (patch,) = around().joined(touches).patches
    assert patch.normal_ned == pytest.approx(turned(10.0), abs=0.02)
    assert math.degrees(patch.normal_error_rad) < 6.0


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
    assert len(around().joined([wall(0.0), other]).patches) == 2
    assert not is_same(wall(0.0), other, CLEARANCE_M)


def test_a_ceiling_whose_direction_is_not_known_well_bends_beside_its_touch():
    ceiling = Patch(touches_ned_m=((0.0, 0.0, -2.2),), normal_ned=(0.0, 0.0, 1.0))
    beside_m = ceiling.beside_m((3.0, 4.0, -1.0))
    assert beside_m == 5.0
    assert ceiling.bends_m(beside_m) == pytest.approx(5.0 * math.tan(ERROR_RAD))
    # And a recovery that ends a clearance below it is clear
    rests = (0.0, 0.0, CLEARANCE_M - ceiling.assumed_heights_m()[0])
    assert all(around().joined([ceiling]).is_clear((0.0, 0.0, rests[2] + off_m), rests) for off_m in (0.0, -1e-9, 1e-9))


# --- files


def test_a_patch_comes_back_from_a_file_as_it_was():
    known = around().joined([wall(0.0), wall(1.05), wall(0.0, normal=turned(90.0))]).patches
    stored = ObstacleFile.model_validate({"patches": [as_data(patch) for patch in known]})
    for before, patch in zip(known, stored.patches, strict=True):
        assert len(patch.touches_ned_m) == len(before.touches_ned_m) and patch.found_at_us == before.found_at_us
        assert patch.normal_ned == pytest.approx(before.normal_ned, abs=1e-3)
        assert patch.assumed_along_m() == pytest.approx(before.assumed_along_m(), abs=1e-3)
        # and a second time to the last digit
        assert as_data(Patch.model_validate(as_data(patch))) == as_data(patch)
    # nor is a steep one turned
    for degrees in range(90):
        once = wall(0.0, normal=(math.cos(math.radians(degrees)), math.sin(math.radians(degrees)), 1.5))
        assert wall(0.0, normal=once.normal_ned).normal_ned == once.normal_ned


REACH_M, MARGIN_M = 0.2, 0.35
PACE = SpeedLimits(1.5, 2.0)
START, GOAL = (0.0, 0.0, -1.5), (7.0, 0.0, -1.5)


def around(*patches: Patch, fence: Fence | None = None) -> ObstacleMap:
    return ObstacleMap(patches, fence or Fence(radius_m=9, max_height_m=2.4), REACH_M, MARGIN_M)


def test_the_way_round_a_touch_keeps_the_clearance_and_is_the_shortest():
    known = around(wall(0.2))
    assert known.block((START, GOAL))
    places = route(known, START, GOAL)
    trajectory = LineString([START[:2], *[place[:2] for place in places]])
    assert trajectory.distance(known.areas[0]) >= CLEARANCE_M - SLACK_M
    # round the nearer end, which is the western one
    assert all(place[1] < 0.0 for place in places[:-1])
    least_m = math.hypot(4.0, 0.3 + CLEARANCE_M) + math.hypot(3.0, 0.3 + CLEARANCE_M)
    assert least_m < sum(math.dist(a, b) for a, b in pairwise([START, *places])) < least_m + 0.3


def test_a_vehicle_inside_what_is_remembered_knows_that_it_is_not_there_and_no_goal_is_reached_there():
    """A door that was opened, or a place estimate that has drifted."""
    known = around(wall(0.0))
    assert route(known, (4.05, 0.0, -1.5), GOAL) == (GOAL,)
    beside = (3.85, 0.0, -1.5)
    assert route(known, (4.05, 0.0, -1.5), beside) == (beside,)
    # From outside a goal in the wall cannot be reached, one beside it can
    assert route(known, START, beside) is None
    assert route(known, START, (4.0 - REACH_M - LEAST_FREE_M - 0.05, 0.0, -1.5)) is not None


# --- items


def test_a_paths_point_in_a_wall_is_left_out_but_not_its_last():
    through = PathItem(points_ned_m=((2.0, 1.0, -1.5), (4.0, 0.0, -1.5), (6.0, 0.0, -1.5)))
    planned = trajectory_around(through, START, PACE, around(wall(0.0)))
    assert planned.left_out == 1 and planned.trajectory.target_m == (6.0, 0.0, -1.5)
    into = PathItem(points_ned_m=((2.0, 1.0, -1.5), (4.0, 0.0, -1.5)))
    assert trajectory_around(into, START, PACE, around(wall(0.0))).trajectory is None


@pytest.mark.parametrize("turns", [1.0, 999.5])
def test_an_orbit_is_flown_round_what_stands_in_it(turns):
    item = OrbitItem(centre_ned_m=(4.0, 3.0, -1.5), radius_m=3.0, turns=turns)
    known = around(wall(0.0, north_m=4.0), fence=Fence(radius_m=12))
    planned = trajectory_around(item, START, PACE, known)
    assert planned.is_detour and planned.left_out >= turns
    places = [planned.trajectory.at(planned.trajectory.duration_s * n / 400)[0] for n in range(401)]
    assert min(Point(place[:2]).distance(known.cores[0]) for place in places) > REACH_M + LEAST_FREE_M
    assert max(place[1] for place in places) > 5.5, "the far side of the circle is flown"


TWICE = (4.0, 0.0, -1.5)
LOOP = (TWICE, (6.0, 2.0, -1.5), (4.0, 4.0, -1.5), TWICE, (4.0, -2.0, -1.5))


@pytest.mark.parametrize(
    ("points", "half"),
    [
        (((2.0, 1.0, -1.5), (4.0, -1.0, -1.5), (6.0, 0.0, -1.5)), 1),
        (((2.0, 1.0, -1.5), (4.0, -1.0, -1.5), START), 1),
        (LOOP, 2),
    ],
)
def test_what_has_been_flown_of_a_path_is_not_flown_again(points, half):
    """Also of one that ends where it begins. And what is ahead is flown, of one that crosses itself, too."""
    path = PathItem(points_ned_m=points)
    trajectory = CurveProfile((START, *points), 1.5, 2.0)
    left = [left_of(path, trajectory, trajectory.duration_s * part) for part in (0.1, 0.5, 1.0)]
    assert [item.points_ned_m for item in left[:2]] == [points, points[half:]]
    assert left[2] == GoToItem(position_ned_m=points[-1])


def test_of_a_path_round_a_wall_its_own_points_are_left():
    path = PathItem(points_ned_m=((2.0, 1.0, -1.5), (4.0, 0.0, -1.5), (6.0, 0.0, -1.5), (6.0, 3.0, -1.5)))
    round_it = trajectory_around(path, START, PACE, around(wall(0.0))).trajectory
    assert left_of(path, round_it, 0.5 * round_it.duration_s).points_ned_m == path.points_ned_m[2:]


def test_a_flight_keeps_in_a_polygon_that_bends():
    # Given two arms that are joined in the south, and a way from one into the other
    arms = Fence(polygon_ne_m=[[-8, -2], [6, -2], [6, 2], [-4, 2], [-4, 5], [6, 5], [6, 9], [-8, 9]])
    start, known = (0.0, 7.0, -1.5), around(fence=arms)
    for planned in (
        home_around(start, ReturnItem(), PACE, known),
        trajectory_around(GoToItem(position_ned_m=(2.0, 0.0, -1.5)), start, PACE, known),
        trajectory_around(PathItem(points_ned_m=((2.0, 0.0, -1.5), (3.0, 0.0, -1.5))), start, PACE, known),
    ):
        assert planned.is_detour and all(arms.outside_by_m(place) < 0.05 for place in looks(planned.trajectory))
    # And a line sees a slit that is narrower than any two places that would be looked at
    slit = around(
        fence=Fence(polygon_ne_m=[[-8, -2], [-8, 9], [6, 9], [6, 2.03], [-7, 2.03], [-7, 2], [6, 2], [6, -2]])
    )
    assert trajectory_around(GoToItem(position_ned_m=(2.0, 0.0, -1.5)), start, PACE, slit).is_detour
    # But from outside it goes straight in, and along its edge as the item says
    into = trajectory_around(GoToItem(position_ned_m=(2.0, 0.0, -1.5)), (8.0, 0.0, -1.5), PACE, known)
    edge = PathItem(points_ned_m=((0.0, 9.0, -1.5), (6.0, 9.0, -1.5)))
    for planned in (into, trajectory_around(edge, (-4.0, 9.0, -1.5), PACE, known)):
        assert planned.trajectory is not None and not planned.is_detour


# --- touch after touch


def explore(width_m: float, offset_m: float, error_deg: float) -> tuple[list[Patch], bool]:
    """A point with the vehicle's reach, a wall 4 m north, and a memory; touches until it is through or gives up."""
    fence, touches, start = Fence(radius_m=11, max_height_m=2.4), [], START
    while len(touches) < 12:
        known = around(fence=fence).joined(touches)
        places = route(known, start, GOAL)
        if places is None:
            return touches, False
        hit = next((hit for a, b in pairwise([start, *places]) if (hit := first_hit(a, b, width_m, offset_m))), None)
        if hit is None:
            return touches, True
        place, velocity, normal = hit
        lean = math.radians(error_deg) * (-1) ** len(touches)
        n, e, _ = normal
        seen = (n * math.cos(lean) - e * math.sin(lean), n * math.sin(lean) + e * math.cos(lean), 0.0)
        touch = touch_of(place, velocity, Normal(seen, math.radians(max(error_deg, 10.0))), REACH_M, 0)
        # Then no touch is made where a wall is remembered
        for patch in known.patches:
            assert assumed_area(patch, 0.0).distance(Point(touch.centre_ned_m[:2])) > 0.1
        touches.append(touch)
        start = tuple(p + 0.4 * x for p, x in zip(place, normal, strict=True))
    return touches, False


def first_hit(a, b, width_m, offset_m):
    steps = max(2, math.ceil(math.dist(a, b) / 0.01))
    velocity = tuple(y - x for x, y in zip(a, b, strict=True))
    for step in range(steps + 1):
        place = tuple(x + v * step / steps for x, v in zip(a, velocity, strict=True))
        beside_m = abs(place[1] - offset_m) - 0.5 * width_m
        if 4.0 - REACH_M <= place[0] <= 4.1 + REACH_M and beside_m < REACH_M:
            normal = SOUTH if place[0] < 3.85 else (0.0, math.copysign(1.0, place[1] - offset_m), 0.0)
            return place, tuple(v / math.dist(a, b) for v in velocity), normal
    return None


@pytest.mark.parametrize("error_deg", [0.0, 15.0, 35.0])
@pytest.mark.parametrize("offset_m", [0.0, 0.4, -0.9])
@pytest.mark.parametrize(("width_m", "most"), [(0.3, 2), (1.0, 3), (3.0, 4), (6.0, 6), (10.0, 8)])
def test_a_wall_of_any_width_is_passed_after_a_few_touches_none_where_it_is_remembered(
    width_m, most, offset_m, error_deg
):
    touches, is_through = explore(width_m, offset_m, error_deg)
    assert is_through and len(touches) <= most
