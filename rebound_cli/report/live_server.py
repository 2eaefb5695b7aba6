"""`rebound watch`: the page of a flight while it is flown, from a program of its own that only reads files.

A browser may be slow or vanish: each has a thread here, and none in the program that flies.
"""

import re
import sys
import threading
from argparse import Namespace
from contextlib import suppress
from http.server import BaseHTTPRequestHandler, ThreadingHTTPServer
from pathlib import Path
from typing import Any

from companion.errors import ReboundError
from rebound_cli.live.status import ask
from rebound_cli.report.page import live_page
from rebound_cli.report.shown_flight import unseen_flight
from rebound_cli.report.tail import Tail, as_line
from rebound_cli.results import run_folder
from rebound_cli.results.run_folder import RunFolderError

# The log is written twice a second; read and passed on ten times a second it is little older in a browser.
LOOK_S = 0.1
# A browser that takes nothing for so long has gone, or sleeps: it asks again when it wakes.
PATIENCE_S = 10.0
_LOOPBACK = ("127.0.0.1", "localhost", "[::1]")
_PORT = re.compile(r":\d+$")  # of a Host; a browser leaves 80 out


class WatchServer(ThreadingHTTPServer):
    daemon_threads = True

    def __init__(self, folder: Path, host: str, port: int) -> None:
        """Raises OSError, ReboundError."""
        # Everything so far: it only grows, and each browser has its own place in it.
        self.told, self.is_over = list[bytes](), threading.Event()
        try:
            super().__init__((host, port), _Handler)
        except (OSError, UnicodeError) as error:
            raise ReboundError(
                f"{host}:{port}: nothing can be served there: {error}; give another --host or --port."
            ) from error
        self.page = live_page(unseen_flight(folder)).encode()
        self.names = _LOOPBACK if host in _LOOPBACK else ()
        self._tail = Tail(folder)
        self.reader = threading.Thread(target=self._read, name="rebound watch", daemon=True)
        self.reader.start()

    def _read(self) -> None:
        while not self.is_over.is_set():
            try:
                chunk = self._tail.read()
            except (ReboundError, OSError) as error:
                print(f"rebound: {error}", file=sys.stderr)
                return
            if chunk is not None:
                self.told.append(as_line(chunk))
            else:
                self.is_over.wait(LOOK_S)

    def server_close(self) -> None:
        self.is_over.set()
        super().server_close()

    def handle_error(self, request: Any, client_address: Any) -> None:
        """A browser that has gone is no news."""


class _Handler(BaseHTTPRequestHandler):
    server: WatchServer
    timeout = PATIENCE_S

    def do_GET(self) -> None:
        # A name that leads here by somebody else's server of names is another site's, and gets nothing.
        host = _PORT.sub("", self.headers.get("Host") or "")
        if self.server.names and host not in self.server.names:
            self.send_error(403)
        elif self.path == "/":
            self._answer("text/html; charset=utf-8")
            self.wfile.write(self.server.page)
        elif self.path == "/live":
            self._answer("text/event-stream")
            self._stream()
        else:
            self.send_error(404)

    def _answer(self, kind: str) -> None:
        self.send_response(200)
        self.send_header("Content-Type", kind)
        self.send_header("Cache-Control", "no-store")
        self.send_header("X-Content-Type-Options", "nosniff")
        self.end_headers()

    def _stream(self) -> None:
        sent = 0
        while not self.server.is_over.is_set():
            lines = self.server.told[sent:]
            # A comment finds out whether anybody is there.
            self.wfile.write(b"".join(lines) or b": still\n\n")
            sent += len(lines)
            self.server.is_over.wait(LOOK_S)

    def log_message(self, format: str, *arguments: Any) -> None:
        """Nothing: the terminal has one line, the address."""


def run_watch(options: Namespace) -> None:
    """Until Ctrl-C. Raises ReboundError where there is nothing to watch."""
    folder = options.flight or Path(str(ask(None)["folder"]))
    if not (folder / run_folder.TLOG_NAME).exists():
        raise RunFolderError(f"{folder}: no flight is there; give a run's folder.")
    with WatchServer(folder, options.host, options.port) as server, suppress(KeyboardInterrupt):
        print(f"{folder}: http://{options.host}:{server.server_port}/ (Ctrl-C ends it)", flush=True)
        server.serve_forever()
