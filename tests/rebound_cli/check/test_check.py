"""`rebound check`: what it says of a mission, what it draws, and the schema that editors use."""

import functools
import json

import jsonschema
import numpy as np
import pytest
import yaml

from rebound_cli.check.legs import flown_legs
from rebound_cli.check.page import planned_flight
from rebound_cli.check.schema import mission_schema
from rebound_cli.inputs.documents import Document
from rebound_cli.inputs.inputs import mission_from, world_from
from rebound_cli.report.content import content
from tests.rebound_cli.command import ROOT, WALL, run_here
from tests.rebound_cli.report.test_page import Opened

SCHEMA = ROOT / "missions" / "schema.json"
MISSIONS = sorted((ROOT / "missions").glob("*.yaml"))


@functools.cache
def validator():
    schema = mission_schema()
    kind = jsonschema.validators.validator_for(schema)
    kind.check_schema(schema)
    return kind(schema)


def go_to(*place_ned_m, **more):
    return {"go_to": {"position_ned_m": list(place_ned_m), **more}}


def planned(*items, **keys):
    """A mission that takes off to 2 m, does this and lands; its world; its legs."""
    data = {"name": "t", "items": [{"takeoff": {"height_m": 2}}, *items, {"land": {}}], **keys}
    document = Document("t.yaml", data)
    world = world_from(document)
    mission = mission_from(document, world)
    return mission, world, flown_legs(mission, world)


def test_what_stands_in_the_way_is_named_with_the_place():
    wall = {"name": "far wall", "point_ned_m": [4, 0, -2], "normal_ned": [-1, 0, 0], "width_m": 4, "height_m": 2}
    pole = {"name": "mast", "point_ned_m": [6, 0, -4]}
    *_, legs = planned(go_to(6, 0, -2), go_to(6, 0, -5), sim={"walls": [wall], "poles": [pole]})
    assert [flown.meets.name if flown.meets else None for flown in legs] == [None, "far wall", "mast", "mast"]
    # a reach before the wall
    assert legs[1].points_ned_m[legs[1].meets.index][0] == pytest.approx(3.8, abs=0.15)


def test_what_moves_is_in_the_way_wherever_it_comes_by():
    # Given a cart that comes 10 m north, stops, and goes 6 m east; a way across its own, one behind it, one before it
    stops = ((5, [0, 0, 0]), (15, [10, 0, 0]), (30, [10, 6, 0]))
    path = [{"at_s": at_s, "offset_ned_m": offset_m} for at_s, offset_m in stops]
    cart = {"name": "cart", "centre_ned_m": [-10, 2, -2], "size_m": [1, 1, 1], "motion": {"path": path}}
    ways = [go_to(0, 8, -2), go_to(-14, 8, -2), go_to(-14, 2, -2), go_to(0, 2, -2)]
    *_, legs = planned(*ways, fence={"radius_m": 20}, sim={"boxes": [cart]})
    met = [flown.meets and flown.meets.moves and flown.points_ned_m[flown.meets.index] for flown in legs]
    assert met[0] is None and met[3] is None
    # its western side is met on the way east, the end of its way, and its southern side where it stands at first
    assert met[1][1] == pytest.approx(1.5 - 0.2, abs=0.15) and met[2][0] == 0.0
    assert met[4][0] == pytest.approx(-10.5 - 0.2, abs=0.15)


def test_a_page_shows_the_way_in_the_world_and_what_moves_in_it_from_arming_on():
    # Given a start beside the world's origin, an obstacle that moves, and a patch that an earlier flight has found
    patch = {"touches_ned_m": [[3, 1, -1]], "normal_ned": [0, -1, 0], "found_at_us": 9_000_000_000}
    motion = {"velocity_ned_m_s": [1.5, 0.5, 0], "from_s": 12, "until_s": 14}
    cart = {"name": "cart", "centre_ned_m": [-5, 0, -2], "size_m": [0.6, 1, 1], "motion": motion}
    mission, world, legs = planned(
        go_to(4, 0, -2, speed_m_s=2),
        {"wait_for": {"file": "go"}},
        obstacles={"known": [patch]},
        sim={"start": {"position_ned_m": [1, 2, 0]}, "boxes": [cart]},
    )
    flight = planned_flight(mission, world, legs)
    shown, log, stands_m = content(flight), flight.log, world.airframe.geometry.foot_depth_m
    seconds = flight.seconds(log.position_at_us)
    # up at 1 m/s and 1 m/s^2 in 3 s; 4 m at 2 m/s, speeding up with 1 m/s^2 and braking with 2, in 3.5 s; a wait that
    # is drawn for 5 s, for nobody knows how long it is, and down where it is
    assert legs[-1].begins_s is legs[-1].ends_s is None
    assert np.interp([0.0, 3.0, 6.5, 11.5], seconds, log.position_ned_m[:, 0]) == pytest.approx([1, 1, 5, 5], abs=1e-6)
    assert np.interp([0.0, 3.0, 11.5], seconds, -log.position_ned_m[:, 2]) == pytest.approx(
        [stands_m, 2 + stands_m, 2 + stands_m], abs=1e-6
    )
    assert log.position_ned_m[-1] == pytest.approx([5, 2, -stands_m]) and max(log.velocity_ned_m_s[:, 0]) > 1.9
    (cart,), (known,) = shown["obstacles"], shown["surfaces"]
    assert cart["motion"]["t"] == [12.0, 14.0] and cart["motion"]["offsets"][-1] == pytest.approx([3.0, 1.0, 0.0])
    assert np.mean(known["corners"], axis=0)[1] == pytest.approx(3.0)


def test_a_person_reads_what_would_be_flown(tmp_path):
    result = run_here("check", WALL, "--out", tmp_path)
    assert result.returncode == 0, result.stderr
    for words in ("go to [7.00, 0.00, -1.50]", "7.0 m", "meets 'north wall'", "in all 15.5 m in 21 s", "Fence"):
        assert words in result.stdout
    page = Opened((tmp_path / "wall.html").read_text())
    assert [name for _, name in page.data["modes"]][1] == "2 go to [7.00, 0.00, -1.50] at 2 m/s, heading 0 deg"
    assert [event["text"] for event in page.data["events"] if event["kind"] == "meets"] == ["north wall", "north wall"]
    assert len(page.table("path")["t"]) > 100


def test_neither_a_wrong_file_nor_a_page_that_cannot_be_written_hides_another_mission(tmp_path):
    wrong = tmp_path / "wrong.yaml"
    wrong.write_text("name: wrong\nitems:\n  - takeoff: {height: 1}\n  - land:\n")
    result = run_here("check", wrong, WALL, "--no-picture", "--set", "on_interrupt=land")
    assert result.returncode == 1
    assert f"{wrong}:3: items.0.takeoff.height: unknown key" in result.stderr and "Traceback" not in result.stderr
    assert "hand the vehicle to land" in result.stdout
    assert run_here("check").returncode == 1
    assert "no airframe is called 'none'" in run_here("check", WALL, "--airframe", "none").stderr
    # Given a file where the folder of the pages is to be, both missions are told, and both pages that nobody has
    result = run_here("check", WALL, ROOT / "missions" / "square.yaml", "--out", wrong)
    assert result.returncode == 1 and "in all 15.5 m" in result.stdout and "square:" in result.stdout
    assert [line.endswith("cannot be written: File exists.") for line in result.stderr.splitlines()] == [True, True]
    # Given two of one name, the page is the first one's
    (twin := tmp_path / "twin.yaml").write_text((ROOT / WALL).read_text())
    result = run_here("check", WALL, twin, "--out", tmp_path / "pages")
    assert result.returncode == 1 and f"{twin} has the name of {WALL}, 'wall'" in result.stderr


# --- the schema


def test_the_schema_beside_the_missions_is_the_models():
    assert json.loads(SCHEMA.read_text()) == mission_schema(), "run `make schema`"


@pytest.mark.parametrize("path", MISSIONS, ids=lambda path: path.stem)
def test_every_shipped_mission_names_the_schema_and_keeps_to_it(path):
    text = path.read_text()
    assert text.startswith("# yaml-language-server: $schema=schema.json\n")
    validator().validate(yaml.safe_load(text))


@pytest.mark.parametrize(
    "changes",
    [
        # Of the whole mission, and of an item
        {"items": [{"hold": {"duration_s": 1}}, {"land": None}]},
        {"companion": {"detector": "fuse"}},
        {"go_to": {"position_ned_m": [1, 2, 3], "sped_m_s": 1}},
        {"hold": {"duration_s": 1}, "land": {}},
        {"on_collision": {"then": "hold"}},
        {"expect": {}},
        {"wait_for": {"hit": True, "flight_time_s": 3}},
        {"hold": {"duration_s": 1}, "on_timeout": "land"},
    ],
)
def test_the_schema_refuses_what_the_model_refuses(changes):
    sound = {"name": "t", "items": [{"takeoff": {"height_m": 1}}, {"land": None}]}
    validator().validate(sound)
    if not changes.keys() <= {"items", "companion"}:
        changes = {"items": [sound["items"][0], changes, sound["items"][1]]}
    with pytest.raises(jsonschema.ValidationError):
        validator().validate({**sound, **changes})


def test_an_editor_has_a_word_for_every_key_of_a_mission():
    """But for the numbers of detectors and faults, which nobody writes without the documents."""
    schema = mission_schema()
    parts = {"Mission": schema, **schema["$defs"]}
    detectors = schema["$defs"]["CompanionConfig"]["properties"]["detector"]["enum"]
    own = {f"{name.capitalize()}Config" for name in detectors} | {"StreamHealthConfig"}
    wordless = [
        f"{name}.{key}"
        for name, part in parts.items()
        for key, written in part.get("properties", {}).items()
        if name not in own and "kind" not in part["properties"] and "description" not in written
    ]
    assert wordless == []
