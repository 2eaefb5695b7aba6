"""Connections to a vehicle over UDP, TCP and serial ports; `addresses.py` says which."""

import errno
import os
import select
import socket
import time
from typing import Any, Protocol

from companion.errors import ConnectionSetupError
from companion.shell.peer import Peer

# A local server answers within milliseconds and a radio link within a second; longer means nobody is there.
TCP_CONNECT_TIMEOUT_S = 5.0
# A send that blocks longer than this would stall the setpoints, 20 to 50 a second; the packet is dropped instead.
SEND_TIMEOUT_S = 0.02
# Datagrams of others that are passed over before the next step is taken.
MOST_STRANGERS = 300
# More than the longest MAVLink packet (280 bytes) and more than one UDP datagram can hold.
_READ_SIZE = 65_536


class Connection(Protocol):
    """Bytes in, packets out. A link that breaks falls silent: the companion's own timeouts deal with it."""

    def receive(self, timeout_s: float) -> bytes:
        """The bytes that came, or b"" when nothing came in time."""

    def send(self, frame: bytes) -> None:
        """Send one packet; one datagram a packet on UDP. Dropped when nobody is there to take it."""

    def news(self) -> str | None:
        """Something about the link that a person should know, once."""

    def close(self) -> None: ...


class UdpInConnection:
    """Listens on a local port to one peer (see `peer`) and answers it."""

    def __init__(self, host: str, port: int, peer: Peer | None = None) -> None:
        self._socket = _bound_socket(socket.SOCK_DGRAM, host, port)
        self._socket.setblocking(False)
        self._peer = peer or Peer()

    @property
    def local_port(self) -> int:
        return int(self._socket.getsockname()[1])

    def receive(self, timeout_s: float) -> bytes:
        if not _readable(self._socket, timeout_s):
            return b""
        for _ in range(MOST_STRANGERS):
            try:
                datagram, sender = self._socket.recvfrom(_READ_SIZE)
            except OSError:
                return b""
            if self._peer.accepts(datagram, sender[:2], time.monotonic_ns() // 1000):
                return datagram
        return b""

    def send(self, frame: bytes) -> None:
        if self._peer.answered is not None:
            _send_datagram(self._socket, frame, self._peer.answered)

    def news(self) -> str | None:
        return self._peer.news()

    def close(self) -> None:
        self._socket.close()


class UdpOutConnection:
    """Sends to one remote address from a port of its own."""

    def __init__(self, host: str, port: int) -> None:
        family, address = _resolve(socket.SOCK_DGRAM, host, port)
        self._socket = socket.socket(family, socket.SOCK_DGRAM)
        self._socket.setblocking(False)
        self._remote = address

    def receive(self, timeout_s: float) -> bytes:
        if not _readable(self._socket, timeout_s):
            return b""
        try:
            return self._socket.recv(_READ_SIZE)
        except OSError:
            return b""

    def send(self, frame: bytes) -> None:
        _send_datagram(self._socket, frame, self._remote)

    def news(self) -> str | None:
        return None

    def close(self) -> None:
        self._socket.close()


class _Stream:
    """A connected byte stream by its file descriptor; silent once the other end has gone."""

    def __init__(self, descriptor: int) -> None:
        self._descriptor = descriptor
        self.broken = False
        os.set_blocking(descriptor, False)

    def receive(self, timeout_s: float) -> bytes:
        if self.broken:
            time.sleep(max(timeout_s, 0.0))
            return b""
        if not _readable(self._descriptor, timeout_s):
            return b""
        try:
            content = os.read(self._descriptor, _READ_SIZE)
        except BlockingIOError:
            return b""
        except OSError:
            content = b""
        self.broken = not content
        return content

    def send(self, frame: bytes) -> None:
        remaining = memoryview(frame)
        while remaining and not self.broken:
            try:
                written = os.write(self._descriptor, remaining)
            except BlockingIOError:
                written = 0
            except OSError:
                self.broken = True
                return
            remaining = remaining[written:]
            if remaining and not select.select([], [self._descriptor], [], SEND_TIMEOUT_S)[1]:
                return


class TcpOutConnection:
    """A client of a TCP server."""

    def __init__(self, host: str, port: int) -> None:
        try:
            self._socket = socket.create_connection((host.strip("[]"), port), TCP_CONNECT_TIMEOUT_S)
        except (OSError, UnicodeError) as error:
            text = f"Cannot connect to {host}:{port} over TCP: {_plain(error)}."
            raise ConnectionSetupError(text) from error
        _without_delay(self._socket)
        self._stream = _Stream(self._socket.fileno())

    def receive(self, timeout_s: float) -> bytes:
        return self._stream.receive(timeout_s)

    def send(self, frame: bytes) -> None:
        self._stream.send(frame)

    def news(self) -> str | None:
        return None

    def close(self) -> None:
        self._socket.close()


class TcpInConnection:
    """A server for one client at a time; the next one is taken when the last has gone."""

    def __init__(self, host: str, port: int) -> None:
        self._listener = _bound_socket(socket.SOCK_STREAM, host, port)
        self._listener.listen(1)
        self._client: socket.socket | None = None
        self._stream: _Stream | None = None

    @property
    def local_port(self) -> int:
        return int(self._listener.getsockname()[1])

    def receive(self, timeout_s: float) -> bytes:
        if self._stream is None or self._stream.broken:
            if not _readable(self._listener, timeout_s):
                return b""
            self._take_client()
            return b""
        return self._stream.receive(timeout_s)

    def _take_client(self) -> None:
        if self._client is not None:
            self._client.close()
        try:
            self._client, _ = self._listener.accept()
            _without_delay(self._client)
        except OSError:
            # It has gone again before it was let in.
            self._client = self._stream = None
            return
        self._stream = _Stream(self._client.fileno())

    def send(self, frame: bytes) -> None:
        if self._stream is not None:
            self._stream.send(frame)

    def news(self) -> str | None:
        return None

    def close(self) -> None:
        if self._client is not None:
            self._client.close()
        self._listener.close()


class SerialConnection:
    """A serial port of 8 data bits, no parity, one stop bit, without flow control, as PX4's TELEM ports."""

    def __init__(self, device: str, baud: int) -> None:
        import serial  # only here: it costs start-up time

        if not os.path.exists(device):
            raise ConnectionSetupError(f"Serial port {device} does not exist: is the cable plugged in?")
        try:
            self._port = serial.Serial(device, baud)
        except (OSError, ValueError) as error:
            raise ConnectionSetupError(f"Serial port {device} cannot be opened: {_plain(error)}.") from error
        self._stream = _Stream(self._port.fileno())

    def receive(self, timeout_s: float) -> bytes:
        return self._stream.receive(timeout_s)

    def send(self, frame: bytes) -> None:
        self._stream.send(frame)

    def news(self) -> str | None:
        return None

    def close(self) -> None:
        self._port.close()


def _resolve(kind: socket.SocketKind, host: str, port: int) -> tuple[socket.AddressFamily, Any]:
    try:
        family, _, _, _, address = socket.getaddrinfo(host.strip("[]"), port, type=kind)[0]
    except (OSError, UnicodeError) as error:
        # Python turns a name into bytes first, which one with an empty part, or a part of more than 63 letters, fails.
        raise ConnectionSetupError(f"Host {host!r} is unknown: {_plain(error)}.") from error
    return family, address


def _bound_socket(kind: socket.SocketKind, host: str, port: int) -> socket.socket:
    family, address = _resolve(kind, host or "0.0.0.0", port)
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
            text = f"{name} port {port} on {host!r} cannot be opened: {_plain(error)}."
        raise ConnectionSetupError(text) from error
    return bound


def _without_delay(stream: socket.socket) -> None:
    # Packets are small and each is due now: Nagle's algorithm would hold setpoints back.
    stream.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)


def _send_datagram(sender: socket.socket, frame: bytes, remote: Any) -> None:
    try:
        sender.sendto(frame, remote)
    except OSError:
        # A full buffer or an unreachable host loses the packet, as a radio would.
        return


def _readable(source: socket.socket | int, timeout_s: float) -> bool:
    return bool(select.select([source], [], [], max(timeout_s, 0.0))[0])


def _plain(error: BaseException) -> str:
    text = error.strerror if isinstance(error, OSError) and error.strerror else str(error)
    return text[:1].lower() + text[1:]
