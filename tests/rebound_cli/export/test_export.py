"""A flight as MCAP, read back by the format's own reader."""

import json
import math
from dataclasses import replace
from io import BytesIO

import jsonschema
import pytest
from mcap.reader import make_reader

from companion.messages import GlobalPosition, ImuSample, LocalPosition
from rebound_cli.export.foxglove import boot_us, write_mcap
from rebound_cli.logs.log import LoggedSample
from rebound_cli.logs.reader import read_telemetry
from rebound_cli.main import main
from rebound_cli.replay.watching import Findings
from sim_vehicle.scene import Scene
from tests.docs.pages import ROOT
from tests.rebound_cli.logs.ulog_file import every

SIDE = math.sqrt(0.5)


@pytest.fixture(scope="module")
def flight(wall, wall_folder):
    return wall, read_telemetry(wall_folder / "flight.tlog")


@pytest.fixture(scope="module")
def topics(wall_folder, tmp_path_factory):
    """Of the file as the command writes it."""
    out = tmp_path_factory.mktemp("exported") / "wall.mcap"
    assert main(["logs", "export", str(wall_folder), "--format", "mcap", "--out", str(out)]) == 0
    return read_mcap(out.read_bytes())


def read_mcap(content):
    """Each message by its topic; one of each kind is held against the schema that the file itself gives it."""
    topics, seen = {}, set()
    for schema, channel, read in make_reader(BytesIO(content), validate_crcs=True).iter_messages():
        data = json.loads(read.data)
        kind = (channel.topic, *(entity["id"] for entity in data.get("entities", ())))
        if kind not in seen:
            jsonschema.validate(data, json.loads(schema.data))
            seen.add(kind)
        topics.setdefault(channel.topic, []).append((schema.name, read.log_time, data))
    return topics


def mcap_of(flight, log):
    content = BytesIO()
    write_mcap(replace(flight, truth=None), log, content)
    return read_mcap(content.getvalue())


def test_foxglove_gets_its_own_schemas_and_all_that_was_heard_and_decided(topics, flight):
    shown, log = flight
    schemas = {topic: rows[0][0] for topic, rows in topics.items()}
    assert schemas["/pose"] == schemas["/truth"] == "foxglove.PoseInFrame"
    assert schemas["/scene"] == "foxglove.SceneUpdate" and schemas["/log"] == "foxglove.Log"
    assert len(topics["/imu"]) == len(log.imu())
    assert [data["text"] for _, _, data in topics["/event"]] == [event["text"] for event in shown.events]
    assert [data["kind"] for _, _, data in topics["/hit"]] == ["wall", "landing"]
    # At the companion's own times, in nanoseconds
    assert [at_ns for _, at_ns, _ in topics["/imu"]] == [at_us * 1000 for at_us, _ in log.imu()]
    # and the truth as often as the vehicle says where it is, by the same clock
    truth = {at_ns: data["pose"]["position"] for _, at_ns, data in topics["/truth"]}
    for _, at_ns, data in topics["/pose"]:
        if at_ns in truth:
            assert math.dist(truth[at_ns].values(), data["pose"]["position"].values()) < 0.3
    assert len(truth.keys() & {at_ns for _, at_ns, _ in topics["/pose"]}) > 0.9 * len(topics["/pose"])
    levels = {data["message"][:9]: data["level"] for _, _, data in topics["/log"]}
    assert levels["detection"] == 3 and levels["takeoff: "] == 2


@pytest.mark.parametrize(
    ("attitude_frd_to_ned", "flu_to_enu"),
    [
        # Nose north is a quarter of a turn from east; nose east none; a right wing down is a positive roll in both
        ((1.0, 0.0, 0.0, 0.0), (SIDE, 0.0, 0.0, SIDE)),
        ((SIDE, 0.0, 0.0, SIDE), (1.0, 0.0, 0.0, 0.0)),
        ((0.5, 0.5, 0.5, 0.5), (SIDE, SIDE, 0.0, 0.0)),
        # Nose north and up: about the left axis it is a negative turn
        ((SIDE, 0.0, SIDE, 0.0), (0.5, 0.5, -0.5, 0.5)),
    ],
)
def test_a_pose_turns_from_ned_and_frd_to_enu_and_flu(flight, attitude_frd_to_ned, flu_to_enu):
    shown, log = flight
    moved = LocalPosition(1_000_000, (3.0, 2.0, -1.0), (0.0, 0.0, 0.0))
    attitude = next(h for h in log.heard if type(h.sample).__name__ == "Attitude")
    heard = (replace(attitude, sample=replace(attitude.sample, attitude_wxyz=attitude_frd_to_ned)),)
    imu, end_us = LoggedSample(*log.imu()[0]), log.heard[-1].at_us
    here = LoggedSample(end_us, GlobalPosition(47.397742, 8.545594, 488.0))
    topics = mcap_of(shown, replace(log, heard=(imu, *heard, LoggedSample(end_us, moved), here)))
    ((_, _, found),) = topics["/pose"]
    assert found["pose"]["position"] == {"x": 2.0, "y": 3.0, "z": 1.0}
    assert [found["pose"]["orientation"][axis] for axis in "wxyz"] == pytest.approx(flu_to_enu)
    # and a position on Earth becomes a fix
    ((schema, _, fix),) = topics["/location"]
    assert schema == "foxglove.LocationFix"
    assert (fix["latitude"], fix["longitude"], fix["altitude"]) == (47.397742, 8.545594, 488.0)


def test_the_scene_has_each_obstacle_where_it_is_and_what_moves_goes_on(flight):
    # Given a wall that faces south at 4 m north, a slanted pole, and a box that goes 2 m east between 5 and 15 s
    shown, log = flight
    box = {"centre_ned_m": [2, 0, -1], "size_m": [1, 2, 3], "name": "cart"}
    motion = {"velocity_ned_m_s": [0, 0.2, 0], "from_s": 5, "until_s": 15}
    scene = Scene.model_validate(
        {
            "walls": [{"point_ned_m": [4, 0, -2], "normal_ned": [-1, 0, 0], "width_m": 6, "height_m": 4}],
            "poles": [{"point_ned_m": [0, 5, 0], "axis_ned": [0, 1, 0], "height_m": 2, "radius_m": 0.1}],
            "boxes": [{**box, "motion": motion}],
        }
    )
    topics = mcap_of(replace(shown, scene=scene), log)
    drawn = {}
    for at_ns, entity in entities_of(topics["/scene"] + topics["/scene/moving"]):
        drawn.setdefault(entity["id"], []).append((at_ns, entity))
    names = [obstacle.name for _, obstacle in scene.obstacles()]
    ((_, wall),), ((_, pole),), cart = (drawn[f"obstacle {name}"] for name in names)
    # Then a wall of 6 by 4 m is a thin plate just north of its face
    (cube,) = wall["cubes"]
    assert cube["pose"]["position"]["y"] == pytest.approx(4.0 + 0.5 * cube["size"]["x"])
    assert sorted(cube["size"].values())[1:] == [4.0, 6.0]
    # and the bar that lies to the east has Foxglove's z axis along x
    (bar,) = pole["cylinders"]
    assert bar["pose"]["position"] == pytest.approx({"x": 6.0, "y": 0.0, "z": 0.0})
    turned = bar["pose"]["orientation"]
    assert 2 * (turned["x"] * turned["z"] + turned["w"] * turned["y"]) == pytest.approx(1.0)
    # and the cart's way is that of the vehicle's clock
    began_ns = (log.heard[0].at_us - boot_us(log, [log.heard[0].at_us])[0]) * 1000
    east = {round((at_ns - began_ns) * 1e-9, 2): e["cubes"][0]["pose"]["position"]["x"] for at_ns, e in cart}
    assert east[min(east)] == 0.0 and east[max(east)] == 2.0
    assert min(abs(place - 1.0) for at_s, place in east.items() if abs(at_s - 10.0) < 0.05) < 0.01


def test_the_latest_message_of_a_topic_draws_all_of_it(flight):
    # Foxglove gives whoever jumps to a time no more than that: given two walls, two carts, two hits, a surface touched
    # twice
    shown, log = flight
    walls = [{"point_ned_m": [n, 0, -2], "normal_ned": [-1, 0, 0]} for n in (4, 9)]
    cart = {"size_m": [1, 2, 3], "motion": {"velocity_ned_m_s": [0, 0.2, 0], "from_s": 5, "until_s": 15}}
    carts = [{**cart, "centre_ned_m": [2, e, -1], "name": f"cart {e}"} for e in (1, 3)]
    scene = Scene.model_validate({"walls": walls, "boxes": carts})
    (hit,) = shown.findings.collisions
    findings = Findings([hit, replace(hit, at_us=hit.at_us + 1_000_000)])
    told = next(event for event in shown.events if event["kind"] == "obstacle")
    events = [*shown.events, {**told, "time_us": told["time_us"] + 1_000_000}]
    topics = mcap_of(replace(shown, scene=scene, findings=findings, events=events), log)
    latest = {
        topic: [entity["id"] for entity in rows[-1][2]["entities"]]
        for topic, rows in topics.items()
        if "/scene" in topic
    }
    obstacles = [f"obstacle {obstacle.name}" for _, obstacle in scene.obstacles()]
    assert latest["/scene"] == ["vehicle", *obstacles[:2]] and latest["/scene/moving"] == obstacles[2:]
    assert latest["/scene/hits"] == ["hit 1", "hit 2"] and latest["/scene/surfaces"] == ["surface 1", "surface 2"]
    # and what is told again is what was told before: a hit stands where it was, a surface ends when it is known better
    for name in ("hits", "surfaces"):
        found = {}
        for _, entity in entities_of(topics[f"/scene/{name}"]):
            assert found.setdefault(entity["id"], entity) == entity
    first, second = topics["/scene/surfaces"][-1][2]["entities"]
    assert first["lifetime"] == {"sec": 1, "nsec": 0} and second["lifetime"] == {"sec": 0, "nsec": 0}


def entities_of(rows):
    return [(at_ns, entity) for _, at_ns, data in rows for entity in data["entities"]]


def test_an_event_stands_at_the_newest_sample_that_was_heard_by_then(flight):
    # Given samples that came 3 ms after their stamps, a gap, and a time 5 ms after the newest
    _, log = flight
    times_us = list(every(4000, 1_000_000, 1_100_000))
    force, still = (0.0, 0.0, -9.8), (0.0, 0.0, 0.0)
    heard = tuple(LoggedSample(time_us + 500_003_000, ImuSample(time_us, force, still)) for time_us in times_us)
    assert boot_us(replace(log, heard=heard), [heard[-1].at_us + 5000]).tolist() == [times_us[-1] + 5000]


def test_a_ulog_is_answered_by_what_reads_the_same(capsys):
    with pytest.raises(SystemExit):
        main(["logs", "export", "--format", "ulg"])
    assert "ulg is gone: give mcap, which Foxglove and PlotJuggler read" in capsys.readouterr().err


def values_of(data):
    if isinstance(data, dict):
        yield from (one for key, value in data.items() for one in ([value] if key == "value" else values_of(value)))
    elif isinstance(data, list):
        yield from (one for value in data for one in values_of(value))


def test_every_path_of_foxgloves_layout_is_in_the_file(topics):
    layout = json.loads((ROOT / "examples" / "foxglove-layout.json").read_text())
    paths = list(values_of(layout["configById"]))
    assert len(paths) > 10
    for path in paths:
        topic, _, field = path.partition(".")
        name, _, index = field.partition("[")
        value = topics[topic][0][2][name]
        assert not index or isinstance(value[int(index.rstrip("]"))], float), path
    assert set(layout["configById"]["3D!flight"]["topics"]) <= set(topics) | {"/scene/moving"}
