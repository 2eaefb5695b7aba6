"""UDP as PX4 has it, with one peer, and as a server for any number of clients."""

import socket

from sim_vehicle.errors import LinkAddressError
from sim_vehicle.mavlink.link import Link
from sim_vehicle.mavlink.streams.stream_rates import LinkKind
from sim_vehicle.shell.port import Address, bound_socket, connected, received_datagrams, send_datagrams
from sim_vehicle.vehicle import SimulatedVehicle

# A client silent for this time has gone; ground stations send a heartbeat a second.
CLIENT_GONE_AFTER_US = 30_000_000
# More clients than this are no ground stations: somebody sends from ever new ports.
MOST_CLIENTS = 32


class UdpPeerPort:
    """Sends unasked to ``remote``, and from the first datagram on to its sender for good, as PX4 does."""

    def __init__(self, vehicle: SimulatedVehicle, kind: LinkKind, listen_port: int, remote: Address) -> None:
        """Raises LinkAddressError for a host that nobody knows, PortInUse where ``listen_port`` cannot be had."""
        self._remote = _resolved(remote)
        # Nobody but this machine is listened to, unless another was named.
        here = "127.0.0.1" if self._remote[0].startswith("127.") else "0.0.0.0"
        self._socket = bound_socket(socket.SOCK_DGRAM, here, listen_port)
        self._has_peer = False
        self._link = connected(vehicle, kind)

    @property
    def local_port(self) -> int:
        """Where it listens."""
        return int(self._socket.getsockname()[1])

    def receive(self) -> None:
        for datagram, sender in received_datagrams(self._socket):
            if not self._has_peer:
                self._remote, self._has_peer = sender, True
            self._link.push(datagram)

    def send(self) -> None:
        send_datagrams(self._socket, self._link.take(), self._remote)

    def close(self) -> None:
        self._socket.close()


def _resolved(remote: Address) -> Address:
    """With the host's number in place of its name, which would be looked up for every packet."""
    host, port = remote
    try:
        *_, address = socket.getaddrinfo(host, port, socket.AF_INET, socket.SOCK_DGRAM)[0]
    except (OSError, UnicodeError) as problem:
        raise LinkAddressError(f"Host {host!r} is unknown: give a name or a number such as 127.0.0.1.") from problem
    return str(address[0]), port


class UdpServerPort:
    """Waits for clients; each that sends something gets a link of its own."""

    def __init__(self, vehicle: SimulatedVehicle, kind: LinkKind, host: str, port: int) -> None:
        self._socket = bound_socket(socket.SOCK_DGRAM, host, port)
        self._vehicle = vehicle
        self._kind = kind
        self._clients: dict[Address, Link] = {}
        self._heard_us: dict[Address, int] = {}

    @property
    def local_port(self) -> int:
        """Where it listens."""
        return int(self._socket.getsockname()[1])

    def receive(self) -> None:
        now_us = self._vehicle.time_boot_us
        for datagram, sender in received_datagrams(self._socket):
            link = self._clients.get(sender)
            if link is None:
                if len(self._clients) >= MOST_CLIENTS:
                    continue
                link = self._clients[sender] = connected(self._vehicle, self._kind)
            self._heard_us[sender] = now_us
            link.push(datagram)
        for address, heard_us in list(self._heard_us.items()):
            if now_us - heard_us > CLIENT_GONE_AFTER_US:
                del self._heard_us[address]
                self._vehicle.remove_link(self._clients.pop(address))

    def send(self) -> None:
        for address, link in self._clients.items():
            send_datagrams(self._socket, link.take(), address)

    def close(self) -> None:
        self._socket.close()
