"""The page in its folder; by `python -m`, with everything else on the computer before it."""

import os
import sys
from argparse import Namespace
from pathlib import Path

from companion.shell.files import write_whole
from rebound_cli.flights.kept import flight_named, runs_folder
from rebound_cli.replay.recording import Followed
from rebound_cli.report.page import page
from rebound_cli.report.shown_flight import ShownFlight, followed_flight, recorded_flight
from rebound_cli.results.run_folder import REPORT_NAME


def run_report(options: Namespace) -> int:
    """Raises ReboundError."""
    folder = flight_named(runs_folder(options.runs), options.flight).folder
    print(f"The report is in {write_report(folder, options.out, options.no_position)}")
    return 0


def write_report(
    folder: Path, out: Path | None = None, no_position: bool = False, followed: Followed | None = None
) -> Path:
    """Of a run's folder, into it where no other file is named. Raises ReboundError, OSError."""
    # Where nothing was heard, that is what reading it says.
    if followed is not None and followed.started_at_us:
        flight = followed_flight(folder, followed)
    else:
        flight = recorded_flight(folder)
    return write_page(flight, out or folder / REPORT_NAME, no_position)


def write_page(flight: ShownFlight, path: Path, no_position: bool = False) -> Path:
    """Raises OSError."""
    write_whole(path, page(flight, no_position).encode())
    return path


if __name__ == "__main__":
    os.nice(19)
    write_report(Path(sys.argv[1]))
