"""Connections to a vehicle: what they have in common, and those over UDP; `streams.py` has TCP and serial ports."""

import errno
import select
import socket
import time
from contextlib import suppress
from typing import Any, NamedTuple, Protocol

from companion.errors import ConnectionSetupError
from companion.shell.connections.peer import LinkCounts, Peer

# A socket holds no more: Linux counts each datagram as 768 bytes or more of the 212,992 in net.core.rmem_default.
MOST_DATAGRAMS = 300
# More than the longest MAVLink packet (280 bytes) and more than one UDP datagram can hold.
READ_SIZE = 65_536
ANY_HOST = "0.0.0.0"


class Way(NamedTuple):
    """How a packet would go now; for another process."""

    packet: bytes
    descriptor: int
    address: Any = None  # of a datagram


class Connection(Protocol):
    """Bytes in, packets out. A link that breaks is silent until it is there again, and no call waits for that.

    The companion's own timeouts deal with the silence; who has control after it is for the vehicle to say.
    """

    counts: LinkCounts  # so far

    def receive(self, timeout_s: float) -> bytes:
        """All that has come, once something has, or b"" when nothing came in time.

        A loop that wakes late judges no silence before it has heard it.
        """

    def send(self, frame: bytes) -> None:
        """Send one packet; one datagram a packet on UDP. Dropped when nobody is there to take it."""

    def way(self, frame: bytes) -> Way | None:
        """Of a packet that is not sent; None: nobody is there to take it."""

    def news(self) -> str | None:
        """Something about the link that a person should know, once."""

    def close(self) -> None: ...


class UdpConnection:
    """A UDP socket on which one peer is heard (see `peer`) and answered."""

    def __init__(self, opened: socket.socket, peer: Peer, remote: Any = None) -> None:
        """`remote` is where to send before anybody has spoken; None: nowhere."""
        self._socket, self._peer, self._remote = opened, peer, remote
        self._socket.setblocking(False)
        self.counts = peer.counts

    @property
    def local_port(self) -> int:
        return int(self._socket.getsockname()[1])

    def receive(self, timeout_s: float) -> bytes:
        pieces: list[bytes] = []
        with suppress(OSError):
            readable(self._socket, timeout_s)
            for _ in range(MOST_DATAGRAMS):
                datagram, sender = self._socket.recvfrom(READ_SIZE)
                if self._peer.accepts(datagram, sender[:2], time.monotonic_ns() // 1000):
                    pieces.append(datagram)
        return b"".join(pieces)

    def fileno(self) -> int:
        return self._socket.fileno()

    def send(self, frame: bytes) -> None:
        if (way := self.way(frame)) is not None:
            send_datagram(self._socket, frame, way.address)

    def way(self, frame: bytes) -> Way | None:
        remote = self._remote or self._peer.answered
        return None if remote is None else Way(frame, self._socket.fileno(), remote)

    def news(self) -> str | None:
        return self._peer.news.popleft() if self._peer.news else None

    def close(self) -> None:
        self._socket.close()


def udp_in(host: str, port: int, peer: Peer | None = None) -> UdpConnection:
    return UdpConnection(bound_socket(socket.SOCK_DGRAM, host, port), peer or Peer())


def resolve(host: str, port: int, family: socket.AddressFamily = socket.AF_UNSPEC) -> tuple[socket.AddressFamily, Any]:
    """Family and address of a host. On a socket of IPv6 one that has only IPv4 is seen by its mapped address."""
    mapped = socket.AI_V4MAPPED if family == socket.AF_INET6 else 0
    try:
        found = socket.getaddrinfo(host.strip("[]"), port, family, flags=mapped)
    except (OSError, UnicodeError) as error:
        # Python turns a name into bytes first, which one with an empty part, or a part of more than 63 letters, fails.
        raise ConnectionSetupError(f"Host {host!r} is unknown: {plain(error)}.") from error
    family, _, _, _, address = found[0]
    return family, address


def bound_socket(kind: socket.SocketKind, host: str, port: int) -> socket.socket:
    family, address = resolve(host or ANY_HOST, port)
    bound = socket.socket(family, kind)
    if kind == socket.SOCK_STREAM:
        # A server restarted at once must not wait for the old connection's TIME_WAIT.
        bound.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
    try:
        bound.bind(address)
    except OSError as error:
        bound.close()
        name = "UDP" if kind == socket.SOCK_DGRAM else "TCP"
        if error.errno == errno.EADDRINUSE:
            text = f"{name} port {port} is already in use: stop the other program or choose another port."
        else:
            text = f"{name} port {port} on {host!r} cannot be opened: {plain(error)}."
        raise ConnectionSetupError(text) from error
    return bound


def send_datagram(sender: socket.socket, frame: bytes, remote: Any) -> None:
    # A full buffer or an unreachable host loses the packet, as a radio would.
    with suppress(OSError):
        sender.sendto(frame, remote)


def readable(source: socket.socket | int, timeout_s: float) -> bool:
    return bool(select.select([source], [], [], max(timeout_s, 0.0))[0])


def plain(error: BaseException) -> str:
    text = error.strerror if isinstance(error, OSError) and error.strerror else str(error)
    return text[:1].lower() + text[1:]
