"""The page in its folder; by `python -m`, with everything else on the computer before it."""

import os
import sys
from pathlib import Path

from companion.shell.files import write_whole
from rebound_cli.report.page import page
from rebound_cli.report.shown_flight import ShownFlight, recorded_flight
from rebound_cli.run_folder import REPORT_NAME


def write_report(folder: Path, out: Path | None = None, no_position: bool = False) -> Path:
    """Of a run's folder, into it where no other file is named. Raises ReboundError, OSError."""
    return write_page(recorded_flight(folder), out or folder / REPORT_NAME, no_position)


def write_page(flight: ShownFlight, path: Path, no_position: bool = False) -> Path:
    """Raises OSError."""
    write_whole(path, page(flight, no_position).encode())
    return path


if __name__ == "__main__":
    os.nice(19)
    write_report(Path(sys.argv[1]))
