"""Links: several at once, slow, signed, MAVLink 1, in virtual time; and on UDP, TCP and serial lines in real time."""

import socket
import struct
import time
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

import pytest
from pymavlink.dialects.v20 import development as dialect

from sim_vehicle.airframe import load_built_in
from sim_vehicle.errors import LinkAddressError, PortInUse
from sim_vehicle.mavlink.signing import Signing
from sim_vehicle.mavlink.streams.stream_rates import LinkKind
from sim_vehicle.scene import Scene
from sim_vehicle.shell.addresses import open_port, px4_ports
from sim_vehicle.shell.ports import UdpPeerPort
from sim_vehicle.shell.realtime import RealtimePace, serve
from sim_vehicle.shell.truth_file import load_truth
from sim_vehicle.vehicle import SimulatedVehicle
from tests.clients.simulator import wait_until
from tests.sim_vehicle.vehicle_client import End, heard_until, in_a_thread

KEY = bytes(range(32))


class Vehicle:
    def __init__(self, *kinds: LinkKind, signing: Signing | None = None) -> None:
        self.vehicle = SimulatedVehicle(
            load_built_in("foldable"), Scene(), 1, epoch_at_boot_us=1_700_000_000_000_000, signing=signing
        )
        self.links = [self.vehicle.add_link(each) for each in kinds]
        self.ends = [End(link.push) for link in self.links]

    def run(self, seconds: float) -> None:
        for _ in range(round(seconds * 250)):
            self.vehicle.advance()
            for end, link in zip(self.ends, self.links, strict=True):
                end.hear(link.take(), self.vehicle.time_boot_us / 1e6)


ONBOARD, GROUND = LinkKind.ONBOARD, LinkKind.GROUND


def test_answers_go_where_they_were_asked_for_and_texts_where_a_ground_station_is():
    vehicle = Vehicle(ONBOARD, GROUND)
    companion, station = vehicle.ends
    companion.mav.srcSystem, companion.mav.srcComponent = 1, 191
    companion.heartbeat(kind=18)
    station.heartbeat()
    vehicle.run(0.1)
    companion.command(400, 1)
    vehicle.run(0.5)
    (ack,) = companion.all("COMMAND_ACK")
    assert (ack.command, ack.target_system, ack.target_component) == (400, 1, 191)
    assert station.all("COMMAND_ACK") == []
    assert [text.text for text in station.all("STATUSTEXT")] == ["Armed by external command\t"]
    assert companion.all("STATUSTEXT") == []
    station.send(dialect.MAVLink_ping_message(123, 77, 0, 0))
    vehicle.run(0.02)
    (ping,) = [message for message in station.all("PING") if message.seq == 77]
    assert (ping.time_usec, ping.target_system, ping.target_component) == (123, 255, 190)


def test_what_is_meant_for_others_is_passed_on_between_links():
    vehicle = Vehicle(ONBOARD, GROUND, ONBOARD)
    companion, station, silent = vehicle.ends
    companion.mav.srcSystem, companion.mav.srcComponent = 1, 191
    for end in (companion, station):
        end.heartbeat()
    vehicle.run(0.05)
    # When the ground station asks the companion, and then the vehicle
    asked = station.send(dialect.MAVLink_command_long_message(1, 191, 512, 0, 148, 0, 0, 0, 0, 0, 0))
    station.command(512, 148)
    vehicle.run(0.05)
    assert asked in companion.packets
    assert [packet for packet in companion.packets if packet[7] == 76] == [asked]
    # And somebody who was never heard gets nothing
    assert asked not in silent.packets
    # When the ground station is gone in the middle of an upload, the companion may begin one
    for end, gone in ((station, vehicle.links[1]), (companion, vehicle.links[2])):
        end.send(dialect.MAVLink_mission_count_message(1, 1, 2))
        vehicle.run(0.05)
        vehicle.vehicle.remove_link(gone)
    assert companion.last("MISSION_REQUEST_INT").seq == 0


def signed(end: End, time_stamp: int = 10**15, key: bytes = KEY) -> None:
    end.mav.signing.secret_key, end.mav.signing.sign_outgoing = key, True
    end.mav.signing.timestamp, end.mav.signing.link_id = time_stamp, 1


@pytest.fixture
def guarded() -> Vehicle:
    vehicle = Vehicle(ONBOARD, GROUND, signing=Signing(KEY))
    vehicle.vehicle.parameters.set("MAV_SIGN_CFG", 1)
    return vehicle


def test_a_forged_a_late_and_a_replayed_packet_are_refused_and_lock_no_genuine_one_out(guarded):
    end = guarded.ends[1]
    for component, time_stamp, key, heard in (
        (190, 2**47, bytes(32), 0),
        (190, 10**15, KEY, 1),
        (190, 2**47, bytes(32), 1),
        (190, 10**15 + 5, KEY, 2),
        # A new sender may not be a minute late
        (77, 10**15 - 61 * 100_000, KEY, 2),
        (77, 10**15 - 59 * 100_000, KEY, 3),
    ):
        end.mav.srcComponent = component
        signed(end, time_stamp, key)
        raw = end.command(400, 0)
        guarded.run(0.02)
        assert len(end.all("COMMAND_ACK")) == heard
    # The same packet once more, on this link and on the other
    for each in guarded.ends:
        each.forget()
        each.push(raw)
        guarded.run(0.05)
        assert each.all("COMMAND_ACK") == []


@pytest.mark.parametrize(("sign_cfg", "heard"), [(0, True), (1, False), (2, False)])
def test_unsigned_packets_are_taken_where_the_parameter_says(guarded, sign_cfg, heard):
    guarded.vehicle.parameters.set("MAV_SIGN_CFG", sign_cfg)
    guarded.ends[1].command(400, 0)
    guarded.run(0.05)
    assert bool(guarded.ends[1].all("COMMAND_ACK")) == heard


# MAVSDK goes by the codes. As a SITL answered: operation, path, and the code of its refusal (None: acknowledged)
FILE_REQUESTS = [
    *[(3, b"/", 6), (3, b"", 6), (3, b"/nope", 10), (4, b"/nope", 10), (14, b"/nope", 10), (10, b"/nope", 10)],
    *[(13, b"/a\0/b", 10), (5, b"", 4), (15, b"", 4), (1, b"", 4), (99, b"", 7), (2, b"", None)],
    # It makes folders and files; here nothing can be written
    *[(9, b"/new", 9), (6, b"/new", 9)],
]


@pytest.mark.parametrize(("operation", "path", "code"), FILE_REQUESTS)
def test_who_asks_for_files_is_told_that_there_are_none(operation, path, code):
    vehicle = Vehicle(ONBOARD)
    (end,) = vehicle.ends
    payload = struct.pack("<HBBBBBBI", 70, 0, operation, len(path), 0, 0, 0, 0) + path
    end.send(dialect.MAVLink_file_transfer_protocol_message(0, 1, 1, payload.ljust(251, b"\0")))
    vehicle.run(0.02)
    (message,) = end.all("FILE_TRANSFER_PROTOCOL")
    answer = bytes(message.payload)
    assert struct.unpack_from("<HBB", answer) == (71, 0, 128 if code is None else 129) and answer[5] == operation
    assert (answer[12] if answer[4] else None) == code
    assert message.target_system == 255


TIMEOUT_S = 5.0


def new_vehicle() -> SimulatedVehicle:
    return SimulatedVehicle(load_built_in("foldable"), Scene(), 1)


@contextmanager
def bound() -> Iterator[socket.socket]:
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
        ("serial:///dev/none:57600", "Serial port /dev/none cannot be opened"),
    ],
)
def test_an_address_that_is_wrong_or_not_there_is_one_sentence(address, words):
    with pytest.raises((LinkAddressError, PortInUse), match=words):
        open_port(new_vehicle(), address)


def test_only_this_machine_is_listened_to_unless_another_was_named():
    for host, here in (("127.0.0.1", "127.0.0.1"), ("localhost", "127.0.0.1"), ("192.0.2.1", "0.0.0.0")):
        port = UdpPeerPort(new_vehicle(), LinkKind.ONBOARD, 0, (host, 9))
        assert port._socket.getsockname()[0] == here
        port.close()


def test_the_first_sender_becomes_the_companion_for_good():
    with bound() as companion, bound() as first, bound() as second:
        vehicle = new_vehicle()
        ports = px4_ports(vehicle, 0, 0, companion.getsockname())
        with in_a_thread(serve, vehicle, ports):
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
    with in_a_thread(serve, vehicle, px4_ports(vehicle, 0, 0, address), path):
        wait_until(lambda: vehicle.time_boot_us >= 200_000, TIMEOUT_S, "it flies on")
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
