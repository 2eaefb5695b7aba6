"""The process that says a companion's last word: when it speaks, by which links, and when it is silent."""

import os
import signal
import socket
import subprocess
import sys
import time

import pytest

WORD = b"\xfdlast word"
# A companion with a link and a word, which ends as it is told.
COMPANION = """
import sys, time
from companion.shell.addresses import open_connection
from rebound_cli.live.heir import Heir
heir, link = Heir(), open_connection(sys.argv[1])
until = time.monotonic() + 5.0
while link.way(b"x") is None and time.monotonic() < until:
    link.receive(0.05)
for words in eval(sys.argv[2]):
    heir.hear(words, link)
print("ready", flush=True)
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


def test_a_companion_that_is_killed_says_its_last_words_each_at_its_time(vehicle):
    address, end = vehicle
    companion = begun(address, [[(0.0, b"an earlier one")], [(0.0, WORD), (0.3, b"\xfdanother")]])
    end, _ = end(), companion.stdout.readline()
    began_s = time.monotonic()
    os.kill(companion.pid, signal.SIGKILL)
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
