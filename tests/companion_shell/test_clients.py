"""The clients of a guard in between, over real sockets: each gets all of the vehicle's, and none is waited for."""

import socket
import time

import pytest
from pymavlink.dialects.v20 import development as dialect

from companion.guard.between import Between
from companion.shell.connections.addresses import open_connection
from companion.shell.connections.clients import MOST_CLIENTS, UNREAD_BYTES, SharedConnection, carried_bytes_s
from companion.shell.connections.connection import bound_socket
from tests.clients.simulator import free_port

HEARTBEAT = dialect.MAVLink_heartbeat_message(6, 8, 0, 0, 4, 3)
LOOPBACK = "127.0.0.1"


def packet(system: int = 255, message=HEARTBEAT) -> bytes:
    return message.pack(dialect.MAVLink(None, system, 1))


class Bench:
    """A vehicle's end, and the guard's connection to it shared with whoever comes."""

    def __init__(self, *schemes: str):
        self.vehicle = bound_socket(socket.SOCK_DGRAM, LOOPBACK, 0)
        self.vehicle.settimeout(2.0)
        self.ports = [free_port(socket.SOCK_STREAM if "tcp" in scheme else socket.SOCK_DGRAM) for scheme in schemes]
        urls = [f"{scheme}://{LOOPBACK}:{port}" for scheme, port in zip(schemes, self.ports, strict=True)]
        self.between = Between(carried_bytes_s("udpout://127.0.0.1:1"))
        self._ends: list[socket.socket] = [self.vehicle]
        remote = open_connection(f"udpout://{LOOPBACK}:{self.vehicle.getsockname()[1]}")
        self.shared = SharedConnection(remote, urls, self.between)
        self.shared.send(packet(1))
        _, self.guard = self.vehicle.recvfrom(300)

    def udp(self, index: int = 0, is_bound: bool = False) -> socket.socket:
        """A client that sends to an address of the guard's, or waits at one."""
        opened = bound_socket(socket.SOCK_DGRAM, LOOPBACK, self.ports[index] if is_bound else 0)
        if not is_bound:
            opened.connect((LOOPBACK, self.ports[index]))
        opened.settimeout(2.0)
        self._ends.append(opened)
        return opened

    def tcp(self, index: int = 0) -> socket.socket:
        opened = socket.create_connection((LOOPBACK, self.ports[index]), 2.0)
        self._ends.append(opened)
        self.run()
        return opened

    def run(self, seconds: float = 0.0) -> bytes:
        received, until_s = b"", time.monotonic() + seconds
        while True:
            received += self.shared.receive(0.05)
            if time.monotonic() >= until_s:
                return received

    def says(self, content: bytes) -> bytes:
        """The vehicle; what the guard hears."""
        self.vehicle.sendto(content, self.guard)
        return self.run()

    def close(self) -> None:
        self.shared.close()
        for end in self._ends:
            end.close()


@pytest.fixture
def bench(request):
    opened = Bench(*request.param)
    yield opened
    opened.close()


@pytest.mark.parametrize("bench", [("udpin", "udpin", "tcpin")], indirect=True)
def test_every_client_hears_the_vehicle_and_each_of_them_is_heard_by_it(bench):
    clients = [bench.udp(0), bench.udp(0), bench.udp(1), bench.tcp(2), bench.tcp(2)]
    for number, client in enumerate(clients):
        client.sendall(packet(10 + number))
        bench.run()
        assert bench.vehicle.recv(300) == packet(10 + number)
    assert bench.says(packet(1)) == packet(1)
    assert [client.recv(300) for client in clients] == [packet(1)] * len(clients)
    # The guard's own: texts reach both ends, requests the vehicle alone
    text, ask = packet(1, dialect.MAVLink_statustext_message(4, b"hit")), packet(1)
    for sent in (text, ask):
        bench.shared.send(sent)
        assert bench.vehicle.recv(300) == sent
    assert [client.recv(300) for client in clients] == [text] * len(clients)
    for client in clients:
        client.settimeout(0.0)
        with pytest.raises(BlockingIOError):
            client.recv(300)


@pytest.mark.parametrize("bench", [("udpout",)], indirect=True)
def test_a_client_that_waits_is_sent_to_first(bench):
    waits = bench.udp(is_bound=True)
    bench.says(packet(1))
    assert waits.recvfrom(300)[0] == packet(1)


@pytest.mark.parametrize("bench", [("tcpin",)], indirect=True)
def test_a_client_that_goes_makes_room_and_its_last_words_arrive(bench):
    client = bench.tcp()
    client.sendall(packet(10))
    client.close()
    bench.run(0.1)
    assert bench.vehicle.recv(300) == packet(10)
    assert bench.says(packet(1)) == packet(1)
    again = bench.tcp()
    bench.says(packet(1))
    assert again.recv(300) == packet(1)


@pytest.mark.parametrize("bench", [("tcpin", "udpin")], indirect=True)
def test_a_client_that_never_reads_is_named_and_only_it_misses_anything(bench):
    # Given two clients, one of which reads nothing
    deaf, hears = bench.tcp(0), bench.udp(1)
    deaf.setsockopt(socket.SOL_SOCKET, socket.SO_RCVBUF, 4096)
    hears.sendall(packet(10))
    bench.run()
    # When the vehicle sends more than the system and the guard hold for it
    content, heard, sent = packet(1) * 1_400, 0, 0
    news = None
    while news is None and sent < 100 * UNREAD_BYTES:
        bench.vehicle.sendto(content, bench.guard)
        assert bench.shared.receive(0.5) == content, "the guard hears on"
        sent += len(content)
        while heard < sent:
            heard += len(hears.recv(65_536))
        news = bench.shared.news()
    # Then one sentence says so
    assert news is not None and "does not read what it is sent" in news
    assert heard == sent and bench.shared.news() is None
    # And what it reads in the end, a while later, are whole packets
    bench.run(1.5)
    deaf.setblocking(False)
    got = b""
    while len(got) < UNREAD_BYTES:
        bench.says(content)
        try:
            got += deaf.recv(65_536)
        except BlockingIOError:
            continue
    got = got[: len(got) - len(got) % len(packet(1))]
    assert got == packet(1) * (len(got) // len(packet(1)))


@pytest.mark.parametrize("bench", [("udpin",)], indirect=True)
def test_of_more_clients_than_there_is_room_for_the_next_is_named(bench):
    clients = [bench.udp() for _ in range(MOST_CLIENTS + 1)]
    for number, client in enumerate(clients):
        client.sendall(packet(10 + number))
        bench.run()
    news = bench.shared.news()
    assert news is not None and f":{clients[-1].getsockname()[1]} sends to the clients' port, too" in news


def test_what_a_serial_line_carries_follows_from_its_baud_rate():
    assert carried_bytes_s("serial:///dev/ttyAMA0:921600") == 92_160
    assert carried_bytes_s("udpin://0.0.0.0:14540") > 1_000_000
