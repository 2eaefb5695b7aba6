"""A flight in virtual time under a systemd that listens: ready, alive, how it goes, and the end."""

import io
import itertools
import os

from companion.report import Status
from companion.shell.service_manager import ServiceManager
from rebound_cli.live.console import Console
from tests.rebound_cli.live.flying import fly


def test_a_flight_tells_systemd_that_it_is_ready_alive_how_it_goes_and_when_it_ends(tmp_path, monkeypatch):
    # Given a system that gives it the priority that it asks for, but not whoever tests
    asked, told = [], []
    monkeypatch.setenv("NOTIFY_SOCKET", str(tmp_path / "notify"))
    monkeypatch.setattr(os, "sched_setscheduler", lambda _, policy, how: asked.append(policy))
    monkeypatch.setattr(
        ServiceManager,
        "stepped",
        lambda _, is_heard, is_ending, status, now_us: told.append((now_us, is_heard, is_ending, status())),
    )
    companion, *_ = fly(tmp_path)
    report = companion.report()
    assert report.outcome == "completed" and set(asked) == {os.SCHED_FIFO}
    # Then the vehicle is heard long before it is armed, and to the end; the end is told last
    assert next(at_us for at_us, is_heard, *_ in told if is_heard) < report.armed_at_us
    endings = [is_ending for *_, is_ending, _ in told]
    assert endings == sorted(endings) and endings.count(True) == 1
    # Each step is a sign of life
    assert max(b - a for (a, *_), (b, *_) in itertools.pairwise(told)) < 500_000
    # And the state and the rate of the link
    states = [status for *_, status in told if status.startswith("state takeoff, mode OFFBOARD, ")]
    assert states and all(status.endswith(" kB/s") for status in states)


def test_the_present_state_is_no_line_of_a_journal(monkeypatch):
    def told():
        stream = io.StringIO()
        console = Console(stream)
        console.live(lambda: Status("watching", "", False, None, None, "off", None), 1.0)
        console.event(1.0, "detection", "hit")
        return stream.getvalue()

    assert "watching" in told() and "hit" in told()
    monkeypatch.setenv("NOTIFY_SOCKET", "/run/systemd/notify")
    assert "watching" not in told() and "hit" in told()
