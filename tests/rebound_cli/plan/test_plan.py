"""Missions from QGroundControl: places, order, repeats and fences survive."""

import contextlib
import copy
import functools
import json
import math
import operator

import pytest
import yaml

from companion.errors import ConfigurationError
from companion.mission.model import Mission
from rebound_cli.plan.command import mission_of_plan
from sim_vehicle.geography import Place
from tests.rebound_cli.command import run_here as rebound

HOME = Place(47.3977, 8.5456, 488.0)
# A thousandth of a degree of latitude on PX4's sphere of 6371 km.
MILLIDEGREE_M = math.radians(1e-3) * 6_371_000


def item(command, *parameters, jump_id=0, frame=3):
    return {
        "type": "SimpleItem",
        "autoContinue": True,
        "command": command,
        "doJumpId": jump_id,
        "frame": frame,
        "params": list(parameters),
    }


def waypoint(north=0.0, east=0.0, height=5.0, hold=0.0, yaw=None, **more):
    """North and east in thousandths of a degree."""
    east /= math.cos(math.radians(HOME.latitude_deg))
    place = (HOME.latitude_deg + north * 1e-3, HOME.longitude_deg + east * 1e-3)
    return item(16, hold, 0, 0, yaw, *place, height, **more)


TAKEOFF = item(22, 0, 0, 0, None, HOME.latitude_deg, HOME.longitude_deg, 5.0)


def plan(*items, fence=None, **mission):
    for number, part in enumerate(items, start=1):
        if part["type"] == "SimpleItem":
            part["doJumpId"] = number
    home = [HOME.latitude_deg, HOME.longitude_deg, HOME.altitude_m]
    return {
        "fileType": "Plan",
        "version": 1,
        "geoFence": fence or {"circles": [], "polygons": [], "version": 2},
        "mission": {"items": list(items), "plannedHomePosition": home, "version": 2, **mission},
    }


def read(*items, **more):
    data, notes = mission_of_plan(plan(*copy.deepcopy(items), **more), "t")
    return Mission.model_validate(data), data["items"], notes


@pytest.mark.parametrize(
    ("place", "position_ned_m"),
    [
        # Heights above the sea are taken from the home's
        ({"north": 0.1, "height": 7.0}, (0.1 * MILLIDEGREE_M, 0.0, -7.0)),
        ({"east": 0.1}, (0.0, 0.1 * MILLIDEGREE_M, -5.0)),
        ({"height": HOME.altitude_m + 6.0, "frame": 0}, (0.0, 0.0, -6.0)),
    ],
    ids=["north", "east", "above the sea"],
)
def test_a_place_beside_home_is_beside_the_arming_position(place, position_ned_m):
    _, items, _ = read(TAKEOFF, waypoint(yaw=90, hold=3, **place), item(20, *[0] * 7))
    assert items[1]["go_to"]["position_ned_m"] == pytest.approx(position_ned_m, abs=2e-3)
    assert items[1]["go_to"]["yaw_deg"] == 90.0
    assert items[2:] == [{"hold": {"duration_s": 3.0}}, {"return": {}}]


def test_speeds_turns_delays_and_circles():
    parts = [item(178, 1, 2.5, -1, 0, 0, 0, 0, frame=2), item(115, 45, 0, 0, 0, 0, 0, 0, frame=2)]
    circle = waypoint(north=0.1)
    circle["command"], circle["params"][:3] = 18, [2.0, 0, -4.0]
    _, items, _ = read(TAKEOFF, *parts, item(93, 4, -1, -1, -1, 0, 0, 0, frame=2), circle, item(20, *[0] * 7))
    assert items[1:4] == [
        {"set_speed": {"speed_m_s": 2.5}},
        {"set_yaw": {"yaw_deg": 45.0}},
        {"hold": {"duration_s": 4.0}},
    ]
    orbit = items[4]["orbit"]
    assert (orbit["radius_m"], orbit["turns"], orbit["clockwise"]) == (4.0, 2.0, False)


def test_a_jump_back_is_a_repeat():
    jump = item(177, 2, 3, 0, 0, 0, 0, 0, frame=2)
    mission, items, _ = read(TAKEOFF, waypoint(north=0.05), waypoint(), jump, item(20, *[0] * 7))
    assert items[1]["repeat"]["times"] == 4, "flown once and three times again"
    assert len(items[1]["repeat"]["items"]) == 2
    assert [step.name for step in mission.items] == ["takeoff", "repeat", "return"]


def test_a_landing_elsewhere_is_flown_to_first():
    _, items, _ = read(TAKEOFF, item(21, 0, 0, 0, None, HOME.latitude_deg + 1e-4, HOME.longitude_deg, 0.0))
    assert items[1]["go_to"]["position_ned_m"] == pytest.approx([0.1 * MILLIDEGREE_M, 0.0, -5.0], abs=1e-3)
    assert items[2] == {"land": {}}


def test_a_survey_is_the_items_that_it_is_made_of_without_its_camera():
    survey = {
        "type": "ComplexItem",
        "complexItemType": "survey",
        "TransectStyleComplexItem": {"Items": [waypoint(north=0.05), item(206, 25, 0, 1, 0, 0, 0, 0), waypoint()]},
    }
    mission, _, notes = read(item(530, 0, 2, None, None, None, None, None, frame=2), survey, hoverSpeed=30)
    assert [step.name for step in mission.items] == ["takeoff", "set_speed", "go_to", "go_to", "return"]
    assert mission.items[1].set_speed.speed_m_s == 12.0
    text = " ".join(notes)
    assert (
        "command 206 (DO_SET_CAM_TRIGG_DIST)" in text
        and "does not take off" in text
        and "return was put" in text
        and "12 m/s" in text
    )


def test_what_else_is_left_out_of_a_plan_is_told():
    written = plan(TAKEOFF, waypoint(), item(20, *[0] * 7))
    written["rallyPoints"] = {"points": [[HOME.latitude_deg, HOME.longitude_deg, 10.0]], "version": 2}
    text = " ".join(mission_of_plan(written, "t")[1])
    assert "left out: rally points" in text
    assert "left out" not in " ".join(read(TAKEOFF, waypoint(), item(20, *[0] * 7))[2])


@pytest.mark.parametrize(
    ("part", "words"),
    [
        (item(84, *[0] * 7), r"command 84 \(NAV_VTOL_TAKEOFF\), which a mission cannot do"),
        (item(31999, *[0] * 7), "command 31999, which a mission cannot do"),
        (item(16, 0, 0, 0, None, 47.3977, 8.5456, 5.0, frame=10), "above the terrain"),
        (item(177, 9, 1, *[0] * 5), "jumps forwards"),
        (item(177, 2, -1, *[0] * 5), "for ever"),
        (item(177, 1, 1, *[0] * 5), "repeats a take-off"),
        (item(115, 45, 0, 0, 1, 0, 0, 0), "give it a heading"),
        (
            {"type": "SimpleItem", "command": 16, "frame": 3, "params": [1]},
            "params: needs at least 7 of them, and has 1",
        ),
        ({"type": "ComplexItem", "complexItemType": "StructureScan"}, "'StructureScan', whose way"),
        ({"type": "Corridor"}, "'Corridor', whose way"),
    ],
)
def test_what_a_mission_cannot_do_is_refused_by_number(part, words):
    with pytest.raises(ConfigurationError, match=words):
        read(TAKEOFF, waypoint(), part, item(20, *[0] * 7))


def test_a_fence_keeps_its_shape():
    corners = [[HOME.latitude_deg + n * 1e-4, HOME.longitude_deg + e * 1e-4] for n, e in ((-1, -1), (2, -1), (0, 2))]
    polygon = {"circles": [], "polygons": [{"polygon": corners, "inclusion": True}]}
    mission, _, _ = read(TAKEOFF, item(20, *[0] * 7), fence=polygon)
    assert mission.fence.polygon_ne_m[1][0] == pytest.approx(0.2 * MILLIDEGREE_M, abs=1e-2)
    around_home = {"circle": {"center": [HOME.latitude_deg, HOME.longitude_deg], "radius": 40.0}, "inclusion": True}
    mission, _, _ = read(TAKEOFF, item(20, *[0] * 7), fence={"circles": [around_home], "polygons": []})
    assert (mission.fence.radius_m, mission.fence.polygon_ne_m) == (40.0, None)
    aside = {"circle": {"center": [HOME.latitude_deg + 1e-4, HOME.longitude_deg], "radius": 20.0}}
    mission, _, _ = read(TAKEOFF, item(20, *[0] * 7), fence={"circles": [aside], "polygons": []})
    assert mission.fence.contains(30.0, 0.0) and not mission.fence.contains(-10.0, 0.0)
    with pytest.raises(ConfigurationError, match="keeps out"):
        read(TAKEOFF, item(20, *[0] * 7), fence={"circles": [{**around_home, "inclusion": False}], "polygons": []})


def test_a_plan_becomes_a_mission_file_on_the_command_line(tmp_path):
    path, out = tmp_path / "round the house.plan", tmp_path / "house.yaml"
    path.write_text(json.dumps(plan(TAKEOFF, waypoint(north=0.05), item(20, *[0] * 7))))
    result = rebound("plan", "import", path, "--out", out)
    assert result.returncode == 0 and "note: the plan has no fence" in result.stderr
    assert Mission.model_validate(yaml.safe_load(out.read_text())).name == "round-the-house"
    nowhere = tmp_path / "none" / "house.yaml"
    result = rebound("plan", "import", path, "--out", nowhere)
    assert result.returncode == 1 and f"{nowhere}: cannot be written: No such file" in result.stderr
    result = rebound("plan", "export", "square")
    assert result.returncode == 1 and "'rebound plan export' is gone" in result.stderr


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ("[]", "no fileType 'Plan'"),
        ('{"fileType": "Plan", "mission": {}}', "mission.items: is missing; add it"),
        ("{", "not JSON"),
        (None, "No such file"),
    ],
)
def test_a_file_that_is_no_plan(tmp_path, text, words):
    path = tmp_path / "x.plan"
    if text is not None:
        path.write_text(text)
    result = rebound("plan", "import", path)
    assert result.returncode == 1 and words in result.stderr and "Traceback" not in result.stderr


def places_in(node, place=()):
    yield place
    for key in node if isinstance(node, dict) else range(len(node)) if isinstance(node, list) else ():
        yield from places_in(node[key], (*place, key))


@pytest.mark.parametrize(
    "wrong",
    [None, -1, "x", [], {}, math.nan, math.inf, 10**400, True],
    ids=["null", "negative", "text", "list", "object", "nan", "infinite", "huge", "true"],
)
def test_a_plan_with_any_part_of_another_kind_is_read_or_refused(wrong):
    centre = [HOME.latitude_deg, HOME.longitude_deg]
    circle = {"circle": {"center": centre, "radius": 40.0}, "inclusion": True}
    survey = {"type": "ComplexItem", "TransectStyleComplexItem": {"Items": [waypoint()]}}
    whole = plan(TAKEOFF, survey, item(177, 1, 1, *[0] * 5), fence={"circles": [circle], "polygons": []}, hoverSpeed=3)
    polygon = {"polygon": [centre, centre, centre]}
    for written in (whole, {**whole, "geoFence": {"circles": [], "polygons": [polygon]}}):
        for *way, last in filter(None, places_in(written)):
            damaged = copy.deepcopy(written)
            functools.reduce(operator.getitem, way, damaged)[last] = wrong
            with contextlib.suppress(ConfigurationError):
                mission_of_plan(damaged, "t")
