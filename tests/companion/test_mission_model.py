"""Mission files: what is accepted, and what the message says about what is not."""

import copy

import pytest
from pydantic import ValidationError

from companion.mission.model import Mission

GOOD = {
    "name": "wall",
    "description": "one line",
    "items": [
        {"takeoff": {"height_m": 1.5}},
        {"go_to": {"position_ned_m": [6, 0, -1.5], "speed_m_s": 2.0, "acceleration_m_s2": 2.0, "yaw_deg": 0}},
        {"hold": {"duration_s": 2}},
        {"land": {}},
    ],
    "on_collision": {"then": "hold", "hold_s": 3},
    "recovery": {"law": "paper", "gamma": [0.5, 0.4]},
    "fence": {"radius_m": 15, "max_height_m": 6},
    "on_interrupt": "hold",
    "companion": {"detector": "fused"},
    "sim": {"airframe": "foldable", "anything": ["goes"]},
}


def changed(path: list, value: object) -> dict:
    data = copy.deepcopy(GOOD)
    place = data
    for key in path[:-1]:
        place = place[key]
    place[path[-1]] = value
    return data


def complaint(data: dict) -> tuple[str, tuple]:
    with pytest.raises(ValidationError) as caught:
        Mission.model_validate(data)
    (error,) = caught.value.errors()
    return error["msg"], error["loc"]


@pytest.mark.parametrize(
    ("path", "value", "words", "place"),
    [
        (["wind"], 3, "Extra inputs", ("wind",)),
        (["items", 1, "go_to", "sped"], 3, "Extra inputs", ("items", 1, "go_to", "sped")),
        (["companion", "fused"], {"treshold": 3}, "Extra inputs", ("companion", "fused", "treshold")),
        (["items", 1, "go_to", "speed_m_s"], 0, "greater than 0", ("items", 1, "go_to", "speed_m_s")),
        (["items", 1, "go_to", "speed_m_s"], 50, "less than or equal to 12", ("items", 1, "go_to", "speed_m_s")),
        (["items", 1, "go_to", "speed_m_s"], "fast", "valid number", ("items", 1, "go_to", "speed_m_s")),
        (["items", 1, "go_to", "speed_m_s"], True, "valid number", ("items", 1, "go_to", "speed_m_s")),
        (["items", 0, "takeoff", "height_m"], -1, "greater than 0", ("items", 0, "takeoff", "height_m")),
        (["items", 0, "takeoff", "height_m"], float("nan"), "finite", ("items", 0, "takeoff", "height_m")),
        (["items", 1, "go_to", "position_ned_m"], [1, 2], "required", ("items", 1, "go_to", "position_ned_m", 2)),
        (["items", 2], {"hold": {"duration_s": 1}, "land": {}}, "exactly one key", ("items", 2)),
        (["items", 2], {}, "exactly one key", ("items", 2)),
        (["items", 0], {"hold": {"duration_s": 1}}, "first item must be takeoff", ()),
        (["items", 3], {"hold": {"duration_s": 1}}, "last item must be land or return", ()),
        (["items", 2], {"land": {}}, "item 3 is land", ()),
        (["items", 1, "go_to", "position_ned_m"], [20, 0, -1.5], "item 2 (go_to) lies 20.00 m out", ()),
        (["items", 1, "go_to", "position_ned_m"], [2, 0, -7], "above fence.max_height_m", ()),
        (["items", 1, "go_to", "position_ned_m"], [2, 0, 1.5], "up is negative", ()),
        (["items", 0, "takeoff", "height_m"], 9, "item 1 (takeoff)", ()),
        (["on_interrupt"], "dance", "'hold' or 'land'", ("on_interrupt",)),
        (["companion", "detector"], "magic", "no detector 'magic'", ("companion", "detector")),
        (
            ["companion", "flight"],
            {"setpoint_hz": 5.0},
            "greater than or equal to 20",
            ("companion", "flight", "setpoint_hz"),
        ),
    ],
)
def test_what_is_wrong_is_named_with_its_place(path, value, words, place):
    message, location = complaint(changed(path, value))
    assert words in message
    assert location == place
