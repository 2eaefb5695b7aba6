"""The folder of one flight: what was flown, with what, and every byte and event of it."""

import fcntl
import json
import os
import platform
import re
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager, suppress
from datetime import UTC, datetime
from importlib import metadata
from pathlib import Path
from typing import TYPE_CHECKING, Any

import yaml

from companion.errors import ReboundError
from companion.memory.stored import as_data
from companion.shell.files import write_whole
from companion.shell.tlog import TlogWriter, may_be_logged
from rebound_cli import __version__
from rebound_cli.background import Background, at_once

if TYPE_CHECKING:
    from companion.companion import StepResult
    from companion.memory.patch import Patch
    from companion.report import Event

RUNS_FOLDER = Path("runs")

TLOG_NAME = "flight.tlog"
EVENTS_NAME = "events.jsonl"
INPUTS_NAME = "inputs.jsonl"
SUMMARY_NAME = "summary.json"
REPORT_NAME = "report.html"
TRUTH_NAME = "truth.npz"
MISSION_NAME = "mission.yaml"
GUARD_NAME = "guard.yaml"
RESOLVED_NAME = "resolved.yaml"
AIRFRAME_NAME = "airframe.yaml"
VERSIONS_NAME = "versions.json"
VEHICLE_LOG_NAME = "vehicle.log"
OBSTACLES_NAME = "obstacles.json"

# Events by what they add to the hits: one that was answered, one left to the program that flies, one that was none.
HIT_KINDS = {"detection": 1, "left_alone": 1, "unconfirmed": -1}

# The packages whose version can change the bytes or the figures of a flight.
_VERSIONED = "pymavlink fastcrc numpy numba filterpy shapely pydantic pyserial matplotlib"


class RunFolderError(ReboundError):
    """The folder cannot be made, already holds a flight, or holds a damaged one."""


def check_place(out: Path | None) -> None:
    """Before minutes of compiling whose flight could not be kept. Raises RunFolderError."""
    place = wanted = out or RUNS_FOLDER
    while not place.exists() and place != place.parent:
        place = place.parent
    if not place.is_dir() or not os.access(place, os.W_OK | os.X_OK):
        raise RunFolderError(f"The run folder {wanted} cannot be made: nothing can be written to {place.absolute()}.")
    # Through a folder that is made only now, as new/../flight, it leads to one that is there.
    for name, what in ((TLOG_NAME, "a flight"), (GUARD_NAME, GUARD_NAME), (AIRFRAME_NAME, AIRFRAME_NAME)):
        if out is not None and (out.resolve() / name).exists():
            raise RunFolderError(f"{out} already holds {what}: give --out another folder.")


def create_run_folder(out: Path | None, mission_name: str) -> Path:
    """`out` itself when given, otherwise a new `runs/<UTC time>-<mission>`. Raises RunFolderError, OSError."""
    check_place(out)
    if out is not None:
        out.mkdir(parents=True, exist_ok=True)
        return out
    slug = re.sub(r"[^A-Za-z0-9_.-]+", "-", mission_name).strip("-.") or "mission"
    stem, number = f"{datetime.now(UTC):%Y%m%dT%H%M%SZ}-{slug}", 1
    RUNS_FOLDER.mkdir(parents=True, exist_ok=True)
    while True:
        folder = RUNS_FOLDER / (stem if number == 1 else f"{stem}-{number}")
        with suppress(FileExistsError):
            folder.mkdir()
            return folder
        number += 1


def forget(folder: Path, *more: str) -> None:
    """Remove what a guard, and `more` that a flight has written there, and the folder where nothing else is in it."""
    for name in (TLOG_NAME, EVENTS_NAME, INPUTS_NAME, SUMMARY_NAME, GUARD_NAME, VERSIONS_NAME, *more):
        (folder / name).unlink(missing_ok=True)
    with suppress(OSError):
        folder.rmdir()


class FlightRecorder:
    """Writes packets and events as they happen and keeps the events for the timeline.

    What a replay needs besides is in a file of its own: the steps of which no packet tells, because nothing came
    and nothing was sent, and what the companion was told. With a `writer` no call waits for the disk or raises, and
    what is written reaches the disk twice a second: a power cut takes no more than that, a packet's step and events
    never before the packet. `make_room` is asked before packets are written, and raises where there is no room.
    """

    def __init__(
        self, folder: Path, writer: Background | None = None, make_room: Callable[[int], None] | None = None
    ) -> None:
        self._folder = folder
        self.writer = writer
        self._do = at_once if writer is None else writer.give
        self._make_room = make_room
        self._obstacles: Sequence[Patch] | None = None
        self._tlog = TlogWriter(folder / TLOG_NAME, None if writer is None else self._sync_lines)
        # Line-buffered: events are few, and the last one before a kill is the one that matters.
        self._events_file = (folder / EVENTS_NAME).open("w", encoding="utf-8", buffering=1)
        self._inputs_file = (folder / INPUTS_NAME).open("w", encoding="utf-8", buffering=1)
        # Not every file system knows locks; without one the flight is only told from others by its process.
        with suppress(OSError):
            fcntl.flock(self._events_file, fcntl.LOCK_SH)  # whoever looks whether it is flown has it for a moment
        if writer is not None:
            for entries in (folder, folder.parent):
                # So that their names outlive a power cut.
                descriptor = os.open(entries, os.O_RDONLY)
                os.fsync(descriptor)
                os.close(descriptor)
        self.events: list[Event] = []

    def record(self, now_us: int, result: "StepResult") -> None:
        if result.events:
            self.events += result.events
        self._do(self._write_step, now_us, result)

    def _write_step(self, now_us: int, result: "StepResult") -> None:
        # What is small first: a log that may grow no more costs no event.
        for event in result.events:
            self._events_file.write(event_line(event))
        # Foreign bytes and broken packets could hide a good one from whoever reads the log; a key is nobody's to read.
        received = [frame for frame in result.received_frames if may_be_logged(frame)]
        if not result.sent_frames and not received:
            self._inputs_file.write(f'{{"time_us": {now_us}, "kind": "step"}}\n')
        if self._make_room is not None:
            self._make_room(now_us)
        for frames in filter(None, (received, result.sent_frames)):
            self._tlog.write(now_us, frames)

    def _sync_lines(self) -> None:
        for file in (self._events_file, self._inputs_file):
            os.fdatasync(file.fileno())

    def record_input(self, now_us: int, kind: str, **data: Any) -> None:
        """What the companion was told besides, after its step at `now_us`: `confirm` (the plan), `stop` (and why),
        `file` (the one it waits for exists), `note` (an event and its text), `computer` (its status), `setpoint` and
        `interval` (what a client has sent).
        """
        self._do(self._inputs_file.write, json.dumps({"time_us": now_us, "kind": kind, **data}) + "\n")

    def record_obstacles(self, patches: "Sequence[Patch]") -> None:
        """The memory as it is by now."""
        if patches != self._obstacles:
            self._obstacles = patches
            self._do(write_json, self._folder / OBSTACLES_NAME, {"patches": [as_data(patch) for patch in patches]})

    def close(self) -> None:
        """Return when all is written that could be."""
        for file in (self._tlog, self._events_file, self._inputs_file):
            self._do(file.close)
        if self.writer is not None:
            self.writer.close()


def event_line(event: "Event") -> str:
    """The event as `events.jsonl` has it."""
    record = {"time_us": event.time_us, "kind": event.kind, "text": event.text, "data": dict(event.data)}
    return json.dumps(record) + "\n"


def read_records(path: Path, text: str) -> Iterator[dict[str, Any]]:
    """Each line of `events.jsonl` or `inputs.jsonl` with its time and kind. Raises RunFolderError for a damaged one."""
    for number, line in enumerate(text.splitlines(), start=1):
        with reading(f"{path}:{number}"):
            record = json.loads(line)
            record["time_us"], record["kind"] = int(record["time_us"]), str(record["kind"])
        yield record


@contextmanager
def reading(place: object) -> Iterator[None]:
    """A damaged file makes its reader raise whatever the bytes led to: that is one sentence. Raises RunFolderError."""
    try:
        yield
    except (OSError, ReboundError):
        raise
    except Exception as error:
        raise RunFolderError(f"{place}: not what a flight leaves there; the file is damaged.") from error


def whole_lines(text: str) -> str:
    """Without a last line that a kill or a power cut left unfinished."""
    return text[: text.rfind("\n") + 1]


def read_text(path: Path) -> str:
    """Raises RunFolderError."""
    try:
        return path.read_text(encoding="utf-8")
    except (OSError, UnicodeDecodeError) as error:
        reason = error.strerror if isinstance(error, OSError) and error.strerror else "it is not UTF-8 text"
        raise RunFolderError(f"{path}: cannot be read: {reason}.") from error


def read_summary(folder: Path) -> dict[str, Any] | None:
    """None of a flight that is not over, or was cut off."""
    with suppress(OSError, ValueError, TypeError, RecursionError):
        return dict(json.loads((folder / SUMMARY_NAME).read_text(encoding="utf-8")))
    return None


def write_yaml(path: Path, data: Any) -> None:
    write_whole(path, yaml.safe_dump(data, sort_keys=False, allow_unicode=True).encode())


def write_json(path: Path, data: Any) -> None:
    write_whole(path, (json.dumps(data, indent=2) + "\n").encode())


def versions() -> dict[str, str]:
    """What a replay needs to match: the program, Python, the machine and the packages."""
    system = os.uname()
    # As platform.platform() has it, which starts a process to ask.
    machine = f"{system.sysname}-{system.release}-{system.machine}-with-{''.join(platform.libc_ver())}"
    found = {"px4-rebound": __version__, "python": platform.python_version(), "machine": machine}
    for package in _VERSIONED.split():
        with suppress(metadata.PackageNotFoundError):
            found[package] = metadata.version(package)
    return found
