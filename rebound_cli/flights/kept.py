"""The flights of real vehicles in a folder of runs, told from all else there; and room for the present one.

Files are looked at and removed where the log is written, not in the flight's own thread.
"""

import errno
import fcntl
import os
import re
import shutil
import time
from collections.abc import Sequence
from contextlib import suppress
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from companion.errors import ReboundError
from companion.mission.config import DiskConfig
from companion.shell.tlog import packets_in
from rebound_cli.inputs.documents import nearest
from rebound_cli.results import run_folder
from rebound_cli.results.run_folder import EVENTS_NAME, RUNS_FOLDER, TLOG_NAME, read_records, read_text, whole_lines

# As `create_run_folder` names them.
_NAMED_BY_US = re.compile(r"(\d{8}T\d{6}Z)-.+")
# Some packets, however long they are.
_FIRST_BYTES = 1000
# The unit of stat's st_blocks, whatever the file system's own is.
_BLOCK_BYTES = 512
# Where a service flies: below systemd's StateDirectory=rebound.
SERVICE_RUNS = Path("/var/lib/rebound/runs")

_MB = 1_000_000
_MIB = 1 << 20
# journald's SystemMaxUse: a tenth of the file system, and 4 GiB at most (journald.conf(5)).
_MOST_BYTES = 4096 * _MIB
# PX4's logger removes its oldest logs until so much is free, or a tenth of a smaller disk (logger/util.cpp).
_FREE_BYTES = 300 * _MIB
# With less than this PX4's logger records nothing (logger/util.cpp). Here packets end; events, the summary and the
# time stamps of signatures still find room.
LAST_BYTES = 10 * _MIB
# journald's SystemMaxFileSize: an eighth of the budget a file, so that seven older ones stay (journald.conf(5)).
_FLIGHTS_A_BUDGET = 8
# At PX4's fastest streams packets are some 125 kB a second: a little more than a megabyte by then.
LOOK_EVERY_US = 10_000_000
# Renamed to this before it is removed: a power cut leaves no half of a flight behind under its name.
_GOING = ".removed-"


@dataclass(frozen=True, slots=True)
class KeptFlight:
    folder: Path
    size_bytes: int

    @property
    def name(self) -> str:
        return self.folder.name

    @property
    def is_ours(self) -> bool:
        """A folder that a person has named is that person's."""
        return _NAMED_BY_US.fullmatch(self.name) is not None

    def is_being_flown(self) -> bool:
        """Its recorder holds a lock, which the kernel takes away with the process."""
        try:
            with (self.folder / EVENTS_NAME).open("rb") as file:
                fcntl.flock(file, fcntl.LOCK_EX | fcntl.LOCK_NB)
        except OSError as error:
            return isinstance(error, BlockingIOError)
        return False

    def end(self) -> str:
        """How it ended, for a person."""
        if self.is_being_flown():
            return "being flown"
        summary = run_folder.read_summary(self.folder)
        return "cut off" if summary is None else str(summary.get("reason") or summary.get("outcome"))

    def event_lines(self) -> Sequence[str]:
        """Of `events.jsonl`, as far as they were written. Raises RunFolderError."""
        return whole_lines(read_text(self.folder / EVENTS_NAME)).splitlines(keepends=True)

    def timed_events(self, lines: Sequence[str]) -> list[tuple[float, dict[str, Any]]]:
        """Of such lines from the first on: each event, and when, in seconds since the flight's first step.

        A flight begins with a packet, a heartbeat; without room for packets by its first event. Raises RunFolderError.
        """
        events = list(read_records(self.folder / EVENTS_NAME, "".join(lines)))
        with (self.folder / TLOG_NAME).open("rb") as tlog:
            stamps_us = [stamp_us for stamp_us, _, _ in packets_in(tlog.read(_FIRST_BYTES))]
        stamps_us += [event["time_us"] for event in events]
        return [((event["time_us"] - stamps_us[0]) / 1e6, event) for event in events]

    def has_hit(self) -> bool:
        """Where that cannot be read it might have."""
        try:
            return hits_in(self.event_lines()) > 0
        except ReboundError:
            return True

    def remove(self) -> bool:
        """Not where another program flies it now, or where it is somebody else's."""
        if self.is_being_flown():
            return False
        going = self.folder.with_name(_GOING + self.name)
        try:
            os.rename(self.folder, going)
        except OSError:
            return False
        shutil.rmtree(going, ignore_errors=True)
        return True


def hits_in(lines: Sequence[str]) -> int:
    """Of lines as `event_line` writes them, which need not be parsed for it."""
    return sum(adds * line.count(f'"kind": "{kind}"') for kind, adds in run_folder.HIT_KINDS.items() for line in lines)


def hits_text(hits: int) -> str:
    return f"{hits or 'no'} hit{'s' if hits > 1 else ''}"


def size_of(folder: Path) -> int:
    """What it takes of the disk, in bytes: an empty file is smaller than that."""
    return sum(file.lstat().st_blocks * _BLOCK_BYTES for file in folder.iterdir())


def runs_folder(given: Path | None) -> Path:
    """The folder of runs that a person means. Raises RunFolderError where there is none of that name."""
    if given is not None and not given.is_dir():
        raise run_folder.RunFolderError(f"{given} is no folder.")
    return given or (SERVICE_RUNS if SERVICE_RUNS.is_dir() and not RUNS_FOLDER.is_dir() else RUNS_FOLDER)


def kept_flights(runs: Path) -> list[KeptFlight]:
    """The oldest first; none where there is no such folder. A simulated vehicle's have its airframe in them."""
    found = []
    for folder in runs.iterdir() if runs.is_dir() else ():
        name = _NAMED_BY_US.fullmatch(folder.name)
        tlog = folder / TLOG_NAME
        # One that another program has just removed is none, nor what may not be looked into.
        with suppress(OSError):
            is_flight = tlog.is_file() and not folder.is_symlink() and not folder.name.startswith(_GOING)
            if is_flight and not (folder / run_folder.AIRFRAME_NAME).exists():
                ended_s = tlog.stat().st_mtime
                began = name[1] if name else time.strftime("%Y%m%dT%H%M%SZ", time.gmtime(ended_s))
                found.append((began, ended_s, KeptFlight(folder, size_of(folder))))
    return [flight for *_, flight in sorted(found, key=lambda entry: entry[:2])]


def flight_named(runs: Path, name: str) -> KeptFlight:
    """`last`, a name in the folder of runs, or a path. Raises RunFolderError."""
    flights = kept_flights(runs)
    if name == "last" and flights:
        return flights[-1]
    if name == "last":
        raise run_folder.RunFolderError(f"No flight of a vehicle is in {runs}.{simulated_text(runs)}")
    for folder in (runs / name, Path(name).resolve()):
        if (folder / TLOG_NAME).is_file():
            return KeptFlight(folder, size_of(folder))
    if Path(name).exists():
        raise run_folder.RunFolderError(f"{name} is no flight's folder; `rebound replay` reads logs.")
    near = nearest(name, [flight.name for flight in flights])
    meant = f"did you mean {near}?" if near else "`rebound logs list` names those that are."
    raise run_folder.RunFolderError(f"No flight {name} is in {runs}; {meant}")


def simulated_text(runs: Path) -> str:
    """Where flights of simulated vehicles lie beside those that are told of."""
    # `Path.exists` raises where a folder may not be looked into.
    airframes = [folder / run_folder.AIRFRAME_NAME for folder in runs.iterdir()] if runs.is_dir() else []
    count = sum(map(os.path.exists, airframes))
    if count == 0:
        return ""
    what = "flight of a simulated vehicle is" if count == 1 else "flights of simulated vehicles are"
    return f" {count} {what} there too: give its folder, as in rebound report {runs}/NAME."


def limits_of(config: DiskConfig, file_system_bytes: int) -> tuple[int, int]:
    """In bytes: of all flights together, and of what is left free."""
    tenth = file_system_bytes // 10
    return (
        min(tenth, _MOST_BYTES) if config.max_use_mb is None else round(config.max_use_mb * _MB),
        min(tenth, _FREE_BYTES) if config.keep_free_mb is None else round(config.keep_free_mb * _MB),
    )


class Ring:
    """The oldest go where all together pass a budget or the disk has too little left; never the present one."""

    def __init__(self, present: Path, config: DiskConfig, is_named: bool = False) -> None:
        """`is_named`: the present one stands where a person wants it, beside what is none of ours."""
        self._present, self._runs, self._is_named = present, present.parent, is_named
        self._config = config
        self._due_us = 0
        self._has_room = True
        self.is_long = False
        """By the last look: of a vehicle at rest another record should begin, so that this one may go some day."""

    def make_room(self, now_us: int) -> None:
        """For the packets of the present flight. Raises OSError where nothing can go and the disk is nearly full."""
        if now_us >= self._due_us:
            self._due_us = now_us + LOOK_EVERY_US
            self._look()
        if not self._has_room:
            text = f"less than {LAST_BYTES // _MIB} MiB of the disk are free, packets are left out until there are more"
            raise OSError(errno.ENOSPC, text)

    def _look(self) -> None:
        disk = shutil.disk_usage(self._runs)
        max_use_bytes, keep_free_bytes = limits_of(self._config, disk.total)
        if self._is_named:
            self._has_room = disk.free >= min(LAST_BYTES, keep_free_bytes)
            return
        # What a power cut left of one that was being removed.
        for folder in self._runs.glob(f"{_GOING}*"):
            shutil.rmtree(folder, ignore_errors=True)
        others = [each for each in kept_flights(self._runs) if each.is_ours and each.folder != self._present]
        present_bytes = size_of(self._present) if self._present.exists() else 0
        used_bytes = sum(flight.size_bytes for flight in others) + present_bytes
        to_go = max(used_bytes - max_use_bytes, keep_free_bytes - disk.free)
        # From the oldest on: those without a hit, then those with one.
        for flight in sorted(others, key=KeptFlight.has_hit) if to_go > 0 else ():
            if to_go > 0 and flight.remove():
                to_go -= flight.size_bytes
        self._has_room = shutil.disk_usage(self._runs).free >= min(LAST_BYTES, keep_free_bytes)
        self.is_long = self._has_room and present_bytes > max(max_use_bytes // _FLIGHTS_A_BUDGET, LAST_BYTES)


def folder_with_room(out: Path | None, name: str, config: DiskConfig) -> tuple[Path, Ring]:
    """A flight's folder, and whose `make_room` a recorder asks before packets.

    On a disk that others have filled the oldest flights go before it is made. Raises RunFolderError, OSError.
    """
    if out is not None:
        folder = run_folder.create_run_folder(out, name)
        return folder, Ring(folder, config, is_named=True)
    with suppress(OSError):
        Ring(run_folder.RUNS_FOLDER / "next", config).make_room(LOOK_EVERY_US)
    folder = run_folder.create_run_folder(None, name)
    return folder, Ring(folder, config)
