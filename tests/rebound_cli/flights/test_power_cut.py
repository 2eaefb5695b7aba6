"""Whatever of a flight's files the power left: it is read back, and decided again as far as it goes."""

import os
import shutil

import pytest

from companion.errors import ReboundError
from rebound_cli.background import Background
from rebound_cli.replay.recording import read_recording, reproduce
from rebound_cli.results import run_folder
from rebound_cli.results.run_folder import EVENTS_NAME, INPUTS_NAME, TLOG_NAME
from tests.rebound_cli.flights.flying import record


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
    assert reproduce(read_recording(flight)).first_difference is None
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
            reproduction = reproduce(recording)
            assert reproduction.first_difference is None, length
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
