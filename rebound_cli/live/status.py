"""The state of a running program over a Unix socket, on a thread of its own; `rebound status` asks.

Each client gets one line of JSON, and nothing is read from it.
"""

import contextlib
import errno
import json
import os
import socket
import tempfile
import threading
import time
from argparse import Namespace
from collections.abc import Callable, Mapping, Sequence
from dataclasses import asdict
from pathlib import Path
from typing import Any

from companion.errors import ReboundError
from companion.report import Event, Status
from rebound_cli import __version__
from rebound_cli.live.console import state_fields
from rebound_cli.results.run_folder import HIT_KINDS

# Of a service that sets RuntimeDirectory=rebound; whoever asks has not that service's environment.
SERVICE_SOCKET = Path("/run/rebound/status.sock")
# As often as a person's eyes can follow; whoever asks faster is answered no faster, and takes no time from the flight.
INTERVAL_S = 0.1
# More than that ask at once by mistake alone; they are refused, and may ask again.
_WAITING_CLIENTS = 5
_OWNER_ALONE = 0o600
# An answer is ready; between two it waits a tenth of a second, and others may be before this one.
PATIENCE_S = 2.0
# A state this much older than the interval stands still.
STANDS_STILL_S = 1.0
_MOST_BYTES = 65_536


class StatusError(ReboundError):
    """Nobody answers, or not what a status is; or there is no socket to be had, and a flight does without."""


def socket_of_this_program(environment: Mapping[str, str] = os.environ) -> Path:
    """Where nobody gives programs a folder of their own, as a login without a session, it is below /tmp."""
    if folder := environment.get("RUNTIME_DIRECTORY"):
        # systemd separates several by colons.
        return Path(folder.split(":")[0]) / SERVICE_SOCKET.name
    if folder := environment.get("XDG_RUNTIME_DIR"):
        return Path(folder) / "rebound" / SERVICE_SOCKET.name
    return Path(tempfile.gettempdir()) / f"rebound-{os.getuid()}" / SERVICE_SOCKET.name


def sockets_to_ask(environment: Mapping[str, str] = os.environ) -> list[Path]:
    """Of whoever asks, then where others of this user have it: a desktop's session has a folder that cron has not."""
    user = os.getuid()
    places = [Path(f"/run/user/{user}/rebound"), Path(tempfile.gettempdir()) / f"rebound-{user}"]
    others = [place / SERVICE_SOCKET.name for place in places]
    return list(dict.fromkeys([socket_of_this_program(environment), *others, SERVICE_SOCKET]))


class StatusServer:
    """Until `close`. `about` is what does not change: which command, which folder."""

    def __init__(self, path: Path, about: Mapping[str, Any]) -> None:
        """Raises StatusError."""
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

    def hand_over(self, status: Callable[[], Status], events: Sequence[Event], running_s: float, link: str) -> None:
        """Called with every step and its events; costs a look at the clock as long as nothing is due."""
        for event in events:
            self._hits += HIT_KINDS.get(event.kind, 0)
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
        self._path.unlink(missing_ok=True)

    def _serve(self) -> None:
        while not self._ended.is_set():
            # Closed, or a client that has gone again or does not read: none is waited for.
            with contextlib.suppress(OSError), self._listener.accept()[0] as client:
                client.setblocking(False)
                # A line fits the socket's buffer.
                client.send(self.answer())
            self._ended.wait(INTERVAL_S)


def _listener(path: Path) -> socket.socket:
    listener = socket.socket(socket.AF_UNIX, socket.SOCK_STREAM)
    try:
        path.parent.mkdir(mode=0o700, parents=True, exist_ok=True)
        if path.parent.stat().st_uid != os.getuid():
            raise OSError(errno.EPERM, "the folder is another user's")
        with socket.socket(socket.AF_UNIX, socket.SOCK_STREAM) as probe:
            # One whose program stands still has a full queue.
            probe.setblocking(False)
            if probe.connect_ex(str(path)) in (0, errno.EAGAIN):
                raise OSError(errno.EADDRINUSE, "another program answers there")
        # What a program that was killed has left.
        path.unlink(missing_ok=True)
        listener.bind(str(path))
        # Before it listens nobody can connect.
        path.chmod(_OWNER_ALONE)
        listener.listen(_WAITING_CLIENTS)
    except OSError as error:
        listener.close()
        raise StatusError(f"`rebound status` cannot ask this program at {path}: {error.strerror or error}.") from error
    return listener


def served(tell: Callable[[str], None], **about: Any) -> contextlib.AbstractContextManager[StatusServer | None]:
    """None where the place for the socket is taken, or there is none: `tell` is told of that."""
    try:
        return contextlib.closing(StatusServer(socket_of_this_program(), about))
    except StatusError as error:
        tell(str(error))
        return contextlib.nullcontext()


def run_status(options: Namespace) -> None:
    """Raises StatusError where nothing runs."""
    status = ask(options.socket)
    print(json.dumps(status, indent=2) if options.json else text_of(status))


def ask(path: Path | None) -> Mapping[str, Any]:
    """At this socket, or at the first that answers. Raises StatusError."""
    paths = sockets_to_ask() if path is None else [path]
    for asked in paths:
        try:
            return _answer(asked)
        except PermissionError as error:
            text = f"{asked}: only root and the user whose program answers there may ask: try sudo."
            raise StatusError(text) from error
        except OSError:
            continue
    places = " or ".join(map(str, paths))
    raise StatusError(f"Nothing answers at {places}: is `rebound guard` or `rebound fly --connect` running?")


def _answer(path: Path) -> Mapping[str, Any]:
    with socket.socket(socket.AF_UNIX, socket.SOCK_STREAM) as client:
        client.settimeout(PATIENCE_S)
        client.connect(str(path))
        line = b""
        while len(line) < _MOST_BYTES and (piece := client.recv(_MOST_BYTES)):
            line += piece
    try:
        status = dict(json.loads(line))
        text_of(status)
    except (ValueError, TypeError, KeyError) as error:
        raise StatusError(f"{path}: what answers there is not Rebound, or is of another version.") from error
    return status


def text_of(status: Mapping[str, Any]) -> str:
    """Lines for a person."""
    head = f"{status['command']}, process {status['pid']}, version {status['version']}, folder {status['folder']}"
    age_s = status["age_s"]
    if age_s is None:
        return f"{head}\nstarting"
    told = Status(**{name: status[name] for name in Status.__slots__})
    fields = dict(state_fields(told, status["running_s"], status["link"]))
    fields |= {"hits": str(status["hits"]), "last": status["last_event"] or "-"}
    lines = [head, *(f"{name:11}{text}" for name, text in fields.items())]
    if age_s > STANDS_STILL_S:
        lines.append(f"The program has told nothing for {age_s:.1f} s: its loop stands still.")
    return "\n".join(lines)
