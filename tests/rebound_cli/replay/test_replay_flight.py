"""`rebound replay` of our own flights: every decision again, to the bit, and the first difference where not."""

import json
import shutil

import pytest
import yaml

from companion.mavlink.packet import message_id_of
from companion.messages import MessageId
from companion.shell.tlog import read_tlog
from rebound_cli.main import main
from rebound_cli.replay.recording import read_recording, reproduce


@pytest.fixture
def flight(wall_folder, tmp_path):
    """A copy to spoil."""
    return shutil.copytree(wall_folder, tmp_path / "wall")


def replay(capsys, *arguments):
    code = main(["replay", *map(str, arguments)])
    out = capsys.readouterr()
    return code, out.out, out.err


def test_a_lockstep_flight_is_decided_again_to_the_bit(wall_folder, tmp_path, capsys):
    code, text, _ = replay(capsys, wall_folder, "--expect", "1", "--out", tmp_path)
    assert code == 0
    assert "identical: every decision of the flight came again to the bit" in text
    assert "1 collision" in text
    # With its page, and with the flight's own times
    (page,) = tmp_path.iterdir()
    assert page.name == "report.html" and f"page: {page}" in text
    (hit,) = json.loads((wall_folder / "summary.json").read_text())["collisions"]
    assert f"{hit['detected_at_s']:.3f} s  HIT" in text


def test_an_expectation_that_fails_is_exit_code_1(wall_folder, tmp_path, capsys):
    code, text, _ = replay(capsys, wall_folder, "--expect", "none", "--out", tmp_path)
    assert code == 1 and "expected no collisions, found 1" in text
    # And the touchdown is none
    assert "contact, no collision: landing" in text


def test_a_folder_from_before_the_baselines_left_the_drone_is_decided_again(flight):
    # Given a folder whose resolved mission has the settings of a detector that drones had once
    resolved = flight / "resolved.yaml"
    mission = yaml.safe_load(resolved.read_text())
    mission["companion"]["lateral"] = {"threshold_m_s2": 4.0}
    resolved.write_text(yaml.safe_dump(mission))
    assert reproduce(read_recording(flight)).first_difference is None


def test_a_changed_packet_or_an_event_that_does_not_come_again_is_found(flight):
    # Given a flight in whose log one setpoint has another byte
    recording = read_recording(flight)
    step = next(step for step in recording.steps if len(step.sent) == 1 and len(step.sent[0]) > 40)
    step.sent = [step.sent[0][:20] + bytes([step.sent[0][20] ^ 1]) + step.sent[0][21:]]
    assert reproduce(recording).first_difference == f"at {step.time_us} us another packet was sent"
    (flight / "events.jsonl").open("a").write('{"time_us": 1, "kind": "x", "text": "", "data": {}}\n')
    assert "did not come again" in reproduce(read_recording(flight)).first_difference


def test_steps_in_which_nothing_came_count(flight):
    # Given a folder without the instants at which the companion only waited
    (flight / "inputs.jsonl").write_text("")
    # Then nobody confirms the plan, and that is the difference
    assert reproduce(read_recording(flight)).first_difference is not None


def test_another_detector_is_looked_at_without_comparing(wall_folder, tmp_path, capsys):
    code, text, _ = replay(capsys, wall_folder, "--any-mode", "--set", "companion.detector=fused", "--out", tmp_path)
    assert code == 0
    assert "with --set, --any-mode the flight's own decisions cannot come again" in text
    assert "identical" not in text


def test_a_flight_that_was_killed_is_decided_again_as_far_as_it_is_known(flight, tmp_path, capsys):
    # Given a folder whose program was killed: no summary, a log that ends in the middle of a packet
    (flight / "summary.json").unlink()
    tlog = flight / "flight.tlog"
    tlog.write_bytes(tlog.read_bytes()[: tlog.stat().st_size // 2 + 7])
    code, text, _ = replay(capsys, flight, "--out", tmp_path / "pictures")
    assert code == 0
    assert "identical" in text and "ended at once" in " ".join(text.split())


@pytest.mark.parametrize(
    ("spoil", "words"),
    [
        (lambda folder: (folder / "inputs.jsonl").unlink(), "replay"),
        (lambda folder: (folder / "inputs.jsonl").write_text("{\n"), "inputs.jsonl:1"),
        (lambda folder: (folder / "versions.json").write_text("["), "versions.json"),
        (lambda folder: (folder / "versions.json").write_text("5"), "versions.json"),
        (lambda folder: (folder / "events.jsonl").unlink(), "events.jsonl"),
        (lambda folder: (folder / "resolved.yaml").unlink(), "resolved.yaml"),
        (lambda folder: (folder / "flight.tlog").write_bytes(b""), "flight.tlog"),
    ],
)
def test_a_damaged_folder_is_one_sentence(flight, spoil, words, capsys):
    spoil(flight)
    code, text, error = replay(capsys, flight)
    assert code == 1 and text == ""
    assert error.startswith("rebound: ") and words in error and len(error.strip().splitlines()) == 1


def test_arguments_that_make_no_sense_are_refused(wall_folder, tmp_path, capsys):
    for arguments, words in (
        ((tmp_path,), "no flight.tlog in this folder"),
        ((tmp_path / "none.ulg",), "No such file"),
        ((wall_folder, "--set", "companion.detector=magic"), "there is no detector 'magic'"),
        ((wall_folder, "--set", "companion.fused.side_treshold_m_s2=1"), "did you mean 'side_threshold_m_s2'?"),
    ):
        code, _, error = replay(capsys, *arguments)
        assert code == 1 and words in error, error


def test_a_flight_that_was_not_watched_shows_no_absence_of_collisions(wall_folder, tmp_path, capsys):
    # Given an IMU stream too slow to see a hit by: of 250 samples a second one in 25
    packets, number = [], 0
    for at_us, packet in read_tlog(wall_folder / "flight.tlog"):
        number += message_id_of(packet) == MessageId.HIGHRES_IMU
        if message_id_of(packet) != MessageId.HIGHRES_IMU or number % 25 == 12:
            packets.append(at_us.to_bytes(8, "big") + packet)
    (tmp_path / "slow.tlog").write_bytes(b"".join(packets))
    arguments = (tmp_path / "slow.tlog", "--out", tmp_path, "--expect", "none")
    assert main(["replay", *map(str, arguments)]) == 1
    said = capsys.readouterr().out
    assert "0 % of the flight was watched" in said and "that shows none" in said
    # Unless the person asks for no more
    assert main(["replay", *map(str, arguments), "--least-watched", "0"]) == 0
    # And of a person who expects nothing the log is no evidence either
    assert main(["replay", *map(str, arguments[:3])]) == 1


def test_a_log_that_is_cut_in_flight_is_read_to_its_end_and_says_so(wall_folder, tmp_path, capsys):
    content = (wall_folder / "flight.tlog").read_bytes()
    (tmp_path / "cut.tlog").write_bytes(content[: len(content) // 2])
    for log, is_cut in ((wall_folder / "flight.tlog", False), (tmp_path / "cut.tlog", True)):
        _, text, _ = replay(capsys, log, "--any-mode", "--out", tmp_path / "out")
        assert ("ends in flight" in text) is is_cut
    # And cut before the flight it is no evidence
    (tmp_path / "cut.tlog").write_bytes(content[: len(content) // 10])
    code, text, _ = replay(capsys, tmp_path / "cut.tlog", "--out", tmp_path / "out")
    assert code == 1 and "no flight was heard: that is no evidence" in text
