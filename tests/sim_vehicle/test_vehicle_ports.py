"""The vehicle in real time: UDP, TCP, serial lines, addresses, several vehicles; its pace and how it ends."""

import socket
import threading
import time
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

import pytest
from pymavlink.dialects.v20 import development as dialect

from sim_vehicle.airframe import load_built_in
from sim_vehicle.errors import LinkAddressError, PortInUse
from sim_vehicle.mavlink.streams.stream_rates import LinkKind
from sim_vehicle.scene import Scene
from sim_vehicle.shell.addresses import open_port, px4_ports
from sim_vehicle.shell.ports import Port, UdpPeerPort
from sim_vehicle.shell.realtime import RealtimePace, serve
from sim_vehicle.shell.truth_file import load_truth
from sim_vehicle.vehicle import SimulatedVehicle
from tests.sim_vehicle.vehicle_client import heard_until

TIMEOUT_S = 5.0


def new_vehicle() -> SimulatedVehicle:
    return SimulatedVehicle(load_built_in("foldable"), Scene(), 1)


@contextmanager
def served(vehicle: SimulatedVehicle, *ports: Port, truth_path: Path | None = None) -> Iterator[None]:
    stop = threading.Event()
    thread = threading.Thread(target=serve, args=(vehicle, ports, truth_path, stop.is_set))
    thread.start()
    try:
        yield
    finally:
        stop.set()
        thread.join(TIMEOUT_S)
        assert not thread.is_alive()


@contextmanager
def bound() -> Iterator[socket.socket]:
    """Somebody on UDP."""
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as peer:
        peer.bind(("127.0.0.1", 0))
        peer.settimeout(TIMEOUT_S)
        yield peer


@pytest.mark.parametrize(("words", "kind"), [("", LinkKind.GROUND), ("?set=normal", LinkKind.NORMAL)])
def test_an_address_says_whose_streams_it_has(words, kind):
    vehicle = new_vehicle()
    open_port(vehicle, "udpout://127.0.0.1:9" + words).close()
    (link,) = vehicle._links
    assert link.kind == kind


@pytest.mark.parametrize(
    ("address", "words"),
    [
        ("nonsense", "is not an address"),
        ("tcpin://127.0.0.1", "is not an address"),
        ("carrier://pigeon:7", "unknown scheme 'carrier'"),
        ("tcpin://0.0.0.0:65536", "names no port"),
        ("udpin://0.0.0.0:14551?set=satellite", "unknown set of streams"),
        ("udpout://nobody.invalid:14550", "Host 'nobody.invalid' is unknown"),
        (f"tcpin://{'a' * 64}.de:5760", "Host 'a+.de' is unknown"),
        ("tcpin://127.0.0.1:5\N{SUPERSCRIPT TWO}", "not an address"),
        ("serial:///dev/ttyUSB0:5\N{SUPERSCRIPT TWO}", "not an address"),
    ],
)
def test_a_wrong_address_is_one_sentence(address, words):
    with pytest.raises(LinkAddressError, match=words):
        open_port(new_vehicle(), address)


def test_a_serial_port_that_is_not_there_is_one_sentence():
    with pytest.raises(PortInUse, match="Serial port /dev/none cannot be opened"):
        open_port(new_vehicle(), "serial:///dev/none:57600")


def test_only_this_machine_is_listened_to_unless_another_was_named():
    for remote, here in (
        (("127.0.0.1", 9), "127.0.0.1"),
        (("localhost", 9), "127.0.0.1"),
        (("192.0.2.1", 9), "0.0.0.0"),
    ):
        port = UdpPeerPort(new_vehicle(), LinkKind.ONBOARD, 0, remote)
        assert port._socket.getsockname()[0] == here
        port.close()


def test_the_first_sender_becomes_the_companion_for_good():
    with bound() as companion, bound() as first, bound() as second:
        vehicle = new_vehicle()
        ports = px4_ports(vehicle, 0, 0, companion.getsockname())
        with served(vehicle, *ports):
            companion.recv(2048)
            for sender in (first, second):
                heartbeat = dialect.MAVLink_heartbeat_message(18, 8, 0, 0, 0, 3).pack(dialect.MAVLink(None, 255, 190))
                sender.sendto(heartbeat, ("127.0.0.1", ports[0].local_port))
                heard_until(first, {"HEARTBEAT", "ATTITUDE"})
        second.setblocking(False)
        with pytest.raises(BlockingIOError):
            second.recv(2048)


def test_it_flies_on_when_nobody_listens(tmp_path: Path):
    with bound() as gone:
        address = gone.getsockname()
    path = tmp_path / "truth.npz"
    vehicle = new_vehicle()
    with served(vehicle, *px4_ports(vehicle, 0, 0, address), truth_path=path):
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
