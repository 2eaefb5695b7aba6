"""Disks, terminals, garbage and faults beside the control path: none of them ends a flight in the air."""

import itertools
import json
import math
import sys
import threading
from unittest.mock import Mock

import pytest

from companion.companion import StepResult
from companion.mavlink.packet import message_id_of
from companion.messages import ComputerStatus
from companion.shell.connections.peer import LinkCounts
from companion.shell.tlog import read_tlog
from rebound_cli import fly as command
from rebound_cli.background import MOST_WAITING, Background
from rebound_cli.live.console import Console
from rebound_cli.live.interrupts import Interrupts
from rebound_cli.live.realtime import COMPUTER_EVERY_US, HANDING_OVER_US, FlightFaultError, Loop, confirm_now
from rebound_cli.main import main
from rebound_cli.results import run_folder
from rebound_cli.results.run_folder import FlightRecorder
from rebound_cli.results.timing import TOO_LATE_US, Timing
from rebound_cli.simulation.lockstep import EPOCH_US
from tests.rebound_cli.command import SQUARE, assert_comes_again, events_of, run_here
from tests.rebound_cli.live.flying import World, fly


class Gone:
    """A terminal or pipe that nobody reads any more."""

    def isatty(self):
        return False

    def write(self, text):
        raise BrokenPipeError(32, "Broken pipe")


class InTheAir:
    """What happens to the world once the vehicle climbs."""

    def __init__(self, world, happens):
        self._world, self._happens = world, happens

    def __call__(self, companion):
        confirm_now(companion)
        if companion.status().state == "takeoff" and companion.status().armed:
            happens, self._happens = self._happens, lambda _: None
            happens(self._world)


BREAKS = Mock(side_effect=ValueError("nobody thought of this"))


class EverySecond:
    due_us = 0

    def status(self, now_us):
        if now_us < self.due_us:
            return None
        self.due_us = now_us + COMPUTER_EVERY_US
        return ComputerStatus(now_us, 90_500, (5, 50), 61, 812, 3792, 9_000, 30_000)


def test_the_ground_station_is_told_of_the_computer_every_second_and_a_replay_tells_the_same(tmp_path):
    # When a mission is flown beside a computer that is watched
    companion, _, recorder, _, problem = fly(tmp_path, computer=EverySecond())
    # Then the vehicle's link carries its status once a second from the vehicle's first packets to the end
    assert problem is None and companion.report().outcome == "completed"
    sent_us = [
        time_us for time_us, packet in read_tlog(tmp_path / run_folder.TLOG_NAME) if message_id_of(packet) == 390
    ]
    report = companion.report()
    lasted_s = (report.ended_at_us - report.started_at_us) / 1e6
    assert lasted_s - 2.5 <= len(sent_us) <= lasted_s + 1.0
    assert all(0.9e6 < b - a < 1.2e6 for a, b in itertools.pairwise(sent_us))
    # And the flight is decided again to the bit, with what the computer said then
    assert_comes_again(tmp_path)
    assert recorder.writer.loss is None


def test_a_full_disk_ends_no_flight_and_is_told(tmp_path):
    # Given a disk on which nothing can be written any more
    for name in (run_folder.TLOG_NAME, run_folder.EVENTS_NAME, run_folder.INPUTS_NAME):
        (tmp_path / name).symlink_to("/dev/full")
    # When a mission is flown
    companion, world, recorder, _, problem = fly(tmp_path)
    # Then it lands, and the person and the operator read what was lost
    assert problem is None and companion.report().outcome == "completed"
    assert [event.text for event in recorder.events if event.kind == "lost"] == [
        "log has gaps: No space left on device"
    ]
    assert any(b"Log has gaps: No space left on device" in frame for frame in world.sent)
    assert recorder.writer.lost > 1


def test_a_reader_that_is_gone_ends_no_flight_and_is_told_and_replayed(tmp_path):
    companion, world, _, console, problem = fly(tmp_path, stream=Gone())
    assert problem is None and companion.report().outcome == "completed"
    assert any(b"Console has gaps: Broken pipe" in frame for frame in world.sent)
    # And the program says so when the vehicle is down
    with pytest.raises(BrokenPipeError), console:
        pass
    # And what was told is part of what is decided again
    assert_comes_again(tmp_path)
    assert "lost" in [event["kind"] for event in events_of(tmp_path)]


@pytest.mark.parametrize(
    ("happens", "words"),
    [(BREAKS, "nobody thought"), (lambda world: setattr(world, "is_deaf", True), "driver is gone")],
)
def test_a_fault_around_the_flight_hands_the_vehicle_over_first(tmp_path, happens, words):
    # When something beside the control path fails in the air, for good
    companion, world, recorder, _, problem = fly(tmp_path, confirm=lambda world: InTheAir(world, happens))
    # Then the vehicle holds by itself, in time, and one sentence says what happened
    failed_us = next(event.time_us for event in recorder.events if event.kind == "aborted")
    assert companion.finished and world.now_us() - failed_us < HANDING_OVER_US
    world.sleep(1.1)
    assert world.vehicle.mode == "Hold"
    assert words in problem and "the vehicle was handed over" in problem and "\n" not in problem
    assert words in companion.report().reason
    assert_comes_again(tmp_path)


def test_a_link_that_is_back_within_a_second_is_told_and_the_flight_goes_on(tmp_path):
    companion, world, recorder, _, _ = fly(tmp_path, confirm=lambda world: InTheAir(world, World.unplug))
    assert companion.report().outcome == "completed" and companion.report().collisions == ()
    assert [event.text for event in recorder.events if event.kind == "link"] == [
        "connection to /dev/ttyACM0 lost, reconnecting",
        "connected again: /dev/ttyACM1",
    ]
    assert any(b"Connected again: /dev/ttyACM1" in frame for frame in world.sent)
    assert_comes_again(tmp_path)


def test_a_reader_that_goes_ends_a_command_without_a_word(tmp_path, monkeypatch):
    monkeypatch.setattr(sys, "stdout", Gone())
    monkeypatch.setattr(sys, "stderr", told := Mock())
    assert main(["logs", "list", "--runs", str(tmp_path)]) == 1
    assert not told.write.called and told.close.called


def test_what_fails_or_waits_too_long_is_dropped_counted_and_told_once():
    # Given a disk that has stopped, one write that will fail, and fifty too many
    done, began, going_on = [], threading.Event(), threading.Event()
    writer = Background("log")

    def stand():
        began.set()
        going_on.wait()

    writer.give(stand)
    began.wait()
    writer.give(BREAKS)
    for number in range(MOST_WAITING + 49):
        writer.give(done.append, number)
    assert writer.loss == "log has gaps: writing takes too long" == writer.news()
    assert writer.news() is None
    # When it goes on
    assert writer.lost == 50
    going_on.set()
    writer.close()
    # Then what was kept is there in its order, and what failed is counted
    assert done == list(range(MOST_WAITING - 1)) and writer.lost == 51


def exchanged(folder, receive, now_us, deadline_us):
    """What was stepped by one exchange, of a socket and a clock that are these functions."""
    socket = Mock(receive=receive, now_us=now_us)
    stepped = Mock(armed=True, finished=False, last_words=list, next_deadline_us=lambda: deadline_us)
    stepped.step.return_value = StepResult((), (), ())
    recorder = FlightRecorder(folder)
    Loop(stepped, socket, socket, recorder, Console(sys.stderr), Interrupts()).exchange()
    recorder.close()
    return stepped


@pytest.mark.parametrize(
    ("late_us", "told"), [(3_000_000, ["setpoints 3000 ms late, PX4 needs two a second"]), (0, [])]
)
def test_a_step_that_is_late_is_told(tmp_path, late_us, told):
    # Given a clock that stands after a stall
    stepped = exchanged(tmp_path, lambda timeout_s: b"heard", lambda: EPOCH_US + late_us, EPOCH_US)
    assert [call.args for call in stepped.note.call_args_list] == [("late", text) for text in told]


def test_the_last_words_are_said_where_a_person_ends_the_program_at_once(tmp_path):
    # Given words that are taken back where a flight ends by itself
    stepped, heir = Mock(finished=False, next_deadline_us=lambda: 0), Mock()
    link = Mock(receive=Mock(side_effect=KeyboardInterrupt), now_us=lambda: 0)
    recorder = FlightRecorder(tmp_path)
    with pytest.raises(KeyboardInterrupt):
        Loop(stepped, link, link, recorder, Console(sys.stderr), Interrupts(), heir=heir).run(Mock())
    recorder.close()
    # Then they are said first
    assert heir.method_calls[0][0] == "leave"


IMU, PLACE = (bytes([0xFD, 0, 0, 0, 0, 1, 1, number, 0, 0, 0, 0]) for number in (105, 32))


@pytest.mark.parametrize(
    ("came", "deadline_us", "at_us", "heard"),
    [
        ([(0, IMU), (10, PLACE)], 20_000, 0, IMU),
        ([(0, PLACE), (1_000, PLACE), (3_000, IMU), (3_100, PLACE)], 20_000, 3_000, PLACE + PLACE + IMU),
        ([(2_000, PLACE), (9_000, IMU)], 20_000, 7_000, PLACE),
        ([(2_000, PLACE), (9_000, IMU)], 4_000, 4_000, PLACE),
        ([(9_000, IMU)], 4_000, 4_000, b""),
    ],
    ids=["a sample", "with the next sample", "no sample within 5 ms", "a setpoint is due", "nothing"],
)
def test_what_shows_no_hit_is_decided_with_the_next_sample(tmp_path, came, deadline_us, at_us, heard):
    clock = [0]

    def receive(timeout_s):
        at, packet = came[0] if came else (math.inf, b"")
        if at > clock[0] + round(1e6 * timeout_s):
            clock[0] += round(1e6 * timeout_s)
            return b""
        clock[0] = max(clock[0], at)
        del came[0]
        return packet

    stepped = exchanged(tmp_path, receive, lambda: clock[0], deadline_us)
    assert [call.args for call in stepped.step.call_args_list] == [(heard, at_us)]


def test_lateness_is_measured_and_told_each_time_it_doubles():
    timing = Timing()
    # Given 98 steps in time to a tenth of a millisecond, one early because something arrived, and late ones
    for _ in range(98):
        assert timing.stepped(EPOCH_US, EPOCH_US + 100, EPOCH_US + 300) is None
    assert timing.stepped(EPOCH_US, EPOCH_US - 900, EPOCH_US) is None
    assert timing.stepped(EPOCH_US, EPOCH_US + TOO_LATE_US - 1, EPOCH_US + TOO_LATE_US) is None
    said = [
        timing.stepped(EPOCH_US, at_us, at_us) for at_us in (EPOCH_US + round(n * TOO_LATE_US) for n in (1, 1.9, 2, 3))
    ]
    assert [text is not None for text in said] == [True, False, True, False]
    summary = timing.summary()
    assert summary["tick_lateness_ms"] == {"p50": 0.1, "p99": 950.0, "max": 1500.0}
    assert summary["step_ms"]["p50"] == 0.2 and summary["step_ms"]["max"] == 0.9


def test_a_fault_around_the_flight_leaves_a_summary_and_is_told_then(tmp_path, monkeypatch):
    # Given a flight that a fault of the program ended
    said = "Fault around the flight; the vehicle was handed over."
    connection = Mock(counts=LinkCounts())
    monkeypatch.setattr(command, "open_signed", lambda *_: connection)
    monkeypatch.setattr(command, "fly_realtime", Mock(side_effect=FlightFaultError(said)))
    result = run_here("fly", SQUARE, "--connect", "udpin://127.0.0.1:0", "--yes", "--out", tmp_path)
    # Then what is known of it is in its folder
    assert result.returncode == 1 and result.stderr == f"rebound: {said}\n"
    summary = json.loads((tmp_path / run_folder.SUMMARY_NAME).read_text())
    assert summary["outcome"] == "failed" and summary["reason"] == said and connection.close.called
