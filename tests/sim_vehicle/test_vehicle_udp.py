"""The vehicle in real time on UDP: who gets its packets, at which pace, and how it ends."""

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
from sim_vehicle.mavlink.link import LinkOptions
from sim_vehicle.mavlink.streams.stream_rates import LinkKind
from sim_vehicle.scene import Scene
from sim_vehicle.shell.addresses import px4_ports
from sim_vehicle.shell.realtime import RealtimePace, serve
from sim_vehicle.shell.truth_file import load_truth
from sim_vehicle.shell.udp_ports import UdpPeerPort
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


@contextmanager
def served(vehicle, remote: tuple[str, int], truth_path: Path | None = None) -> Iterator[int]:
    """The vehicle in a thread, sending to ``remote``; the port on which it listens."""
    stop, ports = threading.Event(), px4_ports(vehicle, 0, 0, remote)
    thread = threading.Thread(target=serve, args=(vehicle, ports, truth_path, stop.is_set))
    thread.start()
    try:
        yield ports[0].local_port
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
            px4_ports(new_vehicle(), 0, port)
    assert str(raised.value).startswith(f"UDP port {port} is in use")


def test_it_sends_unasked_one_packet_a_datagram():
    with bound() as companion, served(new_vehicle(), companion.getsockname()):
        received = messages(companion, 400)
    # 400 packets are some 1.4 s of the default streams
    assert {message.get_type() for message in received} >= {"HEARTBEAT", "HIGHRES_IMU", "LOCAL_POSITION_NED"}


def test_only_this_machine_is_listened_to_unless_another_was_named():
    for remote, here in (
        (("127.0.0.1", 9), "127.0.0.1"),
        (("localhost", 9), "127.0.0.1"),
        (("192.0.2.1", 9), "0.0.0.0"),
    ):
        port = UdpPeerPort(new_vehicle(), LinkOptions(LinkKind.ONBOARD), 0, remote)
        assert port._socket.getsockname()[0] == here
        port.close()


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


class Machine:
    """A clock that passes only when someone sleeps or hangs."""

    def __init__(self) -> None:
        self.now_ns = 5_000_000_000

    def monotonic_ns(self) -> int:
        return self.now_ns

    def sleep_s(self, seconds: float) -> None:
        self.now_ns += round(1e9 * seconds)


@pytest.mark.parametrize(("hangs_ms", "lost_ms"), [(0, 0), (200, 0), (500, 0), (800, 796)])
def test_lateness_is_caught_up_unless_the_machine_was_away(hangs_ms: int, lost_ms: int):
    """800 ms away: the interval that was due then is flown, the other 796 ms are left out."""
    machine = Machine()
    pace = RealtimePace(0, 1.0, machine.monotonic_ns, machine.sleep_s)
    start_ns, boot_us = machine.now_ns, 0
    while machine.now_ns - start_ns < 2_000_000_000:
        pace.wait_until(boot_us + 4_000)
        boot_us += 4_000
        if boot_us == 100_000:
            machine.now_ns += hangs_ms * 1_000_000
    assert boot_us == 2_000_000 - 1000 * lost_ms
    # And that the clock stood then is known, for whoever puts truth and telemetry beside each other
    assert pace.stalls == ([(104_000, 1000 * lost_ms)] if lost_ms else [])


@pytest.mark.parametrize(("speed", "lasts_ns"), [(0.5, 8_000_000), (1.0, 4_000_000), (4.0, 1_000_000), (0.0, 0)])
def test_an_interval_is_never_flown_before_it_has_passed_at_the_asked_speed(speed: float, lasts_ns: int):
    machine = Machine()
    pace = RealtimePace(4_000, speed, machine.monotonic_ns, machine.sleep_s)
    begun_ns = machine.now_ns
    pace.wait_until(8_000)
    assert machine.now_ns - begun_ns == lasts_ns
