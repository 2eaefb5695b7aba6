"""The flights of real vehicles in a folder of runs, told from all else that may lie there."""

import fcntl
import json
import re
from collections.abc import Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from companion.errors import ReboundError
from rebound_cli.run_folder import (
    AIRFRAME_NAME,
    EVENTS_NAME,
    HIT_KINDS,
    RUNS_FOLDER,
    SUMMARY_NAME,
    TLOG_NAME,
    read_text,
    whole_lines,
)

# As `create_run_folder` names them. A folder that a person has named is that person's.
_NAMED_BY_US = re.compile(r"(\d{8}T\d{6}Z)-.+")
# The unit of stat's st_blocks, whatever the file system's own is.
_BLOCK_BYTES = 512
# Where a service flies: below systemd's StateDirectory=rebound.
SERVICE_RUNS = Path("/var/lib/rebound/runs")


class FlightError(ReboundError):
    """No such flight."""


@dataclass(frozen=True, slots=True)
class KeptFlight:
    """A folder of a flight; `begun` is the UTC time of its name."""

    folder: Path
    begun: str
    size_bytes: int

    @property
    def name(self) -> str:
        return self.folder.name

    def is_being_flown(self) -> bool:
        """Its recorder holds a lock, which the kernel takes away with the process."""
        try:
            with (self.folder / EVENTS_NAME).open("rb") as file:
                fcntl.flock(file, fcntl.LOCK_EX | fcntl.LOCK_NB)
        except BlockingIOError:
            return True
        except OSError:
            return False
        return False

    def event_lines(self) -> Sequence[str]:
        """Of `events.jsonl`, as far as they were written. Raises RunFolderError."""
        return whole_lines(read_text(self.folder / EVENTS_NAME)).splitlines(keepends=True)

    def summary(self) -> Mapping[str, Any] | None:
        """None of a flight that is not over, or was cut off."""
        with suppress(OSError, ValueError):
            return dict(json.loads((self.folder / SUMMARY_NAME).read_text(encoding="utf-8")))
        return None


def hits_in(lines: Sequence[str]) -> int:
    """Of lines as `event_line` writes them, which need not be parsed for it."""
    return sum(line.count(f'"kind": "{kind}"') for line in lines for kind in HIT_KINDS)


def has_hit(flight: KeptFlight) -> bool:
    """Where that cannot be read it might have."""
    try:
        return hits_in(flight.event_lines()) > 0
    except ReboundError:
        return True


def size_of(folder: Path) -> int:
    """What it takes of the disk, in bytes: an empty file is smaller than that."""
    return sum(file.lstat().st_blocks * _BLOCK_BYTES for file in folder.iterdir())


def runs_folder(given: Path | None) -> Path:
    """The folder of runs that a person means."""
    return given or (SERVICE_RUNS if SERVICE_RUNS.is_dir() and not RUNS_FOLDER.is_dir() else RUNS_FOLDER)


def kept_flights(runs: Path) -> list[KeptFlight]:
    """The oldest first; none where there is no such folder. A simulated vehicle's have its airframe in them."""
    found = []
    for folder in runs.iterdir() if runs.is_dir() else ():
        name = _NAMED_BY_US.fullmatch(folder.name)
        tlog = folder / TLOG_NAME
        # One that another program has just removed is none.
        with suppress(FileNotFoundError):
            if name and not folder.is_symlink() and tlog.is_file() and not (folder / AIRFRAME_NAME).exists():
                found.append((name[1], tlog.stat().st_mtime, KeptFlight(folder, name[1], size_of(folder))))
    return [flight for *_, flight in sorted(found, key=lambda entry: entry[:2])]


def flight_named(runs: Path, name: str) -> KeptFlight:
    """`last`, a name in the folder of runs, or a path. Raises FlightError."""
    flights = kept_flights(runs)
    if name == "last":
        if not flights:
            raise FlightError(f"No flight of a vehicle is in {runs}.")
        return flights[-1]
    for folder in (runs / name, Path(name)):
        if (folder / TLOG_NAME).is_file():
            begun = _NAMED_BY_US.fullmatch(folder.name)
            return KeptFlight(folder, begun[1] if begun else "", size_of(folder))
    raise FlightError(f"No flight {name} is in {runs}; `rebound logs list` names those that are.")
