"""The computer's status beside a flight: read on a thread of its own, because a disk that hangs answers nobody."""

from contextlib import AbstractContextManager, closing, nullcontext
from pathlib import Path

from companion.messages import ComputerStatus
from companion.shell.computer import ComputerReader
from rebound_cli.background import Background

# MAVLink's heartbeat goes as often, and a person watches no faster.
INTERVAL_US = 1_000_000
_LAST_WAIT_S = 0.1


class Computer:
    """Once a second the status of a second ago."""

    def __init__(self, folder: Path) -> None:
        self._reader = ComputerReader(folder)
        self._background = Background("the computer's status")
        self._latest: ComputerStatus | None = None
        self._due_us = 0

    def status(self, now_us: int) -> ComputerStatus | None:
        """None as long as none is due, and where none could be read."""
        if now_us < self._due_us:
            return None
        self._due_us = now_us + INTERVAL_US
        latest, self._latest = self._latest, None
        self._background.give(self._read, now_us)
        return latest

    def _read(self, now_us: int) -> None:
        self._latest = self._reader.read(now_us)

    def close(self) -> None:
        self._background.close(_LAST_WAIT_S)


def watched(folder: Path, is_wanted: bool) -> AbstractContextManager[Computer | None]:
    """The computer, and the disk that the folder is on; None where nobody wants to know."""
    return closing(Computer(folder)) if is_wanted else nullcontext()
