"""Byte streams to a vehicle, TCP and serial: opened again when they end, without anybody waiting for it."""

import os
import select
import socket
import threading
import time
from collections import deque
from collections.abc import Callable
from contextlib import suppress
from functools import partial
from io import RawIOBase
from pathlib import Path
from queue import Empty, SimpleQueue
from typing import Any

from companion.autopilot.known import defaults
from companion.errors import ConnectionSetupError
from companion.mavlink.packet import packet_length, whole_packets
from companion.shell.connections.connection import READ_SIZE, Way, bound_socket, plain, readable
from companion.shell.connections.peer import LinkCounts

# A local server answers within milliseconds and a radio link within a second; longer means nobody is there.
TCP_CONNECT_TIMEOUT_S = 5.0
# The last setpoint is flown on for a second: a link that is back has five attempts in it.
RETRY_S = 0.2
# The round trip of a telemetry radio stays below half a second; a SYN without an answer by then was lost.
ATTEMPT_S = 0.5
# What no host has acknowledged while the last setpoint is flown on is old: the other end has gone without a word.
UNACKNOWLEDGED_MS = defaults.LOSS_US // 1000
# A send that blocks longer than this would stall the setpoints, 20 to 50 a second; the packet is dropped instead.
SEND_TIMEOUT_S = 0.02
# A byte on the line: 8 data bits between a start bit and a stop bit.
BITS_A_BYTE = 10
# Where udev names serial devices by maker, model and serial number.
SERIAL_BY_ID = Path("/dev/serial/by-id")


class Stream:
    """An open byte stream; broken once the other end has gone.

    A UART's driver hands on a few bytes at a time. The beginning of a packet is kept back until the rest has come: a
    step for it takes as long as for a whole packet, and decides nothing. Nor is anybody woken for a piece of it: the
    line's rate says when the rest is there.
    """

    def __init__(self, port: socket.socket | RawIOBase, at: str, byte_s: float = 0.0) -> None:
        """`port`: a socket or a serial port. `at` is its address or device, for people; `byte_s` a byte's time."""
        self.port, self.at, self._byte_s = port, at, byte_s
        self.descriptor = port.fileno()
        self.broken = False
        self._begun = b""
        os.set_blocking(self.descriptor, False)

    def receive(self, timeout_s: float) -> bytes:
        until_s = time.monotonic() + timeout_s
        while not self.broken:
            self._await_rest(until_s)
            if not readable(self.descriptor, until_s - time.monotonic()):
                break
            try:
                content = os.read(self.descriptor, READ_SIZE)
            except BlockingIOError:
                return b""
            except OSError:
                content = b""
            self.broken = not content
            content = self._begun + content
            end = _end_of_whole(content)
            content, self._begun = content[:end], content[end:]
            if content:
                return content
        return b""

    def _await_rest(self, until_s: float) -> None:
        """Sleep until a packet that has begun is there, or the time is over."""
        left_s = until_s - time.monotonic()
        if self._begun and left_s > 0.0:
            time.sleep(min(self._byte_s * (packet_length(self._begun) - len(self._begun)), left_s))

    def send(self, frame: bytes) -> None:
        remaining = memoryview(frame)
        while remaining and not self.broken:
            try:
                with suppress(BlockingIOError):
                    remaining = remaining[os.write(self.descriptor, remaining) :]
            except OSError:
                self.broken = True
                return
            if remaining and not select.select([], [self.descriptor], [], SEND_TIMEOUT_S)[1]:
                return


def _end_of_whole(content: bytes) -> int:
    """Where the last whole packet ends. All counts as whole where a packet should begin and none does: after a loss
    whatever is there is handed on at once.
    """
    end = sum(map(len, whole_packets(content)))
    return len(content) if end < len(content) and packet_length(content, end) == 0 else end


class StreamConnection:
    """A stream that is opened again, at once and then every RETRY_S, for as long as the program runs. That is counted.

    On a thread: a name is looked up, and a driver keeps whoever opens or closes a port of a device that is going, for
    seconds.
    """

    def __init__(self, stream: Stream | None, open_anew: Callable[[], Stream], missing: str | None = None) -> None:
        """`open_anew` raises where it fails. Without a stream it is opened for the first time; `missing` says why."""
        self._stream, self._open_anew = stream, open_anew
        self._found: SimpleQueue[Stream] = SimpleQueue()
        self._closed = threading.Event()
        self._news = deque([] if missing is None else [f"{missing} Waiting for it."])
        self._lost_s: float | None = None
        self.counts = LinkCounts()
        if stream is None:
            self._begin(None)

    def receive(self, timeout_s: float) -> bytes:
        if self._stream is None:
            self._look(timeout_s)
            return b""
        content = self._stream.receive(timeout_s)
        if self._stream.broken:
            self._news.append(f"connection to {self._stream.at} lost, reconnecting")
            self._lost_s = time.monotonic()
            old, self._stream = self._stream, None
            self._begin(old)
        return content

    def _look(self, timeout_s: float) -> None:
        try:
            self._stream = self._found.get(timeout=max(timeout_s, 0.0))
        except Empty:
            return
        if self._lost_s is not None:
            self.counts.reconnects += 1
            self._news.append(f"connected again after {time.monotonic() - self._lost_s:.1f} s: {self._stream.at}")
        else:
            self._news.append(f"connected: {self._stream.at}")

    def _begin(self, old: Stream | None) -> None:
        threading.Thread(target=self._reopen, args=(old,), name="rebound link", daemon=True).start()

    def _reopen(self, old: Stream | None) -> None:
        if old is not None:
            # A driver may refuse to close a port whose device has gone: it is opened anew all the same.
            with suppress(OSError):
                old.port.close()
        while not self._closed.is_set():
            # Whatever the system or a driver raises, the next attempt may find the other end.
            with suppress(Exception):
                self._found.put(self._open_anew())
                return
            self._closed.wait(RETRY_S)

    def fileno(self) -> int | None:
        return None if self._stream is None else self._stream.descriptor

    def way(self, frame: bytes) -> Way | None:
        return None if self._stream is None else Way(frame, self._stream.descriptor)

    def send(self, frame: bytes) -> None:
        if self._stream is not None:
            self._stream.send(frame)

    def news(self) -> str | None:
        return self._news.popleft() if self._news else None

    def close(self) -> None:
        """What a thread still opens ends with the program."""
        self._closed.set()
        if self._stream is not None:
            self._stream.port.close()


def tcp_out(host: str, port: int, waits: bool = False) -> StreamConnection:
    open_anew = partial(_connected, host, port, ATTEMPT_S)
    try:
        stream = _connected(host, port, TCP_CONNECT_TIMEOUT_S)
    except (OSError, UnicodeError) as error:
        text = f"Cannot connect to {host}:{port} over TCP: {plain(error)}."
        if waits:
            return StreamConnection(None, open_anew, text)
        raise ConnectionSetupError(text) from error
    return StreamConnection(stream, open_anew)


def _connected(host: str, port: int, timeout_s: float) -> Stream:
    connected = socket.create_connection((host.strip("[]"), port), timeout_s)
    # Without a server on this machine the kernel may, one time in 28 000, connect the socket with itself.
    if connected.getpeername() == connected.getsockname():
        connected.close()
        raise ConnectionRefusedError("connection refused")
    return _tcp_stream(connected, (host, port))


def _tcp_stream(connected: socket.socket, address: Any) -> Stream:
    # Packets are small and each is due now: Nagle's algorithm would hold setpoints back.
    connected.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)
    connected.setsockopt(socket.IPPROTO_TCP, socket.TCP_USER_TIMEOUT, UNACKNOWLEDGED_MS)
    return Stream(connected, f"{address[0]}:{address[1]}")


class TcpInConnection(StreamConnection):
    """A server for one client at a time; the next one is taken when the last has gone."""

    def __init__(self, host: str, port: int) -> None:
        self._listener = bound_socket(socket.SOCK_STREAM, host, port)
        self._listener.listen(1)
        self._listener.settimeout(RETRY_S)
        super().__init__(None, lambda: _tcp_stream(*self._listener.accept()))

    def close(self) -> None:
        super().close()
        self._listener.close()


class SerialConnection(StreamConnection):
    """A device, found again when it is plugged in anew. One that may not be opened is waited for by nobody: that is a
    matter of rights.

    While it is open, udev's links that lead to it are remembered. Where there are any, it is looked for by these alone:
    its old path may be another device's by now.
    """

    def __init__(self, path: str, baud: int, waits: bool = False) -> None:
        self._path, self._baud = path, baud
        self._links: list[Path] = []
        missing = None if os.path.exists(path) else f"Serial port {path} does not exist: is the cable plugged in?"
        if missing is not None and not waits:
            raise ConnectionSetupError(missing)
        stream = None
        try:
            stream = self._device() if missing is None else None
        except BlockingIOError as error:
            # As long as the one before says its last words.
            missing = f"Serial port {path} is in use by another program: stop that first."
            if not waits:
                raise ConnectionSetupError(missing) from error
        except (OSError, ValueError) as error:
            text = f"Serial port {path} cannot be opened: {plain(error)}."
            if isinstance(error, PermissionError):
                text += " Its group, often dialout, may: sudo usermod -aG dialout $USER."
            raise ConnectionSetupError(text) from error
        super().__init__(stream, self._device, missing)

    def _device(self) -> Stream:
        import serial  # only here: it costs start-up time

        links = [link for link in self._links if link.exists()]
        if self._links and not links:
            raise FileNotFoundError(self._links[0])
        path = str(links[0]) if links else self._path
        # 8 data bits, no parity, one stop bit, without flow control, as PX4's TELEM ports. Of two programs on a port
        # each would hear a part.
        try:
            port = serial.Serial(path, self._baud, exclusive=True)
        except serial.SerialException as error:
            # The system's error, as its own class: pyserial keeps the number alone.
            raise error if error.errno is None else OSError(error.errno, os.strerror(error.errno)) from None
        stream = Stream(port, path, BITS_A_BYTE / self._baud)
        device = Path(path).resolve()
        self._links = sorted(link for link in SERIAL_BY_ID.glob("*") if link.resolve() == device)
        return stream
