"""Whatever a person writes in a mission file, the answer is a mission or a sentence, never anything else."""

import copy

from hypothesis import given, settings
from hypothesis import strategies as st
from pydantic import ValidationError

from companion.mission.model import Mission, itinerary, longest_s, steps_to_fly

WHOLE = {
    "name": "t",
    "items": [
        {"takeoff": {"height_m": 2}},
        {"set_speed": {"speed_m_s": 2}},
        {"go_to": {"position_ned_m": [3, 1, -2], "yaw_deg": 20}, "on_collision": {"then": "retry"}, "timeout_s": 9},
        {"path": {"points_ned_m": [[1, 2, -2], [3, -1, -2.5]], "yaw_deg": "along"}},
        {"repeat": {"times": 2, "items": [{"velocity": {"velocity_ned_m_s": [0, 1, 0], "duration_s": 2}}]}},
        {"orbit": {"centre_ned_m": [2, 0, -2], "radius_m": 2, "turns": 1}},
        {"wait_for": {"steady": {"within_m": 0.2}}},
        {"expect": {"collision": {"within_s": 5}}},
        {"set_yaw": {"yaw_deg": 90}},
        {"hold": {"duration_s": 1}},
        {"return": {"height_m": 3}},
    ],
    "fence": {"polygon_ne_m": [[-8, -8], [8, -8], [8, 8], [-8, 8]], "max_height_m": 5},
    "limits": {"max_speed_m_s": 5},
    "abort_when": {"battery_below_percent": 20},
}


def _paths(value, path=()):
    yield path
    for key, below in value.items() if isinstance(value, dict) else enumerate(value) if isinstance(value, list) else ():
        yield from _paths(below, (*path, key))


PATHS = list(_paths(WHOLE))[1:]
SCALARS = st.one_of(
    st.none(), st.booleans(), st.integers(), st.floats(), st.text(max_size=5), st.sampled_from([0, -1, 1e300, 1e-300])
)
VALUES = st.recursive(
    SCALARS,
    lambda below: (
        st.lists(below, max_size=4)
        | st.dictionaries(st.sampled_from(["items", "times", "go_to", "position_ned_m", "radius_m", "then"]), below)
    ),
    max_leaves=6,
)


@settings(max_examples=200, deadline=None, derandomize=True)
@given(st.sampled_from(PATHS), VALUES)
def test_one_part_replaced_by_anything(path, value):
    data = copy.deepcopy(WHOLE)
    place = data
    for key in path[:-1]:
        place = place[key]
    place[path[-1]] = value
    try:
        mission = Mission.model_validate(data)
    except ValidationError as error:
        assert all(part["msg"] for part in error.errors())
        return
    # what is accepted can be planned
    assert len(steps_to_fly(mission)) == len(itinerary(mission))
    assert longest_s(mission, 60.0) >= 0.0
