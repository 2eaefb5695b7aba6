"""`rebound status`: what a running guard or flight says of itself."""

import json
import socket
from argparse import Namespace
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

from companion.errors import ReboundError
from companion.report import Status
from rebound_cli.console import state_fields
from rebound_cli.status.place import sockets_to_ask

# An answer is ready; between two it waits a tenth of a second, and others may be before this one.
PATIENCE_S = 2.0
# Ten times a second a running program tells its state: one this old stands still.
STANDS_STILL_S = 1.0
_MOST_BYTES = 65_536


class StatusError(ReboundError):
    """Nobody answers, or not what a status is."""


def run_status(options: Namespace) -> int:
    """Raises StatusError where nothing runs."""
    status = ask(options.socket)
    print(json.dumps(status, indent=2) if options.json else text_of(status))
    return 0


def ask(path: Path | None) -> Mapping[str, Any]:
    """At this socket, or at the first that answers. Raises StatusError."""
    paths = sockets_to_ask() if path is None else [path]
    for number, asked in enumerate(paths, start=1):
        try:
            return _answer(asked)
        except PermissionError as error:
            text = f"{asked}: only root and the user whose program answers there may ask: try sudo."
            raise StatusError(text) from error
        except OSError as error:
            if number == len(paths):
                text = f"Nothing answers at {_list(paths)}: is `rebound guard` or `rebound fly --connect` running?"
                raise StatusError(text) from error
    raise AssertionError("there is always a place to ask at")


def _answer(path: Path) -> Mapping[str, Any]:
    with socket.socket(socket.AF_UNIX, socket.SOCK_STREAM) as client:
        client.settimeout(PATIENCE_S)
        client.connect(str(path))
        line = b""
        while len(line) < _MOST_BYTES and (piece := client.recv(_MOST_BYTES)):
            line += piece
    try:
        return dict(json.loads(line))
    except (ValueError, TypeError) as error:
        raise StatusError(f"{path}: what answers there is not Rebound.") from error


def text_of(status: Mapping[str, Any]) -> str:
    """Lines for a person."""
    lines = [f"{status['command']}, process {status['pid']}, version {status['version']}, folder {status['folder']}"]
    age_s = status["age_s"]
    if age_s is None:
        return f"{lines[0]}\nstarting"
    told = Status(**{name: status[name] for name in Status.__slots__})
    fields = state_fields(told, status["running_s"], status["link"])
    lines += [
        f"{name:11}{text}"
        for name, text in (*fields, ("hits", str(status["hits"])), ("last", status["last_event"] or "-"))
    ]
    if age_s > STANDS_STILL_S:
        lines.append(f"The program has told nothing for {age_s:.1f} s: its loop stands still.")
    return "\n".join(lines)


def _list(paths: Sequence[Path]) -> str:
    return " or ".join(map(str, paths))
