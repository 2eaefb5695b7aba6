"""A flight as MCAP and as ULog, read back by the formats' own readers."""

import json
import math
import xml.etree.ElementTree
from dataclasses import replace
from io import BytesIO

import jsonschema
import numpy as np
import pytest
from mcap.reader import make_reader
from pyulog import ULog

from companion.messages import Attitude, GlobalPosition, Heartbeat, ImuSample, LocalPosition, Sticks
from rebound_cli.export.foxglove import write_mcap
from rebound_cli.export.ulog import boot_us, new_ulog
from rebound_cli.logs.log import LoggedSample
from rebound_cli.logs.reader import read_log, read_telemetry
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
def exported(wall_folder, tmp_path_factory):
    """Both files, as the command writes them."""
    out = tmp_path_factory.mktemp("exported")
    for kind in ("mcap", "ulg"):
        assert main(["logs", "export", str(wall_folder), "--format", kind, "--out", str(out / f"wall.{kind}")]) == 0
    return out


@pytest.fixture(scope="module")
def topics(exported):
    return read_mcap((exported / "wall.mcap").read_bytes())


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


def ulog_of(flight, log):
    return ULog(BytesIO(new_ulog(replace(flight, truth=None), log)))


# --- MCAP -------------------------------------------------------------------------------------------------------


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


# --- ULog -------------------------------------------------------------------------------------------------------


def test_a_ulog_is_read_back_by_pyulog_and_searched_as_px4s_own(exported, flight, tmp_path, capsys):
    shown, log = flight
    written = ULog(str(exported / "wall.ulg"))
    assert not written.file_corruption and written.initial_parameters == {"MAV_TYPE": 2}
    said = [one.message for one in written.logged_messages]
    assert all(f"[rebound] {event['text']}" in said for event in shown.events)
    hit = written.get_dataset("rebound_hit").data
    (finding,) = shown.hits
    # The touchdown is in it, too
    assert hit["timestamp"][0] == finding.first.impact.sample_time_boot_us
    assert hit["is_collision"].tolist() == [1, 0]
    assert hit["impact_velocity_m_s[0]"][0] == pytest.approx(finding.first.velocity_ned_m_s[0], abs=1e-4)
    # Every IMU sample again, at its own stamp
    again = [sample for _, sample in read_log(exported / "wall.ulg").imu()]
    for ours, theirs in zip([sample for _, sample in log.imu()], again, strict=True):
        assert theirs.time_boot_us == ours.time_boot_us
        assert theirs.specific_force_frd_m_s2 == pytest.approx(ours.specific_force_frd_m_s2, rel=1e-6, abs=1e-6)
    # and the same hit is found in it
    assert main(["replay", str(exported / "wall.ulg"), "--expect", "1", "--out", str(tmp_path)]) == 0
    assert "HIT: wall" in capsys.readouterr().out


def test_a_ulog_has_what_flight_review_draws_beside_the_path(exported, flight):
    # Flight Review takes distance and speeds from places that are valid, angular rates from a topic of their own
    _, log = flight
    written = ULog(str(exported / "wall.ulg"))
    path = written.get_dataset("vehicle_local_position").data
    assert all(path[field].all() for field in ("xy_valid", "z_valid", "v_xy_valid", "v_z_valid"))
    turning = written.get_dataset("vehicle_angular_velocity").data
    told = [heard.sample for heard in log.heard if isinstance(heard.sample, Attitude)]
    assert turning["xyz[1]"] == pytest.approx([sample.angular_velocity_frd_rad_s[1] for sample in told])
    # A thrust that carries the vehicle points up, which is against body z
    assert -1.0 <= written.get_dataset("vehicle_attitude_setpoint").data["thrust_body[2]"].min() < -0.5
    # motors that turn in the air alone, and a battery that is less full than it was
    motors = written.get_dataset("actuator_outputs").data
    in_air = (motors["timestamp"] > 10e6) & (motors["timestamp"] < 20e6)
    assert motors["output[3]"][in_air].min() > motors["output[3]"][0] and set(motors["noutputs"]) == {4}
    charge = written.get_dataset("battery_status").data["remaining"]
    assert charge[0] == pytest.approx(1.0) and 0.0 < charge.min() < 0.9
    # The simulator's truth is PX4's ground truth, at the same times and near the estimate
    truth = written.get_dataset("vehicle_local_position_groundtruth").data
    assert np.abs(np.interp(path["timestamp"], truth["timestamp"], truth["x"]) - path["x"]).max() < 0.3
    turned = written.get_dataset("vehicle_attitude_groundtruth").data
    assert len(turned["q[0]"]) == len(truth["x"]) == pytest.approx(len(path["x"]), rel=0.1)


def test_a_mode_of_the_ulog_begins_when_it_was_told(exported, flight):
    shown, log = flight
    modes = ULog(str(exported / "wall.ulg")).get_dataset("vehicle_status").list_value_changes("nav_state")
    # AUTO.LOITER, OFFBOARD, AUTO.LAND, each when the companion heard of it, and OFFBOARD again on the ground
    assert [state for _, state in modes] == [4, 14, 18, 14]
    events = [event["time_us"] for event in shown.events if event["kind"] == "mode"]
    assert [at_us for at_us, _ in modes[:3]] == boot_us(log, events[:3]).tolist()


@pytest.mark.parametrize(
    ("main", "sub", "nav_state"),
    [(4, 11, 23), (4, 18, 30), (4, 10, 22), (3, 2, 6), (3, 1, 21), (11, 0, 8), (10, 0, 13), (4, 7, 31), (99, 0, 31)],
)
def test_each_mode_of_px4s_has_its_state_and_no_other_passes_for_manual(flight, main, sub, nav_state):
    shown, log = flight
    beat = next(heard for heard in log.heard if isinstance(heard.sample, Heartbeat))
    # Given a vehicle that calls its state critical
    strange = replace(beat, sample=replace(beat.sample, custom_mode=main << 16 | sub << 24, system_status=5))
    sticks = LoggedSample(beat.at_us, Sticks((0.1, 0.2, 0.3, 0.4)))
    written = ulog_of(shown, replace(log, heard=(LoggedSample(*log.imu()[0]), strange, sticks)))
    status = written.get_dataset("vehicle_status").data
    assert (status["nav_state"].tolist(), status["failsafe"].tolist()) == ([nav_state], [1])
    # And the pilot who pushes forward, right, up and clockwise
    pushed = written.get_dataset("manual_control_setpoint").data
    assert [pushed[axis][0] for axis in ("pitch", "roll", "throttle", "yaw")] == pytest.approx([0.1, 0.2, 0.3, 0.4])


def test_places_are_not_left_out_of_a_file_full_of_them(wall_folder, tmp_path, capsys):
    out = tmp_path / "wall.mcap"
    words = ["logs", "export", str(wall_folder), "--format", "mcap", "--no-position", "--out", str(out)]
    assert main(words) == 1
    assert "--no-position" in capsys.readouterr().err and not out.exists()


def test_an_event_stands_at_the_newest_sample_that_was_heard_by_then(flight):
    # Given samples that came 3 ms after their stamps, a gap, and a time 5 ms after the newest
    _, log = flight
    times_us = list(every(4000, 1_000_000, 1_100_000))
    force, still = (0.0, 0.0, -9.8), (0.0, 0.0, 0.0)
    heard = tuple(LoggedSample(time_us + 500_003_000, ImuSample(time_us, force, still)) for time_us in times_us)
    assert boot_us(replace(log, heard=heard), [heard[-1].at_us + 5000]).tolist() == [times_us[-1] + 5000]


# --- layouts ----------------------------------------------------------------------------------------------------


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


def test_every_curve_of_plotjugglers_layout_is_in_the_file(exported):
    root = xml.etree.ElementTree.parse(ROOT / "examples" / "plotjuggler-layout.xml")
    curves = [curve.attrib["name"] for curve in root.iter("curve")]
    assert len(curves) > 10
    written = ULog(str(exported / "wall.ulg"))
    fields = {f"{data.name}/{name.replace('[', '.0').rstrip(']')}" for data in written.data_list for name in data.data}
    assert set(curves) <= fields
