"""A flight in virtual time under a systemd that listens: ready, alive, how it goes, and the end."""

import io
import itertools
import os
import socket

import pytest

from companion.report import Status
from rebound_cli.live.console import Console
from tests.rebound_cli.live.flying import fly


@pytest.fixture
def systemd(tmp_path, monkeypatch):
    with socket.socket(socket.AF_UNIX, socket.SOCK_DGRAM) as bound:
        bound.bind(str(tmp_path / "notify"))
        bound.setblocking(False)
        monkeypatch.setenv("NOTIFY_SOCKET", str(tmp_path / "notify"))
        monkeypatch.setenv("WATCHDOG_USEC", "5000000")
        yield bound


class Reader:
    """Answers for a person, and meanwhile reads what systemd is told: its queue holds few datagrams."""

    def __init__(self, systemd):
        self._systemd, self.told = systemd, []

    def beside(self, world):
        self._world = world
        return self

    def read(self):
        while True:
            try:
                lines = self._systemd.recv(4096).decode().split("\n")
            except BlockingIOError:
                return
            self.told += [(self._world.now_us(), line) for line in lines]

    def poll(self, companion):
        self.read()
        if companion.plan_is_ready():
            companion.confirm_plan()


def test_a_flight_tells_systemd_that_it_is_ready_alive_how_it_goes_and_when_it_ends(systemd, tmp_path, monkeypatch):
    # Given a system that gives it the priority that it asks for, but not whoever tests
    asked = []
    monkeypatch.setattr(os, "sched_setscheduler", lambda _, policy, how: asked.append(policy))
    reader = Reader(systemd)
    companion, *_ = fly(tmp_path, confirm=reader.beside)
    reader.read()
    told = reader.told
    assert companion.report().outcome == "completed"
    assert set(asked) == {os.SCHED_FIFO}
    lines = [line for _, line in told]
    # Ready once, at the vehicle's first heartbeat, long before it is armed; the end is told last, once
    ready_us = next(at_us for at_us, line in told if line == "READY=1")
    assert lines.count("READY=1") == 1 and ready_us < companion.report().armed_at_us
    assert lines.count("STOPPING=1") == 1 and "STOPPING=1" in lines[-2:]
    # Alive at least as often as systemd asks for, at half of its time
    fed_at_us = [at_us for at_us, line in told if line == "WATCHDOG=1"]
    assert len(fed_at_us) > 3
    assert max(b - a for a, b in itertools.pairwise(fed_at_us)) < 2_600_000
    # And the state and the rate of the link
    states = [line for line in lines if line.startswith("STATUS=state takeoff, mode OFFBOARD, ")]
    assert states and all(line.endswith(" kB/s") for line in states)


def test_the_present_state_is_no_line_of_a_journal(systemd, monkeypatch):
    def told():
        stream = io.StringIO()
        console = Console(stream)
        console.live(lambda: Status("watching", "", False, None, None, "off", None), 1.0)
        console.event(1.0, "detection", "hit")
        return stream.getvalue()

    assert "watching" not in told() and "hit" in told()
    monkeypatch.delenv("NOTIFY_SOCKET")
    assert "watching" in told() and "hit" in told()
