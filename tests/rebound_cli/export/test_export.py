"""A flight as MCAP, read back by the format's own reader."""

import json
import math
from dataclasses import replace
from io import BytesIO

import jsonschema
import pytest
from mcap.reader import make_reader

from companion.messages import GlobalPosition, LocalPosition
from rebound_cli.export.foxglove import write_mcap
from rebound_cli.logs.log import LoggedSample
from rebound_cli.logs.reader import read_telemetry
from rebound_cli.main import main
from tests.docs.pages import ROOT

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
        if channel.topic not in seen:
            jsonschema.validate(data, json.loads(schema.data))
            seen.add(channel.topic)
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
    assert schemas["/log"] == "foxglove.Log"
    assert len(topics["/imu"]) == len(log.imu())
    assert [data["text"] for _, _, data in topics["/event"]] == [event["text"] for event in shown.events]
    assert [data["kind"] for _, _, data in topics["/hit"]] == ["wall", "landing"]
    # with how near to a hit each sample and velocity was: the wall and the ground, none between them
    ratios = [data for topic in ("force", "velocity") for _, _, data in topics[f"/test_ratio/{topic}"]]
    assert len(topics["/test_ratio/force"]) == len(shown.findings.listener.forces.all().phase)
    assert max(data.get("side", 0.0) for data in ratios) > 1.0
    assert 0.0 <= max(data.get("jump", 0.0) for data in ratios) < 1.0
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
    assert set(layout["configById"]["3D!flight"]["topics"]) <= set(topics)
