"""Tells the latest state over a Unix socket: each client gets one line of JSON, and nothing is read from it.

The flight's thread hands a snapshot over, ten times a second at most, and is done; a thread of its own answers.
"""

import contextlib
import errno
import json
import os
import socket
import threading
import time
from collections.abc import Callable, Mapping, Sequence
from dataclasses import asdict
from pathlib import Path
from typing import TYPE_CHECKING, Any

from companion.errors import ReboundError
from rebound_cli import __version__
from rebound_cli.run_folder import HIT_KINDS
from rebound_cli.status.place import socket_of_this_program

if TYPE_CHECKING:
    from companion.report import Event, Status

# As often as a person's eyes can follow; whoever asks faster is answered no faster, and takes no time from the flight.
INTERVAL_S = 0.1
# More than that ask at once by mistake alone; they are refused, and may ask again.
_WAITING_CLIENTS = 5
_OWNER_ALONE = 0o600


class StatusServerError(ReboundError):
    """There is no socket to be had; a flight does without."""


class StatusServer:
    """Until `close`. `about` is what does not change: which command, which folder."""

    def __init__(self, path: Path, about: Mapping[str, Any]) -> None:
        """Raises StatusServerError."""
        self._path = path
        self._about = {"schema": 1, "version": __version__, "pid": os.getpid(), **about}
        self._latest: tuple[float, Mapping[str, Any]] | None = None
        self._hits = 0
        self._last_event: str | None = None
        self._due_s = 0.0
        self._ended = threading.Event()
        self._listener = _listener(path)
        self._thread = threading.Thread(target=self._serve, name="rebound status", daemon=True)
        self._thread.start()

    def hand_over(self, status: "Callable[[], Status]", events: "Sequence[Event]", running_s: float, link: str) -> None:
        """Called with every step and its events; costs a look at the clock as long as nothing is due."""
        for event in events:
            self._hits += event.kind in HIT_KINDS
            self._last_event = event.text
        now_s = time.monotonic()
        if now_s < self._due_s:
            return
        self._due_s = now_s + INTERVAL_S
        told = {"running_s": round(running_s, 1), "link": link, "hits": self._hits, "last_event": self._last_event}
        self._latest = now_s, {**asdict(status()), **told}

    def answer(self) -> bytes:
        """`age_s`: how long ago the flight's own loop told; null before it has begun."""
        latest = self._latest
        told = {"age_s": None} if latest is None else {"age_s": round(time.monotonic() - latest[0], 3), **latest[1]}
        return json.dumps({**self._about, **told}).encode() + b"\n"

    def close(self) -> None:
        self._ended.set()
        # Wakes the thread out of `accept`.
        with contextlib.suppress(OSError):
            self._listener.shutdown(socket.SHUT_RDWR)
        self._thread.join()
        self._listener.close()
        with contextlib.suppress(FileNotFoundError):
            self._path.unlink()

    def _serve(self) -> None:
        while not self._ended.is_set():
            try:
                client, _ = self._listener.accept()
            except OSError:
                # Closed, or a client that has gone again.
                self._ended.wait(INTERVAL_S)
                continue
            with client, contextlib.suppress(OSError):
                # A line fits the socket's buffer. A client that does not read, or has gone, is not waited for.
                client.setblocking(False)
                client.send(self.answer())
            self._ended.wait(INTERVAL_S)


def _listener(path: Path) -> socket.socket:
    listener = socket.socket(socket.AF_UNIX, socket.SOCK_STREAM)
    try:
        path.parent.mkdir(mode=0o700, parents=True, exist_ok=True)
        try:
            listener.bind(str(path))
        except OSError as error:
            if error.errno != errno.EADDRINUSE or is_answered(path):
                raise
            # What a program that was killed has left.
            path.unlink()
            listener.bind(str(path))
        # Before it listens nobody can connect.
        path.chmod(_OWNER_ALONE)
        listener.listen(_WAITING_CLIENTS)
    except OSError as error:
        listener.close()
        why = "another program answers there" if error.errno == errno.EADDRINUSE else error.strerror or str(error)
        raise StatusServerError(f"`rebound status` cannot ask this program at {path}: {why}.") from error
    return listener


def is_answered(path: Path) -> bool:
    with socket.socket(socket.AF_UNIX, socket.SOCK_STREAM) as probe:
        return probe.connect_ex(str(path)) == 0


def served(tell: Callable[[str], None], **about: Any) -> contextlib.AbstractContextManager[StatusServer | None]:
    """None where the machine has no place for a socket, or the place is taken: `tell` is told of that."""
    path = socket_of_this_program()
    try:
        return contextlib.nullcontext() if path is None else contextlib.closing(StatusServer(path, about))
    except StatusServerError as error:
        tell(str(error))
        return contextlib.nullcontext()
