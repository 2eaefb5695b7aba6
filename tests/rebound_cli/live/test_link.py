"""A flight's link: with --signing-key what is not genuine is not heard; and who says the companion's last word."""

import hashlib
import itertools
import os
import signal
import socket
import subprocess
import sys
import time
from pathlib import Path
from typing import Any
from unittest.mock import Mock

import pytest
from pymavlink.dialects.v20 import development as mav

from companion.mavlink.signing import Signing, stamp_at
from companion.shell.connections.addresses import open_connection
from companion.shell.signing_files import StampFile, write_new
from rebound_cli.live.heir import Heir
from rebound_cli.live.signed_connection import SignedConnection

KEY = hashlib.sha256(b"test").digest()
# Disarmed, and in a mode that a pilot has chosen
STOLEN = mav.MAVLink_heartbeat_message(2, 12, 0x51, 0x30000, 3, 3)


def test_what_was_recorded_before_a_restart_is_not_heard_after_it(tmp_path: Path):
    # Given a session whose packets somebody recorded, and a clock that is a day behind after the restart
    key_file, now_us = tmp_path / "key", 1_700_000_000_000_000
    write_new(key_file, KEY.hex().encode())
    vehicle = mav.MAVLink(None, 1, 1)
    vehicle.signing.secret_key, vehicle.signing.sign_outgoing = KEY, True
    vehicle.signing.timestamp = stamp_at(now_us)
    recorded = [bytes(STOLEN.pack(vehicle)) for _ in range(20)]
    first = line_with([b"".join(recorded)], now_us)
    before = session(key_file, first)
    assert before.receive(1.0) and before.signing.refused == {}
    before.close()
    # When they are played again
    again = line_with([b"".join(recorded)], now_us - 86_400_000_000)
    after = session(key_file, again)
    # Then none is heard, and what is sent is later than all before
    assert after.receive(1.0) == b"" and after.signing.refused == {"old": 20}
    for connection in (before, after):
        connection.send(bytes(STOLEN.pack(mav.MAVLink(None, 1, 191))))
    assert stamps_on(first) < stamps_on(again)
    after.close()


def line_with(waiting: list[bytes], time_us: int) -> Mock:
    """A link on which datagrams wait, and a clock that goes on by 4 ms each time it is read."""
    receive = Mock(side_effect=itertools.chain(waiting, itertools.repeat(b"")))
    return Mock(receive=receive, now_us=itertools.count(time_us, 4_000).__next__, news=lambda: None)


def stamps_on(line: Mock) -> list[int]:
    return [int.from_bytes(call.args[0][-12:-6], "little") for call in line.send.call_args_list]


def session(key_file: Path, line: Any) -> SignedConnection:
    stamps = StampFile(key_file)
    return SignedConnection(line, Signing(KEY, stamps.first(line.now_us())), stamps, line)


@pytest.mark.parametrize("reason", ["unsigned", "forged"])
def test_a_flood_that_is_refused_hides_nothing_and_is_told(tmp_path: Path, reason):
    # Given a datagram a packet, three hundred of them, before one that is genuine
    end, now_us = mav.MAVLink(None, 1, 1), 1_700_000_000_000_000
    end.signing.timestamp = stamp_at(now_us)
    if reason == "forged":
        end.signing.secret_key, end.signing.sign_outgoing = bytes(range(32)), True
    waiting = [bytes(STOLEN.pack(end)) for _ in range(299)]
    end.signing.secret_key, end.signing.sign_outgoing = KEY, True
    line = line_with([*waiting, bytes(STOLEN.pack(end))], now_us)
    connection = session(tmp_path / "key", line)
    opened = b"".join(connection.receive(0.0) for _ in range(300))
    assert opened == bytes(STOLEN.pack(mav.MAVLink(None, 1, 1)))
    assert connection.signing.refused == {reason: 299}
    # And it is told, once it has lasted
    assert "so far, the last HEARTBEAT of system 1" in connection.news()
    connection.close()


WORD = b"\xfdlast word"
# A companion with a link and a word, which ends as it is told.
COMPANION = """
import sys, time
from companion.shell.connections.addresses import open_connection
from rebound_cli.live.heir import Heir
heir, link = Heir(), open_connection(sys.argv[1])
until = time.monotonic() + 5.0
while link.way(b"x") is None and time.monotonic() < until:
    link.receive(0.05)
for words in eval(sys.argv[2]):
    heir.hear(words, link)
print(heir._process.pid, flush=True)
if sys.stdin.readline():
    heir.close()
"""


@pytest.fixture(params=["udp", "tcp"])
def vehicle(request):
    """Where the companion's packets arrive, and its address there."""
    if request.param == "udp":
        with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as end:
            end.bind(("127.0.0.1", 0))
            yield f"udpout://127.0.0.1:{end.getsockname()[1]}", lambda: end
    else:
        with socket.create_server(("127.0.0.1", 0)) as server:
            yield f"tcpout://127.0.0.1:{server.getsockname()[1]}", lambda: server.accept()[0]


def begun(address, words):
    command = [sys.executable, "-c", COMPANION, address, repr(words)]
    return subprocess.Popen(command, stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True)


def heard(end, wait_s):
    end.settimeout(wait_s)
    try:
        return end.recv(4096)
    except TimeoutError:
        return b""


def test_words_that_are_taken_back_are_not_said_by_an_heir_that_was_late():
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as end:
        end.bind(("127.0.0.1", 0))
        link, heir = open_connection(f"udpout://127.0.0.1:{end.getsockname()[1]}"), Heir()
        # Given one that had no turn while more was left to it than waits for it
        os.kill(heir._process.pid, signal.SIGSTOP)
        for _ in range(250):
            heir.hear([(0.0, bytes(80))] * 8, link)
        heir.hear([], link)
        os.kill(heir._process.pid, signal.SIGCONT)
        # When the next steps tell it again that there is none
        while heir._has_words:
            heir.hear([], link)
        heir.leave()
        link.close()
        assert heard(end, 0.2) == b""


def test_a_companion_that_is_killed_says_its_last_words_each_at_its_time(vehicle):
    address, end = vehicle
    companion = begun(address, [[(0.0, b"an earlier one")] * 100, [(0.0, WORD), (0.3, b"\xfdanother")]])
    end, heir = end(), int(companion.stdout.readline())
    began_s = time.monotonic()
    os.kill(companion.pid, signal.SIGKILL)
    # And systemd, or its watchdog, ends what is left of the service
    for ends in (signal.SIGTERM, signal.SIGABRT):
        os.kill(heir, ends)
    said = heard(end, 2.0)
    assert said.startswith(WORD) and time.monotonic() - began_s < 0.3
    while not said.endswith(b"another"):
        said = heard(end, 2.0)
    assert 0.3 <= time.monotonic() - began_s < 0.8
    companion.communicate()


@pytest.mark.parametrize(("words", "is_killed"), [([[(0.0, WORD)]], False), ([[(0.0, WORD)], []], True), ([], True)])
def test_one_that_ends_by_itself_or_has_none_says_nothing(vehicle, words, is_killed):
    address, end = vehicle
    companion = begun(address, words)
    end, _ = end(), companion.stdout.readline()
    if is_killed:
        os.kill(companion.pid, signal.SIGKILL)
    companion.communicate("" if is_killed else "end\n")
    assert heard(end, 0.3) == b""
