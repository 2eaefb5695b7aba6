"""The status socket: who asks is answered at once, and whoever does not read disturbs nobody."""

import contextlib
import json
import os
import socket
import stat
import tempfile
import threading

import pytest

from companion.report import Event, Status
from rebound_cli.live.status import (
    StatusError,
    StatusServer,
    ask,
    served,
    socket_of_this_program,
    sockets_to_ask,
    text_of,
)
from rebound_cli.main import main

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


def hand_over(server, *events, running_s=5.0):
    server.hand_over(lambda: WATCHING, events, running_s, "90.0 kB/s")


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
    with pytest.raises(StatusError, match="another program answers there"):
        StatusServer(path, {"command": "fly", "folder": "-"})
    assert ask(path)["command"] == "guard"
    # And a flight goes on without, and says so
    monkeypatch.setenv("RUNTIME_DIRECTORY", str(path.parent))
    told = []
    with served(told.append, command="fly", folder="-") as second:
        assert second is None
    assert len(told) == 1 and path.exists()


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
    with pytest.raises(StatusError, match="another user's"):
        StatusServer(path, {"command": "fly", "folder": "-"})


def test_a_person_reads_lines_and_a_program_json(server, path, capsys):
    hand_over(server, HIT)
    assert main(["status", "--socket", str(path)]) == 0
    told = capsys.readouterr().out
    for word in ("guard, process", "watching", "POSCTL", "12 ms", "90.0 kB/s", "hit 1: 30.0 m/s^2"):
        assert word in told
    assert main(["status", "--socket", str(path), "--json"]) == 0
    assert json.loads(capsys.readouterr().out)["state"] == "watching"
