"""The geofence: what is inside, where a way leaves it, and which fences make no sense."""

import pytest
from hypothesis import given
from hypothesis import strategies as st
from pydantic import ValidationError

from companion.fence import Fence

# An L: the room to the north-east is not ours.
ROOM = Fence(polygon_ne_m=[[-2, -2], [6, -2], [6, 1], [2, 1], [2, 6], [-2, 6]], max_height_m=3)
ROUND = Fence(radius_m=5)
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


@given(COORDINATE, COORDINATE, st.sampled_from([ROOM, ROUND, Fence(radius_m=4, polygon_ne_m=ROOM.polygon_ne_m)]))
def test_ways_from_home_end_inside(north_m, east_m, fence):
    """And what was inside already is left alone."""
    end = fence.shortened((0.0, 0.0), (north_m, east_m))
    assert fence.contains(end[0] * (1 - 1e-9), end[1] * (1 - 1e-9))
    if fence.contains(north_m, east_m) and fence is ROUND:
        assert end == (north_m, east_m)
    nearest = fence.nearest_inside(north_m, east_m)
    towards = tuple(0.999999 * value for value in nearest)
    assert fence.contains(*towards) or fence.outside_by_m((*nearest, -1.0)) < 1e-6
