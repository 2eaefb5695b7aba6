"""What a flight leaves: its folder, its ending, detections beside contacts (docs/reference/summary.md), and an MCAP."""

import json
import math
import os
from dataclasses import replace
from io import BytesIO
from types import SimpleNamespace
from typing import Any

import jsonschema
import numpy as np
import pytest
from mcap.reader import make_reader

from companion.messages import GpsFix, LocalPosition
from rebound_cli.export.foxglove import write_mcap
from rebound_cli.logs.log import LoggedSample
from rebound_cli.logs.reader import read_telemetry
from rebound_cli.main import main
from rebound_cli.report.content import heard_at_us
from rebound_cli.results.ending import ending_text
from rebound_cli.results.run_folder import TLOG_NAME, RunFolderError, check_place
from rebound_cli.results.summary import Flown, build_summary
from rebound_cli.results.truth_match import FlightTruth, match_contacts
from rebound_cli.simulation import compiling
from tests.bench.random_missions import made_up
from tests.bench.random_missions.made_up import EPOCH_US
from tests.docs.pages import ROOT
from tests.rebound_cli.command import WALL


@pytest.mark.parametrize("command", [("fly", str(WALL), "--lockstep"), ("guard", "--connect", "udpin://127.0.0.1:0")])
def test_a_folder_below_a_file_or_with_a_flight_is_refused_at_once(command, tmp_path, capsys, monkeypatch):
    # Minutes of compiling are too many for a flight that cannot be kept
    monkeypatch.setattr(compiling, "prepare_vehicle", lambda *_: pytest.fail("compiles"))
    (tmp_path / TLOG_NAME).write_bytes(b"")
    assert main([*command, "--out", str(tmp_path / TLOG_NAME / "run")]) == 1
    assert f"run cannot be made: nothing can be written to {tmp_path / TLOG_NAME}." in capsys.readouterr().err
    for folder in (tmp_path, tmp_path / "new" / ".."):
        assert main([*command, "--out", str(folder)]) == 1
        assert "already holds a flight" in capsys.readouterr().err
    # Nor does a flight take the place of what a person may have written
    for name in ("airframe.yaml", "guard.yaml"):
        (tmp_path / name / name).mkdir(parents=True)
        assert main([*command, "--out", str(tmp_path / name)]) == 1
        assert f"{name} already holds {name}: give" in capsys.readouterr().err


def test_a_flight_takes_no_other_missions_place(tmp_path, capsys):
    (tmp_path / "mission.yaml").write_text("mine")
    assert main(["fly", str(WALL), "--lockstep", "--out", str(tmp_path)]) == 78
    assert "mission.yaml is another mission: give --out another folder." in capsys.readouterr().err
    assert (tmp_path / "mission.yaml").read_text() == "mine"


def test_a_folder_that_nobody_may_write_to_is_refused(tmp_path, monkeypatch):
    # Root may write everywhere.
    monkeypatch.setattr(os, "access", lambda place, _: place != tmp_path)
    with pytest.raises(RunFolderError, match=f"nothing can be written to {tmp_path}"):
        check_place(tmp_path / "run")


def test_a_real_vehicle_is_told_of_by_its_telemetry_alone_and_of_one_that_failed_no_landing_is_claimed(wall_folder):
    summary = json.loads((wall_folder / "summary.json").read_text())
    (hit,) = summary["collisions"]
    known = hit | {"impact_speed_m_s": 1.98, "settled_after_s": 1.728, "stopped_off_m": 0.53, "truth": None}
    unknown = dict.fromkeys(("false_detections", "missed_contacts", "recontacts", "airframe", "seed"))
    _, _, told, *_ = ending_text(summary | unknown | {"collisions": [known]}).splitlines()
    assert told == "Hit something at 1.98 m/s. Stopped 0.5 m off it in 1.7 s, landed safely."
    # Given a flight that was aborted in its second recovery, with a false alarm and a contact that nobody saw
    wrong = {"outcome": "aborted", "false_detections": 1, "missed_contacts": 2, "recontacts": 1}
    hits = [hit | {"truth": None}, hit | {"settled_after_s": None}]
    _, _, *lines = ending_text(summary | wrong | {"collisions": hits}).splitlines()
    # Then each is a sentence
    assert lines[0] == "1. False alarm: no new contact."
    assert "Not yet still when the flight went on" in lines[1]
    assert "2 hits not seen." in lines
    assert "1 hit before the vehicle had recovered from the one before." in lines
    assert not any("afely" in line for line in lines)


SETTLED_S = 0.5


def hit(start_ms, end_ms=None):
    ended_us = 1e3 * (end_ms if end_ms is not None else start_ms + 30)
    made = made_up.hit(1e-3 * start_ms, place=(3.8, 0.0, -1.5))
    return replace(made, ended_at_boot_us=ended_us, rebound_velocity_ned_m_s=(-0.3, 0.0, 0.1))


def collision(sample_ms, settled_after_s=2.0):
    made = made_up.collision(1e-3 * sample_ms, (2.8, 0.0, -1.5), settled_after_s)
    return replace(made, detected_at_us=made.detected_at_us + 500)


@pytest.mark.parametrize(
    ("collisions", "hits", "expected"),
    [
        pytest.param([collision(10_004)], [hit(10_000)], (0, 0, 0), id="seen"),
        pytest.param([collision(9_996)], [hit(10_000)], (1, 1, 0), id="a sample that ends before contact is false"),
        pytest.param([collision(10_128)], [hit(10_000, 10_030)], (0, 0, 0), id="velocities just after may show it"),
        pytest.param([collision(10_132)], [hit(10_000, 10_030)], (1, 1, 0), id="a sample long after is false"),
        pytest.param([collision(10_004), collision(10_020)], [hit(10_000)], (1, 0, 0), id="one contact, one detection"),
        pytest.param([], [hit(10_000)], (0, 1, 0), id="missed"),
        pytest.param([], [hit(10_000), hit(10_500)], (0, 2, 1), id="after a missed contact the next is a recontact"),
        pytest.param(
            [collision(10_004, None), collision(10_504)], [hit(10_000), hit(10_500)], (0, 0, 1), id="before recovery"
        ),
        pytest.param(
            [collision(10_004, 2.0), collision(12_404)], [hit(10_000), hit(12_400)], (0, 0, 1), id="not yet called"
        ),
        pytest.param(
            [collision(10_004, 2.0), collision(12_604)], [hit(10_000), hit(12_600)], (0, 0, 0), id="after recovery"
        ),
    ],
)
def test_what_counts(collisions, hits, expected):
    matches = match_contacts(collisions, FlightTruth(hits, {}, EPOCH_US), SETTLED_S)
    assert (matches.false_detections, matches.missed_contacts, matches.recontacts) == expected


def test_a_contact_is_found_by_the_times_that_a_vehicle_told_whose_clock_had_jumped():
    truth = FlightTruth([hit(5_000), hit(10_000)], {}, EPOCH_US, jumps=[(9_000_000, 100_000_000)])
    matches = match_contacts([collision(5_004), collision(110_004)], truth, SETTLED_S)
    assert matches.hit_of_collision == tuple(truth.hits) and matches.recontacts == 0


def path_of(rows):
    times_s, north_m, down_m = np.array(rows, dtype=float).T
    position = np.column_stack([north_m, np.zeros(len(rows)), down_m])
    return {"time_boot_us": 1e6 * times_s, "position_ned_m": position}


FACTS = (SETTLED_S, "wall", "foldable", 3)


def test_the_summary_measures_overshoot_and_height_away_from_the_wall():
    # Given a flight whose path passes the setpoint at 2.8 m north by 4 cm and sinks by 3 cm before it is recovered
    path = path_of([(9.9, 3.7, -1.6), (10.0, 3.8, -1.5), (11.0, 3.0, -1.47), (12.0, 2.76, -1.5), (12.6, 2.0, -1.0)])
    truth = FlightTruth([hit(10_000)], path, EPOCH_US)
    # When it is summed up, of a companion that began a second later than the vehicle
    report = replace(made_up.report(collision(10_004)), started_at_us=EPOCH_US + 1_000_000)
    summary = build_summary(Flown(report, 0.5, truth), *FACTS)
    # Then what came after the recovery does not count, and times are seconds since the start
    entry = summary["collisions"][0]
    assert entry["truth"]["overshoot_m"] == pytest.approx(0.04)
    assert entry["truth"]["height_lost_m"] == pytest.approx(0.03)
    assert entry["truth"]["contact_at_s"] == pytest.approx(9.0)
    assert entry["truth"]["detection_latency_ms"] == pytest.approx(4.5)
    assert entry["truth"]["rebound_speed_m_s"] == pytest.approx(0.3)
    assert entry["detected_at_s"] == pytest.approx(9.0045)
    assert (summary["duration_s"], summary["realtime_factor"]) == (16.0, 32.0)
    # and a simulator that stands still for half a second, 0.4 s after the contact, changes none of it
    truth = FlightTruth([hit(10_000)], path, EPOCH_US + 500_000, stalls=[(10_400_000, 500_000)])
    assert build_summary(Flown(report, 0.5, truth), *FACTS) == summary


def test_a_setpoint_lies_in_the_frame_that_the_vehicle_believed_in_at_the_contact():
    # Given the same path, of a vehicle that believed itself 0.3 m further north than it was when it touched
    path = path_of([(10.0, 3.8, -1.5), (11.0, 3.0, -1.5), (12.0, 2.46, -1.5)])
    drifted = replace(hit(10_000), frame_offset_ned_m=(0.3, 0.1, 0.0))
    summary = build_summary(
        Flown(made_up.report(collision(10_004)), 0.5, FlightTruth([drifted], path, EPOCH_US)), *FACTS
    )
    # Then its setpoint of 2.8 m was at 2.5 m, 1.3 m off the wall, which faces south; and it went 4 cm past that
    found = summary["collisions"][0]["truth"]
    assert (found["overshoot_m"], found["stopped_off_m"]) == pytest.approx((0.04, 1.3))


def test_a_recovery_that_a_next_hit_cuts_short_is_measured_up_to_it():
    # Given a hit that was not recovered from when another was detected 1 s later, and a way past the setpoint then
    path = path_of([(10.0, 3.8, -1.5), (10.9, 3.0, -1.48), (11.5, 2.5, -1.2), (12.0, 2.5, -1.2)])
    truth = FlightTruth([hit(10_000), hit(11_000)], path, EPOCH_US)
    # When it is summed up
    summary = build_summary(Flown(made_up.report(collision(10_004, None), collision(11_004)), 0.5, truth), *FACTS)
    # Then the first hit has neither that overshoot nor that loss of height; the second has both
    first, second = (entry["truth"] for entry in summary["collisions"])
    assert (first["overshoot_m"], first["height_lost_m"]) == pytest.approx((0.0, 0.02))
    assert (second["overshoot_m"], second["height_lost_m"]) == pytest.approx((0.3, 0.3))


SIDE = math.sqrt(0.5)


@pytest.fixture(scope="module")
def flight(wall, wall_folder):
    return wall, read_telemetry(wall_folder / "flight.tlog")


@pytest.fixture(scope="module")
def topics(wall_folder, tmp_path_factory):
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


def test_what_is_heard_after_a_reboot_stands_at_its_own_time():
    flight: Any = SimpleNamespace(log=SimpleNamespace())
    flight.log.imu_time_boot_us, flight.log.imu_at_us = np.array([0, 2e6, 0, 2e6]), np.array([10e6, 12e6, 20e6, 22e6])
    assert heard_at_us(flight, np.array([1e6, 2e6, 0.5e6])).tolist() == [11e6, 12e6, 20.5e6]


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
    heard = (attitude._replace(sample=replace(attitude.sample, attitude_wxyz=attitude_frd_to_ned)),)
    imu, end_us = LoggedSample(*log.imu()[0]), log.heard[-1].at_us
    here = LoggedSample(end_us, GpsFix((0.0, 0.0), 47.397742, 8.545594, 488.0))
    content, log = BytesIO(), replace(log, heard=(imu, *heard, LoggedSample(end_us, moved), here))
    write_mcap(replace(shown, truth=None), log, content)
    topics = read_mcap(content.getvalue())
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
