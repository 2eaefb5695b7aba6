"""Whole flights on virtual time, as a person starts them."""

import json

import pytest
import yaml

from rebound_cli.inputs import load_mission_document, mission_from
from rebound_cli.results.flight_log import read_flight_log
from rebound_cli.simulation import lockstep
from rebound_cli.simulation.lockstep import virtual_time_limit_s
from tests.rebound_cli.command import HOP, SQUARE, WALL, assert_comes_again, events_of, run_here

pytestmark = pytest.mark.flight

FILES = {"mission.yaml", "airframe.yaml", "resolved.yaml", "versions.json", "flight.tlog", "events.jsonl"}
FILES |= {"inputs.jsonl", "obstacles.json", "truth.npz", "summary.json", "report.html"}


def test_one_command_flies_into_the_wall_recovers_and_lands(wall_flight):
    folder, result = wall_flight
    assert result.returncode == 0, result.stderr
    assert {path.name for path in folder.iterdir()} == FILES
    summary = json.loads(result.stdout)
    assert summary == json.loads((folder / "summary.json").read_text())
    assert (summary["outcome"], summary["mission"], summary["airframe"]) == ("completed", "wall", "foldable")
    assert (summary["false_detections"], summary["missed_contacts"], summary["recontacts"]) == (0, 0, 0)
    (hit,) = summary["collisions"]
    assert hit["impact_speed_m_s"] == pytest.approx(2.0, abs=0.15)
    assert hit["truth"]["normal_ned"] == [-1.0, 0.0, 0.0]
    # A hit that clips leaves few samples of the normal: 25 degrees at most in 95 of 100 (bench/notes/results.md).
    assert hit["normal_ned"][0] < -0.85
    assert 0.0 < hit["truth"]["detection_latency_ms"] < 9.0
    assert hit["settled_after_s"] is not None
    kinds = [event["kind"] for event in events_of(folder)]
    order = [
        kinds.index(kind) for kind in ("connected", "takeoff", "item", "detection", "recovered", "landing", "done")
    ]
    assert order == sorted(order)
    # And the recovery setpoint was sent for some seconds, clear of the hit and no further than the rebound carries
    log, target = read_flight_log(folder / "flight.tlog"), hit["recovery_setpoint_ned_m"]
    assert (abs(log.setpoint_ned_m - target).max(axis=1) < 0.002).sum() > 50
    assert 0.35 < log.position_ned_m[:, 0].max() - target[0] < 0.7


def test_a_run_folder_can_be_flown_again_to_the_byte(wall_flight, tmp_path):
    folder, _ = wall_flight
    # When the resolved mission of a flight is flown
    again = run_here("fly", folder / "resolved.yaml", "--lockstep", "--json", "--out", tmp_path / "again")
    # Then every byte is the same
    assert again.returncode == 0
    assert (tmp_path / "again" / "flight.tlog").read_bytes() == (folder / "flight.tlog").read_bytes()


def test_a_person_reads_the_timeline_and_the_figures(tmp_path):
    result = run_here("fly", WALL, "--lockstep", "--airframe", "rigid", "--seed", "2", "--out", tmp_path / "run")
    assert result.stderr == ""
    assert "detection" in result.stdout and "Hit a wall at 1.9" in result.stdout and "landed safely" in result.stdout
    assert "rigid airframe, seed 2" in result.stdout and str(tmp_path / "run") in result.stdout
    resolved = yaml.safe_load((tmp_path / "run/resolved.yaml").read_text())
    assert resolved["companion"]["estimate"]["guards"]["centre_m"] == 0.145 and resolved["sim"]["seed"] == 2
    # And nobody says what the rigid frame bears
    assert "not known" not in result.stdout and "broken" not in result.stdout


def test_a_mission_is_flown_over_a_line_that_loses_every_seventh_packet(tmp_path):
    lossy = ("--set", "sim.faults=[{kind: wire, at_s: 0, loss: 0.15}]")
    flown = run_here("fly", SQUARE, "--lockstep", *HOP, *lossy, "--json", "--out", tmp_path / "run")
    assert flown.returncode == 0, flown.stdout
    assert json.loads(flown.stdout)["stream_rates_hz"]["HIGHRES_IMU"] == pytest.approx(0.85 * 250, rel=0.05)
    assert_comes_again(tmp_path / "run")


def test_a_flight_that_hangs_is_ended(tmp_path, monkeypatch):
    # Given a flight and less virtual time than it needs; the square takes about 35 s
    assert 100 < virtual_time_limit_s(mission_from(load_mission_document(SQUARE, ()))) < 300
    monkeypatch.setattr(lockstep, "virtual_time_limit_s", lambda _: 3.0)
    # When it runs, then it is given up
    given_up = run_here("fly", SQUARE, "--lockstep", "--out", tmp_path / "run")
    assert given_up.returncode == 1
    assert "the flight was not over after 3 s of virtual time" in given_up.stdout + given_up.stderr
