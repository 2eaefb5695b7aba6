"""The vehicle in real time on UDP: who gets its packets, at which pace, and how it ends."""

import resource
import socket
import threading
import time
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

import pytest
from pymavlink.dialects.v20 import development as dialect

from sim_vehicle.airframe import load_built_in
from sim_vehicle.errors import PortInUse
from sim_vehicle.scene import Scene
from sim_vehicle.shell.truth_file import load_truth
from sim_vehicle.shell.udp import serve
from sim_vehicle.truth import TruthRecorder
from sim_vehicle.vehicle import SimulatedVehicle

TIMEOUT_S = 5.0


def new_vehicle() -> SimulatedVehicle:
    return SimulatedVehicle(load_built_in("foldable"), Scene(), 1)


@contextmanager
def bound() -> Iterator[socket.socket]:
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as peer:
        peer.bind(("127.0.0.1", 0))
        peer.settimeout(TIMEOUT_S)
        yield peer


def free_port() -> int:
    with bound() as probe:
        return int(probe.getsockname()[1])


@contextmanager
def served(vehicle, remote: tuple[str, int], truth_path: Path | None = None) -> Iterator[int]:
    """The vehicle in a thread, sending to ``remote``; the port on which it listens."""
    stop, port = threading.Event(), free_port()
    thread = threading.Thread(target=serve, args=(vehicle, port, remote, truth_path, stop.is_set))
    thread.start()
    try:
        yield port
    finally:
        stop.set()
        thread.join(TIMEOUT_S)
        assert not thread.is_alive()


def messages(peer: socket.socket, count: int) -> list:
    parser = dialect.MAVLink(None)
    return [parser.decode(bytearray(peer.recv(2048))) for _ in range(count)]


def heartbeat() -> bytes:
    return dialect.MAVLink_heartbeat_message(18, 8, 0, 0, 4, 3).pack(dialect.MAVLink(None, 1, 191))


def test_a_port_in_use_is_one_sentence():
    with bound() as other:
        port = other.getsockname()[1]
        with pytest.raises(PortInUse) as raised:
            serve(new_vehicle(), listen_port=port, stop=lambda: True)
    assert str(raised.value).startswith(f"UDP port {port} is in use")


def test_it_sends_unasked_one_packet_a_datagram_and_keeps_real_time():
    vehicle = new_vehicle()
    with bound() as companion, served(vehicle, companion.getsockname()):
        messages(companion, 1)
        before_s, cpu_s, boot_us = time.monotonic(), cpu_time_s(), vehicle.time_boot_us
        received = messages(companion, 400)
        passed_s, used_s = time.monotonic() - before_s, cpu_time_s() - cpu_s
    # 400 packets are some 1.4 s of the default streams
    assert {message.get_type() for message in received} >= {"HEARTBEAT", "HIGHRES_IMU", "LOCAL_POSITION_NED"}
    assert 1e-6 * (vehicle.time_boot_us - boot_us) == pytest.approx(passed_s, rel=0.05)
    assert used_s / passed_s < 0.2


def cpu_time_s() -> float:
    usage = resource.getrusage(resource.RUSAGE_SELF)
    return usage.ru_utime + usage.ru_stime


def test_the_first_sender_becomes_the_companion_for_good():
    with bound() as companion, bound() as first, bound() as second:
        with served(new_vehicle(), companion.getsockname()) as port:
            messages(companion, 1)
            first.sendto(heartbeat(), ("127.0.0.1", port))
            messages(first, 50)
            second.sendto(heartbeat(), ("127.0.0.1", port))
            messages(first, 50)
        second.setblocking(False)
        with pytest.raises(BlockingIOError):
            second.recv(2048)


def test_it_flies_on_when_nobody_listens(tmp_path: Path):
    with bound() as gone:
        address = gone.getsockname()
    path = tmp_path / "truth.npz"
    vehicle = new_vehicle()
    with served(vehicle, address, path):
        until_s = time.monotonic() + TIMEOUT_S
        while vehicle.time_boot_us < 200_000:
            assert time.monotonic() < until_s
            time.sleep(0.01)
    # And the truth is written at the end, with the wall clock of boot
    hits, series, epoch_us = load_truth(path)
    assert hits == []
    assert series["time_boot_us"][-1] == vehicle.time_boot_us
    assert epoch_us + vehicle.time_boot_us == pytest.approx(time.time_ns() // 1000, abs=2e6)


class VehicleOnABusyMachine:
    """Every step is instant, but one takes longer than its time."""

    interval_us = 4_000
    truth = TruthRecorder()

    def __init__(self, hangs_s: float) -> None:
        self.time_boot_us = 0
        self._hangs_s = hangs_s

    def step(self, received: bytes) -> tuple[bytes, ...]:
        self.time_boot_us += self.interval_us
        if self.time_boot_us == 100_000:
            time.sleep(self._hangs_s)
        return ()


@pytest.mark.parametrize(("hangs_s", "lost_s"), [(0.2, 0.0), (0.8, 0.8)])
def test_lateness_is_caught_up_unless_the_machine_was_away(hangs_s, lost_s):
    vehicle = VehicleOnABusyMachine(hangs_s)
    start_s = time.monotonic()
    with bound() as peer:
        serve(
            vehicle,  # type: ignore[arg-type]
            listen_port=free_port(),
            remote=peer.getsockname(),
            stop=lambda: time.monotonic() - start_s > 1.2,
        )
    assert 1e-6 * vehicle.time_boot_us == pytest.approx(1.2 - lost_s, abs=0.1)
