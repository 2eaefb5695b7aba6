"""Room for the present flight: the oldest flights go where all together pass a budget or the disk has too little left.

Not in the flight's own thread: files are looked at and removed where the log is written.
"""

import errno
import os
import shutil
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path

from companion.mission.config import DiskConfig
from rebound_cli.flights.kept import KeptFlight, has_hit, kept_flights, size_of

_MB = 1_000_000
_MIB = 1 << 20
# journald's SystemMaxUse: a tenth of the file system, and 4 GiB at most (journald.conf(5)).
_MOST_BYTES = 4096 * _MIB
# PX4's logger removes its oldest logs until so much is free, or a tenth of a smaller disk (logger/util.cpp).
_FREE_BYTES = 300 * _MIB
# With less than this PX4's logger records nothing (logger/util.cpp). Here packets end; events, the summary and the
# time stamps of signatures still find room.
LAST_BYTES = 10 * _MIB
# At PX4's fastest streams packets are some 125 kB a second: a little more than a megabyte by then.
LOOK_EVERY_US = 10_000_000
# Renamed to this before it is removed: a power cut leaves no half of a flight behind under its name.
_GOING = ".removed-"


@dataclass(frozen=True, slots=True)
class Limits:
    """In bytes: of all flights together, and of what is left free."""

    max_use: int
    keep_free: int


def limits_of(config: DiskConfig, file_system_bytes: int) -> Limits:
    tenth = file_system_bytes // 10
    return Limits(
        min(tenth, _MOST_BYTES) if config.max_use_mb is None else round(config.max_use_mb * _MB),
        min(tenth, _FREE_BYTES) if config.keep_free_mb is None else round(config.keep_free_mb * _MB),
    )


def bytes_to_go(used_bytes: int, free_bytes: int, limits: Limits) -> int:
    """How much is to be removed, of what all flights take and what is free."""
    return max(used_bytes - limits.max_use, limits.keep_free - free_bytes, 0)


def order_to_go(flights: Sequence[KeptFlight], has_hit: Callable[[KeptFlight], bool]) -> list[KeptFlight]:
    """Of flights from the oldest to the newest: those without a hit, then those with one."""
    return sorted(flights, key=has_hit)


class Ring:
    """Of the flights beside the present one's folder."""

    def __init__(self, present: Path, config: DiskConfig) -> None:
        self._present, self._runs = present, present.parent
        self._config = config
        self._due_us = 0
        self._others_bytes: int | None = None  # what the others take: they do not change
        self._hits: dict[Path, bool] = {}
        self._has_room = True

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
        limits = limits_of(self._config, disk.total)
        if self._others_bytes is None:
            # What a power cut left of one that was being removed.
            for folder in self._runs.glob(f"{_GOING}*"):
                shutil.rmtree(folder, ignore_errors=True)
            self._others_bytes = sum(flight.size_bytes for flight in self._others())
        to_go = bytes_to_go(self._others_bytes + size_of(self._present), disk.free, limits)
        if to_go > 0:
            self._remove(to_go)
        self._has_room = shutil.disk_usage(self._runs).free >= min(LAST_BYTES, limits.keep_free)

    def _others(self) -> list[KeptFlight]:
        return [flight for flight in kept_flights(self._runs) if flight.folder != self._present]

    def _remove(self, to_go: int) -> None:
        others = self._others()
        self._others_bytes = sum(flight.size_bytes for flight in others)
        for flight in order_to_go(others, self._has_hit):
            if to_go <= 0:
                return
            if _removed(flight):
                to_go -= flight.size_bytes
                self._others_bytes -= flight.size_bytes

    def _has_hit(self, flight: KeptFlight) -> bool:
        if flight.folder not in self._hits:
            self._hits[flight.folder] = has_hit(flight)
        return self._hits[flight.folder]


def room_for(folder: Path, out: Path | None, config: DiskConfig) -> Callable[[int], None] | None:
    """What a recorder asks before it writes packets; nothing where a person has named the folder, and keeps it."""
    return Ring(folder, config).make_room if out is None else None


def _removed(flight: KeptFlight) -> bool:
    """Not where another program flies it now, or where it is somebody else's."""
    if flight.is_being_flown():
        return False
    going = flight.folder.with_name(_GOING + flight.name)
    try:
        os.rename(flight.folder, going)
    except OSError:
        return False
    shutil.rmtree(going, ignore_errors=True)
    return True
