"""`rebound logs`, on small flights on disk: what is seen and taken away of them, and of what a power cut left."""

import os
import shutil
import tarfile
from dataclasses import asdict

import pytest
from pymavlink.dialects.v20 import development as dialect

from companion.errors import ReboundError
from companion.guard.config import GuardConfig
from companion.guard.guard import Guard
from companion.messages import ComputerStatus
from rebound_cli.background import Background
from rebound_cli.flights import kept
from rebound_cli.main import main
from rebound_cli.replay.recording import read_recording, reproduce
from rebound_cli.results import run_folder
from rebound_cli.results.run_folder import EVENTS_NAME, INPUTS_NAME, TLOG_NAME, FlightRecorder
from tests.rebound_cli.command import assert_comes_again

EPOCH_US = 1_600_000_000_000_000
STEP_US = 50_000
BLOCK = 4096
COMPUTER = ComputerStatus(EPOCH_US, 90_500, (5, 50), 61, 812, 3792, 9_000, 30_000)


def record(folder, steps=50, writer=None, make_room=None):
    """A guard on a vehicle that says little, for some seconds; as a kill leaves it: without a summary."""
    settings = {"companion": {"streams": {"window_s": 0.5}}}
    config = GuardConfig.model_validate(settings)
    run_folder.write_yaml(folder / run_folder.GUARD_NAME, settings)
    run_folder.write_json(folder / run_folder.VERSIONS_NAME, run_folder.versions())
    vehicle, guard = dialect.MAVLink(None, 1, 1), Guard(config)
    recorder = FlightRecorder(folder, writer, make_room)
    for number in range(steps):
        now_us = EPOCH_US + number * STEP_US
        messages = []
        if number % 20 == 5:
            messages.append(dialect.MAVLink_heartbeat_message(2, 12, 81, 4 << 16 | 3 << 24, 3, 3))
        if number % 3 == 1:
            messages.append(dialect.MAVLink_attitude_message(number * 50, 0.01, 0.02, 0.03, 0.0, 0.0, 0.0))
        recorder.record(now_us, guard.step(b"".join(message.pack(vehicle) for message in messages), now_us))
        if number == 20:
            guard.tell_computer(COMPUTER)
            recorder.record_input(now_us, "computer", status=asdict(COMPUTER))
        if number == 30:
            guard.note("late", "a step came late")
            recorder.record_input(now_us, "note", event="late", text="a step came late")
    recorder.close()
    return recorder


def pretend(runs, name, size=BLOCK, hits=0, unconfirmed=0, summary=None):
    """A folder with the files by which a flight is known."""
    folder = runs / name
    folder.mkdir(parents=True)
    (folder / run_folder.TLOG_NAME).write_bytes(bytes(size))
    lines = ['{"time_us": 1000000, "kind": "connected", "text": "connected", "data": {}}']
    lines += ['{"time_us": 3500000, "kind": "detection", "text": "hit", "data": {}}'] * hits
    lines += ['{"time_us": 3500000, "kind": "unconfirmed", "text": "not a hit", "data": {}}'] * unconfirmed
    (folder / run_folder.EVENTS_NAME).write_text("\n".join(lines) + "\n")
    if summary is not None:
        run_folder.write_json(folder / run_folder.SUMMARY_NAME, summary)
    return folder


LAST = "20260103T000000Z-guard"


@pytest.fixture
def runs(tmp_path):
    runs = tmp_path / "runs"
    pretend(runs, "20260101T000000Z-square", 1_000_000, summary={"outcome": "completed", "reason": "landed"})
    pretend(runs, "20260102T000000Z-guard", 500_000, hits=3, unconfirmed=1)
    folder = runs / LAST
    folder.mkdir()
    record(folder)
    return runs


def logs(*words):
    return main(["logs", *map(str, words)])


def test_list_has_every_flight_from_the_oldest_on_and_how_it_ended(runs, capsys):
    assert logs("list", "--runs", runs) == 0
    first, second, third, total = capsys.readouterr().out.splitlines()
    assert first.startswith("20260101T000000Z-square") and "1.0 MB" in first and first.endswith("landed")
    assert "no hit" in first and "2.5 s" in second and "2 hits" in second and second.endswith("cut off")
    assert third.startswith(LAST)
    assert total.startswith("3 flights, 1.5 MB")


def test_show_is_of_the_last_flight_and_has_its_events_in_order(runs, capsys):
    assert logs("show", "--runs", runs) == 0
    told = capsys.readouterr().out
    assert told.startswith(f"{LAST}: cut off; no hit,")
    assert told.index("connected") < told.index("a step came late")
    # Times are those that whoever flew it has read: the first packet came a quarter of a second before.
    assert "    0.250 s  connected " in told
    assert logs("show", "20260102T000000Z-guard", "--runs", runs) == 0
    told = capsys.readouterr().out
    assert told.startswith("20260102T000000Z-guard: cut off; 2 hits") and told.count("detection") == 3


def test_without_flights_here_those_of_the_service_are_meant(runs, tmp_path, monkeypatch, capsys):
    (tmp_path / "here").mkdir()
    monkeypatch.chdir(tmp_path / "here")
    monkeypatch.setattr(kept, "SERVICE_RUNS", runs)
    assert logs("list") == 0
    assert capsys.readouterr().out.splitlines()[-1].startswith("3 flights")
    (tmp_path / "here" / "runs").mkdir()
    assert logs("list") == 0
    assert capsys.readouterr().out.startswith("0 flights")


def test_export_is_one_archive_with_every_byte_of_the_flight(runs, tmp_path, capsys):
    archive = tmp_path / "out.tar.gz"
    assert logs("export", LAST, "--runs", runs, "--out", archive) == 0
    with tarfile.open(archive) as tar:
        files = {member.name: tar.extractfile(member).read() for member in tar.getmembers()}
    assert files == {f"{LAST}/{file.name}": file.read_bytes() for file in (runs / LAST).iterdir()}
    assert str(archive) in capsys.readouterr().out


@pytest.fixture(scope="module")
def flight(tmp_path_factory):
    folder = tmp_path_factory.mktemp("flight")
    record(folder)
    return folder


@pytest.fixture
def cut(flight, tmp_path):
    """The flight with one of its files cut off after so many bytes."""
    folder = tmp_path / "cut"
    shutil.copytree(flight, folder)

    def at(name, length):
        for file in (TLOG_NAME, EVENTS_NAME, INPUTS_NAME):
            (folder / file).write_bytes((flight / file).read_bytes()[: length if file == name else None])
        return folder

    return at


def test_packets_cut_at_any_byte_are_decided_again_as_far_as_they_go(flight, cut):
    assert_comes_again(flight)
    # Events and inputs reach the disk before the packets of their step: the packets alone may be behind.
    whole = read_recording(flight)
    most = 0
    # Every third byte is within each part of a packet: its time stamp alone has eight.
    for length in range(0, (flight / TLOG_NAME).stat().st_size, 3):
        try:
            recording = read_recording(cut(TLOG_NAME, length))
        except ReboundError as error:
            # Before the second step with a packet there is nothing that is known whole.
            assert most == 0 and str(error).count(". ") == 0
            continue
        assert recording.is_cut
        assert recording.steps == whole.steps[: len(recording.steps)]
        assert len(recording.steps) >= most
        if len(recording.steps) > most:
            most = len(recording.steps)
            _, difference = reproduce(recording)
            assert difference is None, length
    assert most > 0.9 * len(whole.steps)


@pytest.mark.parametrize("name", [EVENTS_NAME, INPUTS_NAME])
def test_lines_cut_at_any_byte_are_read_to_the_last_whole_one(flight, cut, name):
    whole = read_recording(flight)
    for length in range(0, (flight / name).stat().st_size, 3):
        recording = read_recording(cut(name, length))
        assert list(recording.event_lines) == list(whole.event_lines)[: len(recording.event_lines)]
        times_us = [step.time_us for step in recording.steps]
        assert times_us == sorted(times_us) and set(times_us) <= {step.time_us for step in whole.steps}
        if name == EVENTS_NAME:
            assert recording.steps == whole.steps
        else:
            assert recording.event_lines == whole.event_lines


def test_a_damaged_line_of_a_flight_that_is_over_is_no_power_cut(cut):
    folder = cut(INPUTS_NAME, -5)
    run_folder.write_json(folder / run_folder.SUMMARY_NAME, {"collisions": []})
    with pytest.raises(ReboundError, match="damaged"):
        read_recording(folder)


def test_a_recorder_brings_lines_and_packets_to_the_disk_in_that_order(tmp_path, monkeypatch):
    # Given a recorder in real time, and what the kernel is asked to bring to the disk
    synced = []
    real = os.fdatasync

    def sync(file):
        synced.append(os.readlink(f"/proc/self/fd/{file}"))
        real(file)

    monkeypatch.setattr(os, "fdatasync", sync)
    # When a flight of 3.5 s is recorded
    recorder = record(tmp_path, 70, Background("log"))
    # Then it happens about twice a second, each time in the order that a replay needs
    names = [os.path.basename(name) for name in synced]
    rounds = len(names) // 3
    assert names == [EVENTS_NAME, INPUTS_NAME, TLOG_NAME] * rounds
    assert 5 <= rounds <= 8
    assert recorder.writer.loss is None
