"""What the outside of a link is to the loop in `realtime.py`: UDP, TCP and serial."""

import contextlib
import errno
import socket
import time
from typing import TypeAlias

import serial

from sim_vehicle.errors import LinkAddressError, PortInUse
from sim_vehicle.mavlink.link import Link
from sim_vehicle.mavlink.streams.stream_rates import LinkKind
from sim_vehicle.vehicle import SimulatedVehicle

Address = tuple[str, int]

LONGEST_DATAGRAM = 65_535


def connected(vehicle: SimulatedVehicle, kind: LinkKind) -> Link:
    """A new link that says at once who is there, as PX4's streams send their first message (mavlink_stream.cpp).

    In lockstep, where nobody waits, HEARTBEAT comes after the link's first second.
    """
    link = vehicle.add_link(kind)
    link.introduce()
    return link


def _resolved(remote: Address) -> Address:
    """With the host's number in place of its name, which would be looked up for every packet."""
    host, port = remote
    try:
        *_, address = socket.getaddrinfo(host, port, socket.AF_INET, socket.SOCK_DGRAM)[0]
    except (OSError, UnicodeError) as problem:
        raise LinkAddressError(f"Host {host!r} is unknown: give a name or a number such as 127.0.0.1.") from problem
    return str(address[0]), port


def bound_socket(kind: socket.SocketKind, host: str, port: int) -> socket.socket:
    """A non-blocking IPv4 socket of ``kind`` on ``host``:``port``.

    Raises PortInUse where it cannot be had, LinkAddressError for a host that cannot be one.
    """
    name = "UDP" if kind is socket.SOCK_DGRAM else "TCP"
    address, link = _resolved((host, port)), socket.socket(socket.AF_INET, kind)
    try:
        if kind is socket.SOCK_STREAM:
            link.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
        link.bind(address)
    except OSError as problem:
        link.close()
        if problem.errno == errno.EADDRINUSE:
            raise PortInUse(
                f"{name} port {port} is in use: another simulation may be running; stop it or choose another port."
            ) from problem
        raise PortInUse(f"{name} port {port} cannot be opened: {problem.strerror}; choose another port.") from problem
    link.setblocking(False)
    return link


def received_datagrams(link: socket.socket) -> list[tuple[bytes, Address]]:
    """Everything that has arrived, in order, with its sender."""
    datagrams: list[tuple[bytes, Address]] = []
    while True:
        try:
            datagrams.append(link.recvfrom(LONGEST_DATAGRAM))
        except BlockingIOError:
            return datagrams
        except ConnectionError:
            # Some systems report here that an earlier packet found nobody.
            continue


def send_datagrams(link: socket.socket, packets: tuple[bytes, ...], remote: Address) -> None:
    """One packet a datagram. A full buffer or a peer that is gone loses it, as on any UDP link."""
    for packet in packets:
        with contextlib.suppress(OSError):
            link.sendto(packet, remote)


# A client silent for this time has gone; ground stations send a heartbeat a second of the machine's time.
CLIENT_GONE_AFTER_S = 30.0
# More clients than this are no ground stations: somebody sends from ever new ports.
MOST_CLIENTS = 32


class SocketPort:
    """What all but serial lines have."""

    def __init__(self, kind: socket.SocketKind, host: str, port: int) -> None:
        self._socket = bound_socket(kind, host, port)

    @property
    def local_port(self) -> int:
        """Where it listens."""
        return int(self._socket.getsockname()[1])

    def close(self) -> None:
        self._socket.close()


class UdpPeerPort(SocketPort):
    """Sends unasked to ``remote``, and from the first datagram on to its sender for good, as PX4 does."""

    def __init__(self, vehicle: SimulatedVehicle, kind: LinkKind, listen_port: int, remote: Address) -> None:
        """Raises LinkAddressError for a host that nobody knows, PortInUse where ``listen_port`` cannot be had."""
        self._remote = _resolved(remote)
        # Nobody but this machine is listened to, unless another was named.
        here = "127.0.0.1" if self._remote[0].startswith("127.") else "0.0.0.0"
        super().__init__(socket.SOCK_DGRAM, here, listen_port)
        self._has_peer = False
        self._link = connected(vehicle, kind)

    def receive(self) -> None:
        for datagram, sender in received_datagrams(self._socket):
            if not self._has_peer:
                self._remote, self._has_peer = sender, True
            self._link.push(datagram)

    def send(self) -> None:
        send_datagrams(self._socket, self._link.take(), self._remote)


class UdpServerPort(SocketPort):
    """Waits for clients; each that sends something gets a link of its own."""

    def __init__(self, vehicle: SimulatedVehicle, kind: LinkKind, host: str, port: int) -> None:
        super().__init__(socket.SOCK_DGRAM, host, port)
        self._vehicle = vehicle
        self._kind = kind
        # With the time at which each was heard last.
        self._clients: dict[Address, tuple[Link, float]] = {}

    def receive(self) -> None:
        now_s = time.monotonic()
        for datagram, sender in received_datagrams(self._socket):
            if sender not in self._clients and len(self._clients) >= MOST_CLIENTS:
                continue
            link = self._clients[sender][0] if sender in self._clients else connected(self._vehicle, self._kind)
            self._clients[sender] = link, now_s
            link.push(datagram)
        for address, (link, heard_s) in list(self._clients.items()):
            if now_s - heard_s > CLIENT_GONE_AFTER_S:
                del self._clients[address]
                self._vehicle.remove_link(link)

    def send(self) -> None:
        for address, (link, _) in self._clients.items():
            send_datagrams(self._socket, link.take(), address)


_READ_BYTES = 65_536
# Unread bytes of a client that has stopped reading: some ten seconds of all streams.
_MOST_UNREAD_BYTES = 500_000


class TcpServerPort(SocketPort):
    """PX4 itself speaks no TCP; this is what stands for the router or the simulator's bridge before it."""

    def __init__(self, vehicle: SimulatedVehicle, kind: LinkKind, host: str, port: int) -> None:
        super().__init__(socket.SOCK_STREAM, host, port)
        self._socket.listen()
        self._vehicle = vehicle
        self._kind = kind
        self._clients: list[_Client] = []

    def receive(self) -> None:
        # Nobody waits to be let in, or has gone again before he was; or there are more than this process may open.
        with contextlib.suppress(OSError):
            connection, _ = self._socket.accept()
            self._clients.append(_Client(connection, connected(self._vehicle, self._kind)))
        for client in self._clients:
            client.receive()
        self._forget_the_gone()

    def send(self) -> None:
        for client in self._clients:
            client.send()
        self._forget_the_gone()

    def close(self) -> None:
        for client in self._clients:
            client.connection.close()
        super().close()

    def _forget_the_gone(self) -> None:
        for client in [client for client in self._clients if client.is_gone]:
            client.connection.close()
            self._vehicle.remove_link(client.link)
            self._clients.remove(client)


class _Client:
    def __init__(self, connection: socket.socket, link: Link) -> None:
        connection.setblocking(False)
        # Packets are small and wanted at once.
        connection.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)
        self.connection = connection
        self.link = link
        self.is_gone = False
        self._unsent = b""

    def receive(self) -> None:
        while not self.is_gone:
            try:
                data = self.connection.recv(_READ_BYTES)
            except BlockingIOError:
                return
            except OSError:
                data = b""
            self.is_gone = not data
            self.link.push(data)

    def send(self) -> None:
        self._unsent += b"".join(self.link.take())
        if not self._unsent or self.is_gone:
            return
        try:
            self._unsent = self._unsent[self.connection.send(self._unsent) :]
        except BlockingIOError:
            self.is_gone = len(self._unsent) > _MOST_UNREAD_BYTES
        except OSError:
            self.is_gone = True


class SerialPort:
    """What the line cannot carry at its speed is lost."""

    def __init__(self, vehicle: SimulatedVehicle, kind: LinkKind, device: str, baud: int) -> None:
        """Raises PortInUse where the device cannot be opened."""
        try:
            self._serial = serial.Serial(device, baud, timeout=0, write_timeout=0)
        except (OSError, ValueError) as problem:
            raise PortInUse(f"Serial port {device} cannot be opened: {problem}") from problem
        self._link = connected(vehicle, kind)

    def receive(self) -> None:
        # A line that is unplugged falls silent.
        with contextlib.suppress(OSError):
            self._link.push(self._serial.read(self._serial.in_waiting))

    def send(self) -> None:
        for packet in self._link.take():
            with contextlib.suppress(OSError, serial.SerialTimeoutException):
                self._serial.write(packet)

    def close(self) -> None:
        self._serial.close()


Port: TypeAlias = UdpPeerPort | UdpServerPort | TcpServerPort | SerialPort
"""The outside of a link, with the links of whoever is at its other end. `receive` hands all that has arrived to them.
`send` sends what they have ready; what cannot be sent is lost.
"""
