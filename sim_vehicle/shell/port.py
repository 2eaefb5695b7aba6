"""What the outside of a link is to the loop in `realtime.py`, and the sockets under it."""

import contextlib
import errno
import socket
from typing import Protocol

from sim_vehicle.errors import LinkAddressError, PortInUse
from sim_vehicle.mavlink.link import Link
from sim_vehicle.mavlink.streams.stream_rates import LinkKind
from sim_vehicle.vehicle import SimulatedVehicle

Address = tuple[str, int]

LONGEST_DATAGRAM = 65_535


class Port(Protocol):
    """A socket, with the links of whoever is at its other end."""

    def receive(self) -> None:
        """Hand all that has arrived to the links."""

    def send(self) -> None:
        """Send what the links have ready; what cannot be sent is lost."""

    def close(self) -> None:
        """Give the socket back."""


def connected(vehicle: SimulatedVehicle, kind: LinkKind) -> Link:
    """A new link that says at once who is there, as PX4's streams send their first message (mavlink_stream.cpp).

    In lockstep, where nobody waits, HEARTBEAT comes after the link's first second.
    """
    link = vehicle.add_link(kind)
    link.introduce()
    return link


def bound_socket(kind: socket.SocketKind, host: str, port: int) -> socket.socket:
    """A non-blocking IPv4 socket of ``kind`` on ``host``:``port``.

    Raises PortInUse where it cannot be had, LinkAddressError for a host that cannot be one.
    """
    name = "UDP" if kind is socket.SOCK_DGRAM else "TCP"
    link = socket.socket(socket.AF_INET, kind)
    try:
        if kind is socket.SOCK_STREAM:
            link.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
        link.bind((host, port))
    except (UnicodeError, socket.gaierror) as problem:
        link.close()
        raise LinkAddressError(f"Host {host!r} is unknown: give a name or a number such as 127.0.0.1.") from problem
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
