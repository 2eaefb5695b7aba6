"""Who watches: console, plan and yes, the signals that end it; and the status socket, which disturbs nobody."""

import contextlib
import io
import json
import os
import pty
import signal
import socket
import stat
import sys
import tempfile
import threading
from unittest.mock import Mock

import pytest

from companion.report import Event, Status
from rebound_cli.live import status as status_socket
from rebound_cli.live.console import Console
from rebound_cli.live.interrupts import Interrupts
from rebound_cli.live.realtime import AskPerson
from rebound_cli.live.status import StatusServer, ask, served, socket_of_this_program, sockets_to_ask, text_of
from rebound_cli.main import main
from rebound_cli.results.timing import LinkRate
from rebound_cli.simulation.vehicle_process import VehicleProcess

EVENTS = (Event(1_000_000, "mode", "mode OFFBOARD", {}), Event(2_500_000, "detection", "hit 1 at [3.76, 0.00]", {}))
FLYING = Status("mission", "OFFBOARD", True, (1.0, 2.0, -1.5), 2.0, "armed at 1.8 m/s^2", 4_000)
RED, ANEW = "\x1b[1;31m", "\r\x1b[K"


class Screen(io.StringIO):
    """A terminal of which every byte is kept."""

    def isatty(self):
        return True


def test_in_a_pipe_each_event_and_now_and_then_the_state_is_one_plain_line():
    stream = io.StringIO()
    with Console(stream) as console:
        console.events(EVENTS, 0)
        console.live(lambda: FLYING, 3.0, "40.1 kB/s")
        console.live(lambda: FLYING, 3.1, "40.1 kB/s")
    assert stream.getvalue().splitlines() == [
        "    1.000 s  mode        mode OFFBOARD",
        "    2.500 s  detection   hit 1 at [3.76, 0.00]",
        "      3.0 s  state mission  mode OFFBOARD  position +1.00 +2.00 -1.50 m, 2.00 m/s  "
        "detector armed at 1.8 m/s^2  round trip 4 ms  link 40.1 kB/s",
    ]


def test_on_a_terminal_the_hit_stands_out_and_brackets_are_no_markup():
    screen = Screen()
    with Console(screen) as console:
        console.live(lambda: FLYING, 3.0)
        console.events(EVENTS, 0)
    # The state is one line, which the next event takes the place of
    assert "\n" not in screen.getvalue().partition(ANEW + "    1.000 s")[0]
    other, hit = (next(line for line in screen.getvalue().splitlines() if text in line) for text in ("mode ", "hit 1"))
    assert RED in hit and "[3.76, 0.00]" in hit and RED not in other


def test_what_a_vehicle_compiles_is_told_by_who_waits_for_it(tmp_path, monkeypatch):
    # Given a vehicle that compiles, and then is ready
    said = "Compiling physics\nCompiled code is not kept.\nSimulated vehicle x\n"
    code = f"import sys; print({said!r}, end='', flush=True); sys.stdin.read()"
    script = tmp_path / "vehicle"
    script.write_text(f'#!/bin/sh\nexec {sys.executable} -c "$CODE"\n')
    script.chmod(0o755)
    monkeypatch.setenv("CODE", code)
    monkeypatch.setattr(sys, "executable", str(script))
    stream = io.StringIO()
    # When somebody waits for it, then that is told
    with VehicleProcess(tmp_path, []) as vehicle:
        vehicle.wait_until_ready(Interrupts(), Console(stream))
    assert stream.getvalue() == said.rpartition("Simulated")[0]


def test_the_link_is_a_rate_and_then_a_silence():
    heard = LinkRate()
    assert heard.text(500_000) == ""
    for now_us in range(1_000_000, 2_100_001, 10_000):
        heard.take(400, now_us)
    assert heard.text(2_100_000) == "40.4 kB/s"
    assert heard.text(2_900_000) == "40.4 kB/s"
    assert heard.text(4_100_000) == "silent for 2.0 s"


def planned():
    return Mock(plan_is_ready=Mock(return_value=True), plan_text=lambda: "the plan")


def test_a_plan_that_is_made_anew_is_asked_for_anew_whatever_was_typed_meanwhile():
    reads, writes = os.pipe()
    companion = planned()
    shown = io.StringIO()
    console = Console(shown)
    person = AskPerson(console, reads)
    # Given a question
    person.poll(companion)
    assert shown.getvalue().count("Fly this plan?") == 1 and console.live_is_held
    # When the vehicle is away, and yes is typed
    companion.plan_is_ready.return_value = False
    os.write(writes, b"y\n")
    person.poll(companion)
    assert not console.live_is_held
    # Then the next plan is asked for, and that yes says nothing of it
    companion.plan_is_ready.return_value = True
    for _ in range(3):
        person.poll(companion)
    assert shown.getvalue().count("the plan") == 2 and not companion.confirm_plan.called
    # And a yes to that one does
    os.write(writes, b"yes\n")
    person.poll(companion)
    assert companion.confirm_plan.called and not companion.stop.called
    for descriptor in (reads, writes):
        os.close(descriptor)


def test_what_was_typed_before_the_plan_is_shown_says_nothing_of_it():
    writes, reads = pty.openpty()
    companion, person = planned(), AskPerson(Console(io.StringIO()), reads)
    for is_shown in (False, True):
        os.write(writes, b"y\n")
        for _ in range(3):
            person.poll(companion)
        assert companion.confirm_plan.called is is_shown
    for descriptor in (reads, writes):
        os.close(descriptor)


# The last one is the end of input.
@pytest.mark.parametrize("line", [b"n\n", b"\n", b"yessir\n", None])
def test_all_but_a_yes_is_a_no(line):
    reads, writes = os.pipe()
    companion = planned()
    person = AskPerson(Console(io.StringIO()), reads)
    if line is not None:
        os.write(writes, line)
    os.close(writes)
    for _ in range(2):
        person.poll(companion)
    os.close(reads)
    # Where nobody can be asked there is another way
    remedy = "; without a terminal --yes does" if line in (b"\n", None) else ""
    companion.stop.assert_called_once_with(f"the plan was not confirmed{remedy}")
    assert not companion.confirm_plan.called


@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM])
def test_the_first_signal_is_a_reason_and_the_second_ends_the_program(number):
    before = signal.getsignal(number)
    with Interrupts() as interrupts:
        os.kill(os.getpid(), number)
        assert interrupts.reason is not None and interrupts.reason.startswith("stopped")
        with pytest.raises(KeyboardInterrupt):
            os.kill(os.getpid(), number)
    assert signal.getsignal(number) is before


def test_a_terminal_that_goes_says_so_twice_and_ends_nothing_at_once():
    with Interrupts() as interrupts:
        for _ in range(2):
            os.kill(os.getpid(), signal.SIGHUP)
        assert interrupts.news(is_put_off=False) == "stopped because its terminal is gone"


def test_one_that_is_put_off_may_come_once_more_before_the_next_ends_the_program():
    with Interrupts() as interrupts:
        assert interrupts.news(is_put_off=False) is None
        os.kill(os.getpid(), signal.SIGINT)
        assert interrupts.news(is_put_off=False) == "stopped with Ctrl-C"
        assert interrupts.news(is_put_off=True) is None
        os.kill(os.getpid(), signal.SIGINT)
        assert interrupts.news(is_put_off=True) == "stopped with Ctrl-C, and once more"
        assert interrupts.news(is_put_off=True) is None
        with pytest.raises(KeyboardInterrupt):
            os.kill(os.getpid(), signal.SIGINT)


WATCHING = Status("watching", "POSCTL", True, (1.0, 2.0, -3.0), 0.5, "armed", 12_000)
ARMED = Event(500_000, "armed", "armed", {})
HIT = Event(1_000_000, "detection", "hit 1: 30.0 m/s^2", {})


@pytest.fixture
def path(tmp_path):
    return tmp_path / "status.sock"


@pytest.fixture
def server(path):
    server = StatusServer(path, {"command": "guard", "folder": "/runs/now"})
    yield server
    server.close()


def hand_over(server, *events):
    server.hand_over(lambda: WATCHING, events, 5.0, "90.0 kB/s")


def test_who_asks_hears_the_latest_state_and_how_old_it_is(server, path):
    # Its owner alone may ask, before the first step too
    assert stat.S_IMODE(path.stat().st_mode) == 0o600
    assert ask(path)["age_s"] is None and text_of(ask(path)).endswith("starting")
    hand_over(server, ARMED, HIT)
    status = ask(path)
    assert status["command"] == "guard" and status["folder"] == "/runs/now" and status["pid"] == os.getpid()
    assert status["state"] == "watching" and status["armed"] is True and status["position_ned_m"] == [1.0, 2.0, -3.0]
    assert status["hits"] == 1 and status["last_event"] == "hit 1: 30.0 m/s^2" and status["running_s"] == 5.0
    assert 0.0 <= status["age_s"] < 60.0 and status["schema"] == 1
    standing = text_of({**status, "age_s": 3.2})
    assert standing.endswith("The program has told nothing for 3.2 s: its loop stands still.")


def test_a_client_that_writes_never_reads_or_has_gone_keeps_nobody_from_an_answer(server, path):
    # Given clients that connect and do nothing, and others that go at once
    hand_over(server)
    silent = [socket.socket(socket.AF_UNIX) for _ in range(3)]
    for client in silent:
        client.connect(str(path))
    for _ in range(2):
        with socket.socket(socket.AF_UNIX) as client:
            client.connect(str(path))
            # It may be answered, and done with, before it has written.
            with contextlib.suppress(BrokenPipeError):
                client.sendall(b"disarm\n" * 100)
    # When another asks, then it is answered, and handing over took no waiting
    hand_over(server)
    assert ask(path)["state"] == "watching"
    for client in silent:
        client.close()


def test_the_socket_of_a_program_that_was_killed_is_taken_over(path):
    # Given a socket at which nobody listens any more
    with socket.socket(socket.AF_UNIX) as left:
        left.bind(str(path))
    # When a program begins, then it is asked there
    server = StatusServer(path, {"command": "fly", "folder": "-"})
    assert ask(path)["command"] == "fly"
    # And its end takes the socket away
    server.close()
    assert not path.exists() and not any(thread.name == "rebound status" for thread in threading.enumerate())


def test_the_socket_of_a_program_that_runs_is_left_to_it(server, path, monkeypatch):
    with pytest.raises(status_socket.StatusError, match="another program answers there"):
        StatusServer(path, {"command": "fly", "folder": "-"})
    assert ask(path)["command"] == "guard"
    # And a flight goes on without, and says so
    monkeypatch.setenv("RUNTIME_DIRECTORY", str(path.parent))
    told = []
    with served(told.append, command="fly", folder="-") as second:
        assert second is None
    assert len(told) == 1 and path.exists()


def test_the_socket_of_a_program_that_stands_still_keeps_nobody_from_starting(path):
    # Given one that answers nobody, and is asked by as many as may wait
    with socket.socket(socket.AF_UNIX) as still, contextlib.ExitStack() as asking:
        still.bind(str(path))
        still.listen(0)
        for _ in range(2):
            client = asking.enter_context(socket.socket(socket.AF_UNIX))
            client.setblocking(False)
            client.connect_ex(str(path))
        with pytest.raises(status_socket.StatusError, match="another program answers there"):
            StatusServer(path, {"command": "fly", "folder": "-"})


def test_systemds_folder_comes_before_the_sessions_and_without_either_it_is_a_temporary_one(tmp_path, monkeypatch):
    both = {"RUNTIME_DIRECTORY": "/run/rebound:/run/other", "XDG_RUNTIME_DIR": "/run/user/7"}
    assert str(socket_of_this_program(both)) == "/run/rebound/status.sock"
    session = {"XDG_RUNTIME_DIR": "/run/user/7"}
    asked = [str(path) for path in sockets_to_ask(session)]
    assert (asked[0], asked[-1]) == ("/run/user/7/rebound/status.sock", "/run/rebound/status.sock")
    # And who asks from cron, where neither is set, finds a flight of the same user's session
    assert f"/run/user/{os.getuid()}/rebound/status.sock" in map(str, sockets_to_ask({}))
    for name in both:
        monkeypatch.delenv(name, raising=False)
    monkeypatch.setattr(tempfile, "tempdir", str(tmp_path))
    with served(pytest.fail, command="fly", folder="-"):
        assert ask(None)["command"] == "fly"
    assert stat.S_IMODE(socket_of_this_program({}).parent.stat().st_mode) == 0o700


def test_in_another_users_folder_no_socket_is_made(path, monkeypatch):
    user = os.getuid()
    monkeypatch.setattr(os, "getuid", lambda: user + 1)
    with pytest.raises(status_socket.StatusError, match="another user's"):
        StatusServer(path, {"command": "fly", "folder": "-"})


@pytest.mark.parametrize("told", [b'{"schema": 1, "age_s": 0.1}', b'{"folder": "/runs/now"}', b"[]"])
def test_an_answer_that_lacks_what_a_status_has_is_one_sentence(server, path, told, capsys, monkeypatch):
    monkeypatch.setattr(server, "answer", lambda: told)
    assert main(["status", "--socket", str(path)]) == main(["status", "--socket", str(path), "--json"]) == 1
    assert capsys.readouterr().err.splitlines()[0].startswith(f"rebound: {path}: what answers there is not Rebound")


def test_a_person_reads_lines_and_a_program_json(server, path, capsys):
    hand_over(server, HIT)
    assert main(["status", "--socket", str(path)]) == 0
    told = capsys.readouterr().out
    for word in ("guard, process", "watching", "POSCTL", "12 ms", "90.0 kB/s", "hit 1: 30.0 m/s^2"):
        assert word in told
    assert main(["status", "--socket", str(path), "--json"]) == 0
    assert json.loads(capsys.readouterr().out)["state"] == "watching"
