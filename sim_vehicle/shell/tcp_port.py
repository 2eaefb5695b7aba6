"""A TCP server: each client that connects gets a link of its own."""

import contextlib
import socket

from sim_vehicle.mavlink.link import Link
from sim_vehicle.mavlink.streams.stream_rates import LinkKind
from sim_vehicle.shell.port import bound_socket, connected
from sim_vehicle.vehicle import SimulatedVehicle

_READ_BYTES = 65_536
# Unread bytes of a client that has stopped reading: some ten seconds of all streams.
_MOST_UNREAD_BYTES = 500_000


class TcpServerPort:
    """PX4 itself speaks no TCP; this is what stands for the router or the simulator's bridge before it."""

    def __init__(self, vehicle: SimulatedVehicle, kind: LinkKind, host: str, port: int) -> None:
        self._listener = bound_socket(socket.SOCK_STREAM, host, port)
        self._listener.listen()
        self._vehicle = vehicle
        self._kind = kind
        self._clients: list[_Client] = []

    @property
    def local_port(self) -> int:
        """Where it listens."""
        return int(self._listener.getsockname()[1])

    def receive(self) -> None:
        # Nobody waits to be let in, or has gone again before he was.
        with contextlib.suppress(BlockingIOError, ConnectionError):
            connection, _ = self._listener.accept()
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
        self._listener.close()

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
