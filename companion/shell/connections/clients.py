"""The guard in between: the sockets of its clients, and the vehicle's connection as it is shared with them.

Nobody is waited for. What a client does not read is lost to that client alone.
"""

import select
import socket
import time
from collections.abc import Sequence
from contextlib import suppress
from typing import Any

from companion.errors import AddressError
from companion.guard.between import Between
from companion.shell.connections.addresses import Opened, one_host, parsed
from companion.shell.connections.connection import Way, bound_socket, send_datagram
from companion.shell.connections.streams import BITS_A_BYTE

# A sender of heartbeats has missed nine.
FORGOTTEN_US = 10_000_000
# A vehicle has a pilot's ground station, a program or two, a log. Each costs the link a copy.
MOST_CLIENTS = 8
# PX4 itself takes 1,600 bytes of a datagram.
READ_BYTES = 4096
# Of one address, before the vehicle is looked at again.
MOST_DATAGRAMS = 32
# An Ethernet frame's 1,500 without the headers of IPv6 and UDP.
DATAGRAM_BYTES = 1452
# Three seconds of a full UART of 921,600 baud: longer than a garbage collection, and old by then.
UNREAD_BYTES = 256_000
# A network is bounded by this computer: twice what a fast link carries.
NETWORK_BYTES_S = 2_000_000
# A vehicle whose port is gone, and packets that wait their turn, are looked for so often.
LOOK_S, TURN_S = 0.02, 0.001


class UdpPort:
    """An address of --between: whoever sends there, or for udpout the one host that is sent to first."""

    def __init__(self, opened: socket.socket, remote: Any, between: Between) -> None:
        opened.setblocking(False)
        self._socket, self._remote, self._between = opened, remote, between
        self._heard_us: dict[Any, int] = {} if remote is None else {remote: 0}
        self._is_full = False

    def sources(self) -> list[socket.socket]:
        return [self._socket]

    def receive(self, now_us: int) -> None:
        for sender, heard_us in [*self._heard_us.items()]:
            if sender != self._remote and now_us - heard_us > FORGOTTEN_US:
                del self._heard_us[sender]
                self._between.forget(_name(sender))
        with suppress(OSError):
            for _ in range(MOST_DATAGRAMS):
                content, sender = self._socket.recvfrom(READ_BYTES)
                if sender in self._heard_us or (self._remote is None and len(self._heard_us) < MOST_CLIENTS):
                    self._heard_us[sender] = now_us
                    self._between.hear(_name(sender), content)
                elif not self._is_full:
                    self._is_full = True
                    self._between.news.append(f"{_name(sender)} sends to the clients' port, too; it is not listened to")

    def send(self, packets: Sequence[bytes]) -> None:
        for datagram in _datagrams(packets):
            for remote in self._heard_us:
                send_datagram(self._socket, datagram, remote)

    def close(self) -> None:
        self._socket.close()


class TcpPort:
    """The same over TCP, a server; what a client has not read yet waits here, whole packets of it."""

    def __init__(self, listener: socket.socket, between: Between) -> None:
        listener.listen()
        listener.setblocking(False)
        self._listener, self._between = listener, between
        self._clients: dict[socket.socket, tuple[str, bytearray]] = {}  # name, and what is not read yet
        self._told: set[str] = set()

    def sources(self) -> list[socket.socket]:
        """A client whose packets wait is not read: it waits, too."""
        clients = [client for client, (name, _) in self._clients.items() if self._between.has_room(name)]
        return clients if len(self._clients) >= MOST_CLIENTS else [self._listener, *clients]

    def receive(self, now_us: int) -> None:
        for source in select.select(self.sources(), [], [], 0.0)[0]:
            if source is self._listener:
                self._accept()
                continue
            content = b""
            with suppress(OSError):
                content = source.recv(READ_BYTES)
            if content:
                self._between.hear(self._clients[source][0], content)
            else:
                source.close()
                self._between.forget(self._clients.pop(source)[0])

    def _accept(self) -> None:
        with suppress(OSError):
            client, sender = self._listener.accept()
            # Packets are small and each is due now. A client that does not read for a while keeps its connection.
            client.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)
            client.setblocking(False)
            self._clients[client] = (_name(sender), bytearray())

    def send(self, packets: Sequence[bytes]) -> None:
        content = b"".join(packets)
        for client, (name, unread) in self._clients.items():
            if len(unread) + len(content) <= UNREAD_BYTES:
                unread += content
            elif name not in self._told:
                self._told.add(name)
                self._between.news.append(f"{name} does not read what it is sent: what it misses is lost")
            # That one has gone is learned when it is read.
            with suppress(OSError):
                del unread[: client.send(unread)]

    def close(self) -> None:
        for source in (self._listener, *self._clients):
            source.close()


class SharedConnection:
    """The vehicle's connection, for the guard, with its clients beside it."""

    def __init__(self, vehicle: Opened, clients: Sequence[str], between: Between) -> None:
        """`clients`: their addresses. Raises AddressError, ConnectionSetupError."""
        self._vehicle, self._between, self.counts = vehicle, between, vehicle.counts
        self._ports: list[UdpPort | TcpPort] = []
        try:
            for client in clients:
                self._ports.append(_open(client, between))
        except Exception:
            self.close()
            raise

    def receive(self, timeout_s: float) -> bytes:
        """The vehicle's bytes, which have been passed on then; the clients' are passed on meanwhile."""
        until_s = time.monotonic() + timeout_s
        while True:
            self._wait(until_s - time.monotonic())
            received = self._vehicle.receive(0.0)
            if received and (packets := self._between.to_clients(received)):
                self._to_clients(packets)
            now_us = time.monotonic_ns() // 1000
            for port in self._ports:
                port.receive(now_us)
            for packet in self._between.to_vehicle(now_us):
                self._vehicle.send(packet)
            if received or time.monotonic() >= until_s:
                return received

    def _wait(self, timeout_s: float) -> None:
        vehicle = self._vehicle.fileno()
        sources: list[int | socket.socket] = [] if vehicle is None else [vehicle]
        for port in self._ports:
            sources += port.sources()
        longest_s = TURN_S if self._between.waits else LOOK_S if vehicle is None else timeout_s
        select.select(sources, [], [], max(min(timeout_s, longest_s), 0.0))

    def _to_clients(self, packets: Sequence[bytes]) -> None:
        for port in self._ports:
            port.send(packets)

    def send(self, frame: bytes) -> None:
        """The guard's own, before all that waits."""
        self._vehicle.send(frame)
        if self._between.sends(frame):
            self._to_clients([frame])

    def way(self, frame: bytes) -> Way | None:
        return self._vehicle.way(frame)

    def news(self) -> str | None:
        told = self._between.news
        return self._vehicle.news() or (told.popleft() if told else None)

    def close(self) -> None:
        self._vehicle.close()
        for port in self._ports:
            port.close()


def carried_bytes_s(url: str) -> float:
    """What a link carries. Raises AddressError."""
    address = parsed(url)
    return address.port / BITS_A_BYTE if address.scheme == "serial" else NETWORK_BYTES_S


def _open(url: str, between: Between) -> UdpPort | TcpPort:
    _, scheme, host, port = address = parsed(url)
    if scheme not in ("udpin", "udpout", "tcpin"):
        forms = "udpin://HOST:PORT, udpout://HOST:PORT or tcpin://HOST:PORT"
        raise AddressError(f"--between {url}: clients come by {forms}.")
    if scheme == "tcpin":
        return TcpPort(bound_socket(socket.SOCK_STREAM, host, port), between)
    if scheme == "udpin":
        return UdpPort(bound_socket(socket.SOCK_DGRAM, host, port), None, between)
    family, remote = one_host(address)
    return UdpPort(socket.socket(family, socket.SOCK_DGRAM), remote, between)


def _datagrams(packets: Sequence[bytes]) -> list[bytes]:
    """As few as hold them, each of whole packets."""
    grouped: list[bytes] = []
    for packet in packets:
        if grouped and len(grouped[-1]) + len(packet) <= DATAGRAM_BYTES:
            grouped[-1] += packet
        else:
            grouped.append(packet)
    return grouped


def _name(address: Any) -> str:
    return f"{address[0]}:{address[1]}"
