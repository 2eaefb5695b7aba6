"""The computer: what is said of it, and what its systemd is told, in virtual time."""

import contextlib
import errno
import itertools
import os
import socket
import threading
import uuid
from types import SimpleNamespace as Of

import pytest

from bench.fly.packets import decoded
from companion.mavlink.encode import Encoder
from companion.messages import ComputerStatus
from companion.shell import computer
from companion.shell.service_manager import STATUS_EVERY_US, ServiceManager, service_manager

MIB, GIB = 1 << 20, 1 << 30


def test_the_computers_status_is_in_the_messages_units_with_its_hottest_zone_if_there_is_one(tmp_path, monkeypatch):
    status = computer.computer_status(tmp_path, 0)
    assert len(status.cpu_percent) == os.cpu_count() and status.uptime_ms > 0
    assert 0 < status.memory_used_mib < status.memory_total_mib and 0 < status.disk_used_mib <= status.disk_total_mib
    zones = {"board": [Of(current=48.3)], "core": [Of(current=61.2)]}
    memory, disk = Of(total=3792 * MIB, available=2980 * MIB, free=10 * MIB), Of(total=30 * GIB, used=0, free=20 * GIB)
    monkeypatch.setattr(computer.psutil, "sensors_temperatures", lambda: zones)
    monkeypatch.setattr(computer.psutil, "cpu_percent", lambda percpu: [0.4, 99.6])
    monkeypatch.setattr(computer.psutil, "virtual_memory", lambda: memory)
    monkeypatch.setattr(computer.psutil, "disk_usage", lambda folder: disk)
    monkeypatch.setattr(computer.time, "clock_gettime", lambda clock: 90.5)
    known = ComputerStatus(1_000, 90_500, (0, 100), 61, 812, 3792, 10 * 1024, 30 * 1024)
    assert computer.computer_status(tmp_path, 1_000) == known
    zones.clear()
    assert computer.computer_status(tmp_path, 1_000).temperature_deg_c is None


@pytest.mark.parametrize(
    ("cores", "cores_sent"), [((5, 50, 0, 100), [5, 50, 0, 100, *[255] * 4]), (tuple(range(12)), list(range(8)))]
)
@pytest.mark.parametrize(("temperature", "sent"), [(61, 61), (None, 127), (-20, -20), (150, 126), (-300, -128)])
def test_the_message_has_what_is_known_and_fits_and_says_of_the_rest_that_it_is_unused(
    cores, cores_sent, temperature, sent
):
    status = ComputerStatus(1_600_000_000_000_000, 90_500, cores, temperature, 812, 3792, 9_000, 30_000)
    message = decoded(b"".join(Encoder().packets(status)))
    assert message.get_type() == "ONBOARD_COMPUTER_STATUS"
    assert (message.time_usec, message.uptime) == (1_600_000_000_000_000, 90_500)
    assert (message.cpu_cores, message.temperature_board) == (cores_sent, sent)
    assert (message.ram_usage, message.ram_total) == (812, 3792)
    assert message.storage_usage == [9_000, *[0xFFFFFFFF] * 3] and message.storage_total == [30_000, *[0xFFFFFFFF] * 3]
    assert message.temperature_core == [127] * 8 and message.fan_speed == [0x7FFF] * 4


SECOND_US = 1_000_000


@pytest.fixture(params=["path", "abstract"])
def systemd(request, tmp_path):
    """A bound socket and the address as $NOTIFY_SOCKET has it."""
    name = f"@rebound-{uuid.uuid4()}"
    address = str(tmp_path / "notify") if request.param == "path" else name
    with socket.socket(socket.AF_UNIX, socket.SOCK_DGRAM) as bound:
        bound.bind(address if request.param == "path" else "\0" + name[1:])
        bound.setblocking(False)
        yield bound, address


def heard(bound):
    lines = []
    while True:
        try:
            lines += bound.recv(4096).decode().split("\n")
        except BlockingIOError:
            return lines


def test_ready_at_the_first_heartbeat_and_the_end_is_told_once(systemd):
    bound, address = systemd
    manager = service_manager({"NOTIFY_SOCKET": address})
    # Given a vehicle that is silent, then heard, then left
    manager.stepped(False, False, lambda: "state connecting", 0)
    assert heard(bound) == ["STATUS=state connecting"]
    manager.stepped(True, False, lambda: "state connecting", 1)
    assert heard(bound) == ["READY=1"]
    for now_us in (2, 3):
        manager.stepped(True, True, lambda: "state connecting", now_us)
    assert heard(bound) == ["STOPPING=1"]
    assert manager.news() is None


def test_the_watchdog_is_fed_by_each_step_that_is_due_at_half_its_time(systemd):
    bound, address = systemd
    manager = ServiceManager(address, watchdog_us=5 * SECOND_US)
    fed_at_us = []
    # When steps come every 50 ms for 20 s
    for now_us in range(0, 20 * SECOND_US, 50_000):
        manager.stepped(True, False, lambda: "", now_us)
        if "WATCHDOG=1" in heard(bound):
            fed_at_us.append(now_us)
    # Then it is fed twice in its time; where no step comes, nothing feeds it
    assert fed_at_us == list(range(0, 20 * SECOND_US, 2_500_000))


def test_a_status_is_told_once_a_second_where_it_has_changed(systemd):
    bound, address = systemd
    manager, asked = ServiceManager(address, None), []

    def status():
        asked.append(True)
        return f"{len(asked) // 2} kB/s"

    told = []
    for now_us in range(0, 9 * SECOND_US, 4_000):
        manager.stepped(False, False, status, now_us)
        told += [(now_us, line) for line in heard(bound)]
    assert [line for _, line in told] == [f"STATUS={count} kB/s" for count in range(len(told))]
    assert len(told) == 5 and len(asked) == 9
    assert all(b - a >= STATUS_EVERY_US for (a, _), (b, _) in itertools.pairwise(told))


def test_what_systemd_could_not_take_is_told_at_the_next_step(systemd):
    bound, address = systemd
    manager = ServiceManager(address, None)
    # Given a systemd whose queue is full
    place = "\0" + address[1:] if address.startswith("@") else address
    with contextlib.ExitStack() as senders, pytest.raises(BlockingIOError):
        while True:
            # One sender alone fills its own queue first.
            sender = senders.enter_context(socket.socket(socket.AF_UNIX, socket.SOCK_DGRAM))
            sender.setblocking(False)
            for _ in range(100):
                sender.sendto(b"x", place)
    manager.stepped(True, False, lambda: "", 0)
    assert "READY=1" not in heard(bound)
    # When it reads again
    manager.stepped(True, False, lambda: "", 1)
    assert heard(bound) == ["READY=1"]
    assert manager.news() is None


def test_the_process_goes_before_other_programs_or_says_why_not(systemd, monkeypatch):
    _, address = systemd
    manager, asked = ServiceManager(address, None), []
    # Given a system that lets it
    monkeypatch.setattr(os, "sched_setscheduler", lambda *call: asked.append(call))
    manager.go_first()
    # Then every thread has a priority over all that share a processor by turns, and there is nothing to tell
    assert {thread for thread, *_ in asked} == {thread.native_id for thread in threading.enumerate()}
    assert all(policy == os.SCHED_FIFO and how.sched_priority > 0 for _, policy, how in asked)
    assert manager.news() is None

    # Given one that does not
    def refuse(*_):
        raise PermissionError(errno.EPERM, os.strerror(errno.EPERM))

    monkeypatch.setattr(os, "sched_setscheduler", refuse)
    manager.go_first()
    # Then that is told once
    assert "Operation not permitted" in manager.news()
    assert manager.news() is None


@pytest.mark.parametrize("environment", [{}, {"NOTIFY_SOCKET": ""}, {"NOTIFY_SOCKET": "vsock:2:1234"}])
def test_nobody_is_told_where_no_systemd_asks(environment):
    assert service_manager(environment) is None


@pytest.mark.parametrize(
    ("pid", "is_fed"), [({}, True), ({"WATCHDOG_PID": str(os.getpid())}, True), ({"WATCHDOG_PID": "1"}, False)]
)
def test_the_watchdog_of_another_process_is_not_fed(systemd, pid, is_fed):
    bound, address = systemd
    manager = service_manager({"NOTIFY_SOCKET": address, "WATCHDOG_USEC": "5000000", **pid})
    manager.stepped(False, False, lambda: "", 0)
    assert heard(bound) == (["WATCHDOG=1"] if is_fed else [])
